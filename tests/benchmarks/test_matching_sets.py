from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from benchmarks.matching.trials import DATA, distorted_set, hotel_set

from tsis.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path


def test_every_shape_kind_and_level_has_its_trials() -> None:
    trials = distorted_set(None, count=2)
    assert len(trials) == 2 * 2 * (5 + 6 + 5 + 6 + 6)
    assert len({trial.name for trial in trials}) == len(trials)
    assert {trial.name.split("/")[0] for trial in trials} == {"curve", "strokes"}


def test_a_level_that_one_kind_lacks_is_left_out_of_it() -> None:
    trials = distorted_set(None, families=["deformation", "noise"], shapes=["spiral"], levels=[6], count=1)
    assert [trial.name for trial in trials] == ["spiral/noise/6/0"]


@pytest.mark.skipif(not DATA.is_dir(), reason="the public trials are not on this machine")
def test_public_sets() -> None:
    assert len(distorted_set(DATA, count=3)) == 2 * 3 * 28
    assert len(hotel_set(DATA, count=2)) == 4 * (9 * 2 + 1)
    assert len(hotel_set(DATA, separations=[10], hidden=[0.0])) == 91


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"levels": [7]}, r"level must lie in \[1, 6\]"),
        ({"families": ["noise"], "levels": [0]}, "level"),
        ({"families": ["shear"]}, "no family of trials"),
        ({"shapes": ["fish"]}, "no shape"),
        ({"count": 0}, "count"),
    ],
)
def test_what_does_not_exist_is_refused(arguments: dict[str, object], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        distorted_set(None, **arguments)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="count"):
        hotel_set(tmp_path, count=0)

"""Changes of lamps and of ambient light from the levels of a lit patch and of a darker place."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tsis.calibration.guard.reading import OutsideLevel, lamps_and_ambient

PIXELS = np.zeros((2, 2))
DARK, LIT, DIM = 8.0, 120.0, 30.0  # grey levels before


def change(
    *, ratio: float, added: float, dark: float | None = DARK, patch: float | None = LIT, place: float | None = DIM
) -> tuple[float | None, float | None]:
    """What is found after the lamps changed by ``ratio`` and ambient light added ``added``."""
    base = dark or 0.0

    def now(level: float) -> float:
        return base + ratio * (level - base) + added

    prepared: Any = SimpleNamespace(
        dark_grey=dark,
        least_lit=20.0,
        patch_before=patch,
        patch_level=lambda _: None if patch is None else now(patch),
    )
    outside = (
        OutsideLevel(level=0.0) if place is None else OutsideLevel(level=0.0, before=place, since=now(place) - place)
    )
    return lamps_and_ambient(PIXELS, outside, prepared)


@pytest.mark.parametrize("ratio", [0.9, 1.0, 1.25])
@pytest.mark.parametrize("added", [0.0, 6.0])
@pytest.mark.parametrize("dark", [None, DARK])
def test_two_levels_give_lamps_and_ambient_light(ratio: float, added: float, dark: float | None) -> None:
    lamps, ambient = change(ratio=ratio, added=added, dark=dark)
    assert lamps == pytest.approx(ratio - 1)
    assert ambient == pytest.approx(added)


@pytest.mark.parametrize("ratio", [0.9, 1.25])
@pytest.mark.parametrize("place", [None, LIT - 10.0], ids=["no place", "a place as bright"])
def test_a_patch_alone_gives_the_change_of_the_lamps(ratio: float, place: float | None) -> None:
    lamps, ambient = change(ratio=ratio, added=0.0, place=place)
    assert lamps == pytest.approx(ratio - 1)
    assert ambient is None


def test_a_place_alone_gives_one_of_the_two() -> None:
    """A lit place gives the change of the lamps, a dark one the ambient light."""
    lamps, ambient = change(ratio=1.1, added=0.0, patch=None, place=60.0)
    assert lamps == pytest.approx(0.1)
    assert ambient is None
    for dark, place in ((DARK, 12.0), (None, 60.0)):
        lamps, ambient = change(ratio=1.0, added=5.0, patch=None, dark=dark, place=place)
        assert lamps is None
        assert ambient == pytest.approx(5.0)
    assert change(ratio=1.0, added=5.0, patch=None, place=None) == (None, None)

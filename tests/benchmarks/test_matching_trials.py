from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy.io
from benchmarks.matching.distort import PUBLIC_LEVELS, Trial
from benchmarks.matching.trials import (
    DATA,
    FAMILIES,
    LEVEL_LABELS,
    PUBLIC_FILE,
    SEQUENCE_FILE,
    generated_trials,
    hotel_trials,
    matching_error,
    public_trials,
)

from tsis.errors import FileInputError, InputError
from tsis.matching.methods import UNMATCHED

if TYPE_CHECKING:
    from pathlib import Path

    from benchmarks.matching.distort import Family

with_data = pytest.mark.skipif(not DATA.is_dir(), reason="the public trials are not on this machine")


@with_data
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("shape", ["fish", "chinese"])
def test_public_trials_are_those_of_the_file_in_another_order(shape: str, family: Family) -> None:
    level = len(PUBLIC_LEVELS[family])
    prefix = {"deformation": "def", "outliers": "outlier", "rotation": "rot"}.get(family, family)
    with np.load(DATA / PUBLIC_FILE) as stored:
        target = stored[f"{shape}_{prefix}_{level}_target"].astype(float)
    trials = list(public_trials(DATA, shape=shape, family=family, level=level, count=3))
    assert len(trials) == 3
    for number, trial in enumerate(trials):
        seen = trial.truth[trial.truth != UNMATCHED]
        assert len(seen) == min(len(trial.source), target.shape[1])
        np.testing.assert_array_equal(trial.target[seen], target[number][: len(seen)])
        assert not np.array_equal(seen, np.arange(len(seen)))
        hidden = PUBLIC_LEVELS[family][-1].occluded
        assert (trial.truth == UNMATCHED).sum() == int(hidden * len(trial.source))
        assert len(trial.target) - len(seen) == int(PUBLIC_LEVELS[family][-1].outlier_ratio * len(trial.source))


@with_data
def test_noise_is_judged_against_the_clean_target() -> None:
    trials = list(public_trials(DATA, shape="fish", family="noise", level=6))
    noise = [matching_error(trial, trial.target[trial.truth]) for trial in trials]
    # Two axes of 0.05 each, a little less where the trials were drawn.
    assert np.mean(noise) == pytest.approx(0.05 * np.sqrt(2), rel=0.03)


@with_data
def test_a_trial_does_not_depend_on_the_others_but_on_the_seed() -> None:
    few = list(public_trials(DATA, shape="fish", family="noise", level=2, count=2))
    many = list(public_trials(DATA, shape="fish", family="noise", level=2, count=5))
    np.testing.assert_array_equal(few[1].truth, many[1].truth)
    other = next(public_trials(DATA, shape="fish", family="noise", level=2, seed=1))
    assert not np.array_equal(few[0].truth, other.truth)


@with_data
def test_hotel_pairs() -> None:
    pairs = list(hotel_trials(DATA, separation=10))
    assert len(pairs) == 91
    assert {pair.source.shape for pair in pairs} == {(30, 2)}
    assert len(list(hotel_trials(DATA, separation=100))) == 1
    assert [pair.name for pair in hotel_trials(DATA, separation=10, count=3)] == [
        "hotel/hidden 0/10/0",
        "hotel/hidden 0/10/45",
        "hotel/hidden 0/10/90",
    ]
    hidden = next(hotel_trials(DATA, separation=20, hidden=0.3))
    assert hidden.target.shape == (21, 2)
    assert (hidden.truth == UNMATCHED).sum() == 9
    # The hotel turns a little from frame to frame: landmarks move by pixels, not by hundreds of them.
    near, far = (
        np.mean([matching_error(pair, pair.source) for pair in hotel_trials(DATA, separation=apart)])
        for apart in (10, 100)
    )
    assert 3 < near < 15 < 40 < far < 100
    with pytest.raises(InputError, match="separation"):
        list(hotel_trials(DATA, separation=101))


def test_generated_trials_do_not_depend_on_how_many_there_are() -> None:
    few = list(generated_trials(shape="curve", family="outliers", level=3, count=2, points=30))
    many = list(generated_trials(shape="curve", family="outliers", level=3, count=4, points=30))
    np.testing.assert_array_equal(few[1].target, many[1].target)
    assert few[1].target.shape == (60, 2)
    assert not np.allclose(many[0].source, many[1].source)


def test_the_error_leaves_out_points_without_a_partner() -> None:
    source = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    trial = Trial(
        source=source,
        target=np.array([[9.0, 9.0], [4.0, 3.0], [1.0, 1.0]]),
        target_clean=np.array([[9.0, 9.0], [4.0, 3.0], [1.0, 1.0]]),
        truth=np.array([2, UNMATCHED, 1]),
    )
    # The first point is sqrt(2) off, the third sqrt(16 + 4).
    assert matching_error(trial, source) == pytest.approx(np.sqrt((2 + 20) / 2))
    with pytest.raises(InputError, match="source's shape"):
        matching_error(trial, source[:2])
    with pytest.raises(InputError, match="finite"):
        matching_error(trial, np.full((3, 2), np.nan))


def test_labels_have_a_value_for_each_level() -> None:
    for family in FAMILIES:
        assert len(LEVEL_LABELS[family][1]) == len(PUBLIC_LEVELS[family])


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileInputError, match="does not exist"):
        next(public_trials(tmp_path, shape="fish", family="noise", level=1))


def test_no_byte_but_those_that_were_published_reaches_scipy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = (DATA / SEQUENCE_FILE).read_bytes() if DATA.is_dir() else bytes(30_000)

    def read(*_: object, **__: object) -> None:
        raise AssertionError("SciPy was asked to read a changed file")

    monkeypatch.setattr(scipy.io, "loadmat", read)
    rng, path = np.random.default_rng(3), tmp_path / SEQUENCE_FILE
    changed = [bytearray(content) for _ in range(100)]
    for each in changed:
        each[rng.integers(len(each))] ^= 1 << int(rng.integers(8))
    for other in (*changed, content[:-1], content + b"\0"):
        path.write_bytes(bytes(other))
        with pytest.raises(FileInputError, match=r"must be cmum.mat as its authors published it"):
            next(hotel_trials(tmp_path, separation=10))


def test_names_that_do_not_exist_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="known: chinese, fish"):
        next(public_trials(tmp_path, shape="bird", family="noise", level=1))
    with pytest.raises(InputError, match="did you mean 'curve'"):
        next(generated_trials(shape="curv", family="noise", level=1, count=1))

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.matching.distort import PUBLIC_LEVELS, Distortion, Trial, distort, public_distortion
from benchmarks.matching.trials import DATA, public_trials
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist

from tsis.errors import InputError
from tsis.matching.methods import UNMATCHED

if TYPE_CHECKING:
    from numpy.typing import NDArray


def shape_of(count: int, dimension: int, seed: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).uniform(0.2, 0.95, (count, dimension))


sizes = st.tuples(st.integers(5, 60), st.sampled_from([2, 3]), st.integers(0, 1000))


@given(sizes, st.floats(0, 180), st.integers(0, 1000))
@settings(max_examples=40)
def test_a_rotation_alone_keeps_distances_and_the_mean(size: tuple[int, int, int], angle_deg: float, seed: int) -> None:
    trial = distort(shape_of(*size), Distortion(rotation_deg=angle_deg), rng=np.random.default_rng(seed))
    moved = trial.target[trial.truth]
    np.testing.assert_allclose(pdist(moved), pdist(trial.source), atol=1e-12)
    np.testing.assert_allclose(moved.mean(axis=0), trial.source.mean(axis=0), atol=1e-12)
    if size[1] == 2:
        centred, turned = trial.source - trial.source.mean(axis=0), moved - moved.mean(axis=0)
        cosine = (centred * turned).sum() / (centred**2).sum()
        assert cosine == pytest.approx(np.cos(np.radians(angle_deg)), abs=1e-9)


@given(sizes, st.floats(0, 0.9), st.sampled_from(["patch", "scattered"]), st.floats(0, 3), st.integers(0, 1000))
@settings(max_examples=40)
def test_counts_and_truth_are_those_asked_for(
    size: tuple[int, int, int], occluded: float, kind: str, ratio: float, seed: int
) -> None:
    distortion = Distortion(bending=0.05, affine=0.2, occluded=occluded, occlusion=kind, outlier_ratio=ratio)  # type: ignore[arg-type]
    trial = distort(shape_of(*size), distortion, rng=np.random.default_rng(seed))
    matched = trial.truth != UNMATCHED
    assert (~matched).sum() == int(occluded * size[0] + 1e-9)
    assert len(trial.target) == matched.sum() + int(ratio * size[0] + 1e-9)
    assert len(set(trial.truth[matched].tolist())) == matched.sum()
    np.testing.assert_array_equal(trial.target, trial.target_clean)  # no noise was asked for


def test_noise_has_its_standard_deviation_and_leaves_outliers_and_the_clean_points_alone() -> None:
    shape = shape_of(4000, 2, 1)
    trial = distort(shape, Distortion(noise_sd=0.03, outlier_ratio=0.5), rng=np.random.default_rng(2))
    true = np.zeros(len(trial.target), dtype=bool)
    true[trial.truth] = True
    noise = (trial.target - trial.target_clean)[true]
    assert noise.std() == pytest.approx(0.03, rel=0.03)
    assert abs(noise.mean()) < 0.002
    np.testing.assert_array_equal(trial.target[~true], trial.target_clean[~true])
    np.testing.assert_allclose(trial.target_clean[trial.truth], shape, atol=1e-12)


def test_outliers_fill_a_unit_box_about_the_target_evenly() -> None:
    trial = distort(shape_of(2000, 3, 3), Distortion(outlier_ratio=2.0, affine=0.2), rng=np.random.default_rng(4))
    outlier = np.ones(len(trial.target), dtype=bool)
    outlier[trial.truth] = False
    place = trial.target[outlier] - trial.target[trial.truth].mean(axis=0)
    assert np.abs(place).max() <= 0.5
    counts, _ = np.histogramdd(place, bins=2, range=[(-0.5, 0.5)] * 3)
    np.testing.assert_allclose(counts, 500, atol=5 * np.sqrt(500))


def test_a_patch_is_nearer_to_one_of_its_points_than_all_that_is_left() -> None:
    trial = distort(shape_of(200, 2, 5), Distortion(occluded=0.3), rng=np.random.default_rng(6))
    gone = trial.source[trial.truth == UNMATCHED]
    left = trial.source[trial.truth != UNMATCHED]
    assert any(
        np.linalg.norm(gone - start, axis=1).max() <= np.linalg.norm(left - start, axis=1).min() for start in gone
    )


def test_the_same_seed_gives_the_same_trial_and_another_one_another() -> None:
    distortion = Distortion(bending=0.05, affine=0.2, noise_sd=0.01, outlier_ratio=0.5, rotation_deg=30, occluded=0.2)
    one, same, other = (distort(shape_of(50, 2, 7), distortion, rng=np.random.default_rng(seed)) for seed in (8, 8, 9))
    np.testing.assert_array_equal(one.target, same.target)
    np.testing.assert_array_equal(one.truth, same.truth)
    assert not np.array_equal(one.target, other.target)
    assert (one.truth[:-1] < one.truth[1:]).mean() < 0.7  # shuffled


@pytest.mark.parametrize("shape", ["fish", "chinese"])
def test_deformations_are_as_large_and_as_bent_as_the_public_ones(shape: str) -> None:
    if not DATA.is_dir():
        pytest.skip("the public trials are not on this machine")
    for level in range(1, 6):
        public = list(public_trials(DATA, shape=shape, family="deformation", level=level))
        rng = np.random.default_rng(level)
        ours = [distort(public[0].source, public_distortion("deformation", level), rng=rng) for _ in range(300)]
        for measure in (moved_by, bent_by):
            there = np.array([measure(trial) for trial in public])
            here = np.array([measure(trial) for trial in ours])
            # Seventy public trials scatter: their mean is known to about 6 %.
            spread = np.hypot(there.std() / np.sqrt(len(there)), here.std() / np.sqrt(len(here)))
            assert abs(there.mean() - here.mean()) < 3 * spread + 0.05 * there.mean(), (level, measure.__name__)


def moved_by(trial: Trial) -> float:
    return float(np.sqrt(((trial.target[trial.truth] - trial.source) ** 2).sum(axis=1).mean()))


def bent_by(trial: Trial) -> float:
    """What no affine map explains."""
    design = np.column_stack([np.ones(len(trial.source)), trial.source])
    moved = trial.target[trial.truth]
    left = moved - design @ np.linalg.lstsq(design, moved, rcond=None)[0]
    return float(np.sqrt((left**2).sum(axis=1).mean()))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"bending": -0.1}, r"bending must lie in \[0, 1\]"),
        ({"outlier_ratio": float("nan")}, "outlier_ratio"),
        ({"occluded": 0.95}, r"occluded must lie in \[0, 0.9\]"),
        ({"rotation_deg": 190}, "rotation_deg"),
        ({"occlusion": "pach"}, "did you mean 'patch'"),
    ],
)
def test_distortions_out_of_range_are_refused(arguments: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Distortion(**arguments)  # type: ignore[arg-type]


def test_shapes_and_levels_that_do_not_exist_are_refused() -> None:
    with pytest.raises(InputError, match="5 or more points"):
        distort(np.zeros((4, 2)), Distortion(), rng=np.random.default_rng(0))
    with pytest.raises(InputError, match=r"level must lie in \[1, 5\]"):
        public_distortion("outliers", 6)
    with pytest.raises(InputError, match="known: deformation"):
        public_distortion("shear", 1)  # type: ignore[arg-type]
    assert {len(levels) for levels in PUBLIC_LEVELS.values()} == {5, 6}


@pytest.mark.parametrize("truth", [[0, 0], [0, 2], [-1, -1], [0], [-2, 0]])
def test_a_truth_that_is_none_is_refused(truth: list[int]) -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0]])
    with pytest.raises(InputError, match="truth must give"):
        Trial(source=points, target=points, target_clean=points, truth=np.array(truth))

"""The corrected relaxation labelling: any rotation, what other methods lose, and the public trials."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.matching.distort import even_texture, strokes
from benchmarks.matching.trials import DATA, matching_error, public_trials
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.matching import posterior as tprl
from tsis.matching import register

if TYPE_CHECKING:
    from benchmarks.matching.distort import Family, Shape
    from tests.matching.conftest import Warped


def test_finds_a_smooth_deformation(warped: Warped) -> None:
    found = tprl.fit(warped.source, warped.target, rng=np.random.default_rng(0))
    assert warped.right(found.matches) == 1
    assert warped.rms(found.move(warped.source)) < 0.02


def test_partners_that_are_beyond_doubt_are_reached(warped: Warped) -> None:
    found = tprl.fit(warped.source, warped.target, rng=np.random.default_rng(0))
    assert warped.rms(found.move(warped.source)) < 1e-3


@pytest.mark.parametrize("shape", [even_texture, strokes])
@settings(max_examples=8, derandomize=True)
@given(degrees=st.floats(0, 360), seed=st.integers(0, 1000))
def test_any_rotation_is_found(shape: Shape, degrees: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    source = shape(60, rng=rng)
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    truth = (source + 0.015 * np.sin(5 * source[:, ::-1])) @ turn
    found = register(source, truth[rng.permutation(60)], rng=rng)
    assert np.sqrt(np.mean(np.sum((found.moved - truth) ** 2, axis=1))) < 0.02


@pytest.mark.parametrize("seed", range(4))
def test_outliers_and_missing_points_hardly_move_what_is_seen(seed: int) -> None:
    rng = np.random.default_rng(seed)
    source = strokes(80, rng=rng)
    truth = source + 0.03 * np.sin(6 * source[:, ::-1])
    seen = source[:, 0] < np.quantile(source[:, 0], 0.85)
    found = register(source, np.vstack([truth[seen], rng.uniform(0.2, 1.0, (17, 2))]), rng=rng)
    wrong = np.sqrt(np.sum((found.moved - truth) ** 2, axis=1))
    assert np.median(wrong[seen]) < 0.01
    assert np.sqrt(np.mean(wrong[seen] ** 2)) < 0.03


@pytest.mark.parametrize("noise", [0.02, 0.05])
def test_noise_is_hardly_amplified(warped: Warped, noise: float) -> None:
    rng = np.random.default_rng(3)
    noisy = warped.target + noise * rng.normal(size=warped.target.shape)
    found = tprl.fit(warped.source, noisy, rng=rng)
    assert warped.rms(found.move(warped.source)) < 1.2 * noise * np.sqrt(warped.source.shape[1])


@pytest.mark.skipif(not DATA.is_dir(), reason="the public trials are not on this machine")
@pytest.mark.parametrize(
    ("shape", "family", "level"),
    [
        ("fish", "deformation", 5),
        ("chinese", "rotation", 6),
        pytest.param("fish", "rotation", 6, marks=pytest.mark.slow),
        pytest.param("chinese", "deformation", 5, marks=pytest.mark.slow),
    ],
)
def test_public_trials_are_matched_far_better_than_by_coherent_point_drift(
    shape: str, family: Family, level: int
) -> None:
    means = {}
    for method in ("tprl", "cpd"):
        trials = public_trials(DATA, shape=shape, family=family, level=level, count=3)
        errors = [matching_error(trial, register(trial.source, trial.target, method=method).moved) for trial in trials]
        means[method] = float(np.mean(errors))
    assert means["tprl"] < 0.5 * means["cpd"]
    assert means["tprl"] < 0.02

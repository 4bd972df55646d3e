"""In space, an answer that is sheared, inside out or partly so is never reliable, whatever the method says of it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from benchmarks.matching.distort import tactile_surface
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tsis.matching import register, registration
from tsis.matching.methods import MatchFit, NormalFrame
from tsis.matching.posterior import (
    MOST_UNSOUND,
    RELIABLE,
    PosePosterior,
    is_sound,
    pose_posterior,
    probability_right,
    trust_measures,
)

WRONG = 0.245  # 0.1 of the unit box, in root-mean-square radii
MANY = settings(max_examples=15, derandomize=True, deadline=None)


@cache
def _judged(kind: str) -> tuple[np.ndarray, np.ndarray, PosePosterior]:
    """A bent surface or a filled cloud of points, where they went, and the posterior of the two sets."""
    rng = np.random.default_rng(3)
    source = tactile_surface(60, rng=rng) if kind == "surface" else rng.normal(size=(60, 3))
    source = NormalFrame.of(source).inward(source)
    truth = source + 0.05 * np.sin(2 * source[:, [1, 2, 0]])
    return source, truth, pose_posterior(source, truth, rng=rng)


def _believed(kind: str, matrix: np.ndarray) -> tuple[float, float]:
    """Confidence in the true map followed by a matrix, and the error of that answer, in radii."""
    source, truth, posterior = _judged(kind)

    def move(points: np.ndarray, /) -> np.ndarray:
        return np.asarray((points + 0.05 * np.sin(2 * points[:, [1, 2, 0]])) @ matrix)

    error = np.sqrt(((move(source) - truth) ** 2).sum(axis=1).mean())
    size = np.sqrt(((move(source) - move(source).mean(axis=0)) ** 2).sum(axis=1).mean())
    measures = trust_measures(posterior, move(source), sound=is_sound(move, source))
    return probability_right(measures), float(error / size)


@pytest.mark.parametrize("kind", ["surface", "cloud"])
def test_the_right_map_is_believed(kind: str) -> None:
    confidence, error = _believed(kind, np.eye(3))
    assert error < 1e-12
    assert confidence >= RELIABLE


@pytest.mark.parametrize("kind", ["surface", "cloud"])
@MANY
@given(seed=st.integers(0, 10_000), shear=st.floats(0.4, 3.0))
def test_a_sheared_answer_is_not(kind: str, seed: int, shear: float) -> None:
    turn = Rotation.random(random_state=seed).as_matrix()
    matrix = np.eye(3)
    matrix[0, 1] = shear
    confidence, error = _believed(kind, turn.T @ matrix @ turn)
    assert confidence < RELIABLE or error <= WRONG


@pytest.mark.parametrize("kind", ["surface", "cloud"])
@MANY
@given(seed=st.integers(0, 10_000), depth=st.floats(0.05, 1.0))
def test_an_answer_inside_out_is_not(kind: str, seed: int, depth: float) -> None:
    """Mirrored along any direction, as far as the original depth or pressed flatter."""
    normal = np.random.default_rng(seed).normal(size=3)
    normal /= np.linalg.norm(normal)
    confidence, _ = _believed(kind, np.eye(3) - (1 + depth) * np.outer(normal, normal))
    assert confidence <= MOST_UNSOUND


@pytest.mark.parametrize("matrix", [-np.eye(3), np.array([[1.0, 1.2, 0], [0, 1, 0], [0, 0, 1]])])
def test_a_method_that_answers_so_is_withheld(monkeypatch: pytest.MonkeyPatch, matrix: np.ndarray) -> None:
    """Its own map is among those that the posterior compares."""

    def crooked(source: np.ndarray, target: np.ndarray, /, *, rng: np.random.Generator) -> MatchFit:
        del target, rng
        return MatchFit(
            move=lambda points, /: points @ matrix, matches=np.arange(len(source)), trust=np.ones(len(source))
        )

    monkeypatch.setattr(registration, "METHODS", {"crooked": crooked})
    source, truth, _ = _judged("surface")
    assert not register(source, truth, method="crooked").reliable

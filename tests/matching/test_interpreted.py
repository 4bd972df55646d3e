"""Compiled loops of the matching methods against the interpreter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.interpreted import assert_interpreted_alike

from tsis.matching.annealing import annealed_map, field_design, soft_pairs
from tsis.matching.drift import expect
from tsis.matching.methods import UNMATCHED, assign, pairs_within
from tsis.matching.neighbourhoods import candidates, neighbours, support
from tsis.matching.pose_evidence import PoseEvidence, SmoothField, _tridiagonal, hard_evidence, soft_evidence
from tsis.matching.pose_search import _is_far
from tsis.matching.refinement import _along_curves, chained, predicted
from tsis.matching.relaxation import Labels, Neighbourhood, label
from tsis.matching.shape_context import chi_squared, histograms
from tsis.matching.spline import spread_indices

if TYPE_CHECKING:
    from collections.abc import Callable

COUNT, STRAYS = 22, 4  # points of the source, of which the target lacks two, and further points of the target


@dataclass(frozen=True)
class Case:
    """An outline of the plane or a coil in space, its bent image with other points, and what the loops start from."""

    source: np.ndarray
    target: np.ndarray
    matches: np.ndarray
    field: SmoothField

    @property
    def pose(self) -> PoseEvidence:
        found = hard_evidence(self.field, self.target, self.matches)
        assert found is not None
        return found


@pytest.fixture(scope="module", params=[2, 3], ids=["plane", "space"])
def case(request: pytest.FixtureRequest) -> Case:
    rng = np.random.default_rng(5)
    angle = 2 * np.pi * np.arange(COUNT) / COUNT
    axes = [np.cos(angle), 0.8 * np.sin(angle), 0.5 * np.cos(2 * angle)]
    source = np.column_stack(axes[: request.param])
    source /= np.sqrt((source**2).sum(axis=1).mean())
    target = np.vstack([(source + 0.1 * np.sin(2 * source[:, ::-1]))[2:], rng.normal(size=(STRAYS, request.param))])
    matches = np.arange(COUNT) - 2
    matches[:2] = UNMATCHED
    return Case(source, target, matches, SmoothField.of(source))


def _supported(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    pairs = candidates(chi_squared(histograms(source), histograms(target)))
    return np.asarray(support(pairs, neighbours(source), neighbours(target)).toarray())


def _labels(source: np.ndarray, target: np.ndarray) -> Labels:
    cost = chi_squared(histograms(source), histograms(target))
    return label(Neighbourhood.of(source, 6), Neighbourhood.of(target, 8), cost, single=0.07, updates=40)


def _soft(case: Case) -> np.ndarray:
    """Soft pairs: some sharp, some shared by two targets, and some too weak to be pairs."""
    pairs = np.zeros((COUNT, len(case.target)))
    pairs[np.arange(COUNT), case.matches] = 1.0
    pairs[5:9] = 0.7 * pairs[5:9] + 0.2 * np.roll(pairs[5:9], 1, axis=1)
    pairs[:2] *= 0.3
    return pairs


CALLS: dict[str, tuple[Callable[..., Any], Callable[[Case], tuple[Any, ...]]]] = {
    "pairs within": (pairs_within, lambda case: (case.source, case.target, np.linspace(0.2, 5.0, COUNT))),
    "assignment": (assign, lambda case: (((case.source[:, None] - case.target) ** 2).sum(axis=2),)),
    "soft pairs": (soft_pairs, lambda case: (case.source, case.target, 0.4, np.ones(len(case.target)))),
    "hard evidence": (hard_evidence, lambda case: (case.field, case.target, case.matches)),
    "soft evidence": (soft_evidence, lambda case: (case.field, case.target, _soft(case))),
    "prediction": (predicted, lambda case: (case.field, case.pose)),
    "curves": (
        chained,
        lambda case: (case.field, case.target, 0.3, [(np.arange(12), False), (np.arange(12, COUNT), False)], case.pose),
    ),
    "expectation": (expect, lambda case: (case.source, case.target, 0.05, 0.1)),
    "shape contexts": (histograms, lambda case: (np.vstack([case.source, 9 * case.source[:1]]),)),
    "chi squared": (chi_squared, lambda case: (histograms(case.source), histograms(case.target))),
    "support": (_supported, lambda case: (case.source, case.target)),
    "spread": (spread_indices, lambda case: (np.vstack([case.source[:8], case.source[:2]]), 9)),
}


@pytest.mark.parametrize("name", CALLS)
def test_loops_equal_those_of_the_interpreter(name: str, case: Case) -> None:
    function, arguments = CALLS[name]
    named = {"dummy": 0.5} if function is assign else {}
    assert_interpreted_alike(function, *arguments(case), rtol=1e-7, **named)


def test_relaxation_equals_that_of_the_interpreter(case: Case) -> None:
    """To the rounding of the supports, which are of single precision."""
    assert_interpreted_alike(_labels, case.source, case.target, rtol=1e-5)


def test_annealing_equals_that_of_the_interpreter(case: Case) -> None:
    design, ridge = field_design(case.source, np.arange(0, COUNT, 3))
    start = np.zeros((design.shape[1], case.source.shape[1]))
    start[1 : 1 + len(start[0])] = np.eye(len(start[0]))
    sigmas = np.array([0.5, 0.2, 0.1])
    assert_interpreted_alike(annealed_map, design, ridge, case.target, start, sigmas, 2, rtol=1e-7)


def test_a_matrix_with_an_empty_row_equals_that_of_the_interpreter() -> None:
    matrix = np.diag(np.arange(1.0, 6.0))
    matrix[1:, 1:] += 0.3
    assert_interpreted_alike(_tridiagonal, matrix, np.ones((5, 2)))


@pytest.mark.parametrize("least", [0.5, 8.0])
def test_distance_equals_that_of_the_interpreter(least: float) -> None:
    assert_interpreted_alike(_is_far, np.ones(4), np.array([[3.0, 1.0, 1.0, 1.0], [1.0, 2.0, 2.0, 1.0]]), least)


@pytest.mark.parametrize("noise", [0.05, 0.1, 0.15])
def test_curves_that_compete_equal_those_of_the_interpreter(case: Case, noise: float) -> None:
    """Two curves lie near the same targets: several points want one."""
    rng = np.random.default_rng(8)
    near = np.vstack([case.target[:10], case.target[:10]])
    moved = near + rng.normal(0.0, noise, near.shape)
    order, ends, ascending = np.arange(20), np.array([10, 20]), np.argsort(case.target[:, 0])
    matches = assert_interpreted_alike(
        _along_curves, moved, case.target, order, ends, case.target[ascending], ascending, 0.9, 0.3, 0.2
    )
    assert (matches >= 0).any()
    assert (matches[:10] < 0).any()
    assert (matches[10:] < 0).any()

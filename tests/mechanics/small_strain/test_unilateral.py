"""Unilateral contact: the conditions that define it, a second algorithm, and all subsets tried by hand."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import nnls

from tsis.errors import InputError, MechanicsError
from tsis.mechanics.small_strain import unilateral as contact
from tsis.mechanics.small_strain.unilateral import unilateral_contact

if TYPE_CHECKING:
    from numpy.typing import NDArray

Problem = tuple["NDArray[np.float64]", "NDArray[np.float64]"]


@st.composite
def problems(draw: st.DrawFn, largest: int) -> Problem:
    """A random positive definite compliance and random gaps."""
    size = draw(st.integers(1, largest))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    root = rng.standard_normal((size, size))
    return root @ root.T + 0.05 * np.eye(size), rng.standard_normal(size)


def every_subset(compliance: NDArray[np.float64], gap: NDArray[np.float64], approach: float) -> NDArray[np.float64]:
    """The only solution, found by trying each set of closed nodes."""
    size = len(gap)
    for closed in itertools.product([False, True], repeat=size):
        mask = np.array(closed)
        force = np.zeros(size)
        force[mask] = np.linalg.solve(compliance[np.ix_(mask, mask)], (approach - gap)[mask])
        left = compliance @ force + gap - approach
        if (force >= -1e-9).all() and (left >= -1e-9).all():
            return force
    raise AssertionError("a positive definite problem has a solution")


@given(problem=problems(5), approach=st.floats(-2.0, 2.0))
def test_equals_trying_every_subset(problem: Problem, approach: float) -> None:
    compliance, gap = problem
    force, _ = unilateral_contact(compliance, gap, approach)
    expected = every_subset(compliance, gap, approach)
    np.testing.assert_allclose(force, expected, atol=1e-7 * max(1.0, np.abs(expected).max()))


@given(problem=problems(40), approach=st.floats(-2.0, 2.0))
def test_equals_least_squares_without_negative_values(problem: Problem, approach: float) -> None:
    compliance, gap = problem
    force, _ = unilateral_contact(compliance, gap, approach)
    root = cholesky(compliance)  # min |root f - root^-T (approach - gap)| over f >= 0 has the same conditions
    expected, _ = nnls(root, solve_triangular(root, approach - gap, trans="T"))
    np.testing.assert_allclose(force, expected, atol=1e-6 * max(1.0, np.abs(expected).max()))


@given(problem=problems(60), approach=st.floats(-2.0, 2.0))
def test_pushes_only_where_the_gap_is_closed(problem: Problem, approach: float) -> None:
    compliance, gap = problem
    force, found = unilateral_contact(compliance, gap, approach)
    assert (force >= 0).all()
    assert (found.gap_mm >= -1e-9).all()
    assert (force[~found.closed] == 0).all()
    assert (found.gap_mm[found.closed] == 0).all()
    np.testing.assert_allclose(compliance @ force + gap - approach, found.gap_mm, atol=1e-8)


def test_no_touch_no_force() -> None:
    force, found = unilateral_contact(np.eye(3), [1.0, 2.0, 3.0], 0.5)
    assert force.tolist() == [0.0, 0.0, 0.0]
    assert not found.closed.any()
    assert found.gap_mm.tolist() == [0.5, 1.5, 2.5]
    assert found.iterations == 1


@pytest.mark.parametrize("seed", range(20))
def test_single_exchanges_alone_find_the_same_contact(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The way out when exchanging all wrong nodes goes round in circles, taken from the start."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((12, 12))
    compliance, gap = root @ root.T + 0.05 * np.eye(12), rng.standard_normal(12)
    together, _ = unilateral_contact(compliance, gap, 0.3)
    monkeypatch.setattr(contact, "MOST_STALLED_EXCHANGES", -1)
    alone, found = unilateral_contact(compliance, gap, 0.3)
    np.testing.assert_allclose(alone, together, atol=1e-9)
    assert found.iterations >= 1 + np.count_nonzero(found.closed != (gap < 0.3))


@pytest.mark.parametrize(
    ("compliance", "gap", "approach", "phrase"),
    [
        (np.eye(2), [0.0, 0.0, 0.0], 1.0, r"compliance must have shape \(3, 3\), as gap_mm has; got \(2, 2\)"),
        (np.ones(3), [0.0], 1.0, "compliance must have 2 axes"),
        (np.eye(2), [0.0, np.nan], 1.0, "gap_mm must be finite"),
        (np.eye(2), [0.0, 0.0], np.inf, "approach_mm must lie in"),
    ],
)
def test_bad_input(compliance: Any, gap: Any, approach: float, phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        unilateral_contact(compliance, gap, approach)


def test_an_impossible_compliance_is_refused() -> None:
    with pytest.raises(MechanicsError, match="must be symmetric positive definite"):
        unilateral_contact(-np.eye(2), [0.0, 0.0], 1.0)

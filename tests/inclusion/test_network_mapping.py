"""Lines against SciPy's regression, and that an inclusion has no part in its own line."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import linregress

from tsis.errors import InputError
from tsis.inclusion.network import fit_mapping, leave_one_out_mapping


@pytest.fixture
def tables() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    measured = rng.normal(100.0, 30.0, (9, 3))
    return measured, measured * [0.1, -2.0, 5.0] + rng.normal(0.0, 4.0, (9, 3))


def test_each_column_has_the_line_that_scipy_fits(tables: tuple[np.ndarray, np.ndarray]) -> None:
    mapping = fit_mapping(*tables)
    for column in range(3):
        peer = linregress(tables[0][:, column], tables[1][:, column])
        assert mapping.slope[column] == pytest.approx(peer.slope)
        assert mapping.intercept[column] == pytest.approx(peer.intercept)
        assert mapping.r_squared[column] == pytest.approx(peer.rvalue**2)


def test_an_inclusions_own_simulation_does_not_move_its_mapped_outputs(
    tables: tuple[np.ndarray, np.ndarray],
) -> None:
    measured, simulated = tables
    before = leave_one_out_mapping(measured, simulated)
    assert_allclose(before[2], fit_mapping(np.delete(measured, 2, 0), np.delete(simulated, 2, 0))(measured[[2]])[0])
    changed = simulated.copy()
    changed[2] += 1000.0
    after = leave_one_out_mapping(measured, changed)
    assert_allclose(after[2], before[2])
    assert (np.abs(np.delete(after - before, 2, axis=0)) > 1e-3).all()


def test_points_on_a_line_come_back(tables: tuple[np.ndarray, np.ndarray]) -> None:
    line = 3.0 - 2.0 * tables[0]
    assert_allclose(leave_one_out_mapping(tables[0], line), line)
    assert_allclose(fit_mapping(tables[0], line).r_squared, 1.0)


def test_tables_that_fit_no_line_are_refused() -> None:
    with pytest.raises(InputError, match="one shape"):
        fit_mapping([[1.0], [2.0]], [[1.0]])
    with pytest.raises(InputError, match="must vary"):
        fit_mapping([[1.0], [1.0]], [[1.0], [2.0]])
    with pytest.raises(InputError, match="three rows"):
        leave_one_out_mapping([[1.0], [2.0]], [[1.0], [2.0]])

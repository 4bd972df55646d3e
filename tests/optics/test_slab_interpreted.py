"""Compiled phases and roots of slab modes against the interpreter."""

from __future__ import annotations

import numpy as np
import pytest
from tests.interpreted import assert_interpreted_alike

from tsis.optics.slab import EPSILON, mode_roots, modes_above, propagate_layer

STEP = np.array([-1.0, -0.3, 0.0, -0.2, -0.01, -1.0])  # squared indices below that of the core, in layer 2
LENGTH = np.array([0.0, 4.0, 25.0, 8.0, 30.0, 0.0])


@pytest.mark.parametrize("weight", [np.ones(6), 1 / (2.0 + STEP)], ids=["te", "tm"])
def test_roots_equal_those_of_the_interpreter(weight: np.ndarray) -> None:
    low, high = -0.9, -EPSILON
    count = assert_interpreted_alike(modes_above, STEP, weight, LENGTH, low, 2)
    assert count > 10
    assert_interpreted_alike(mode_roots, STEP, weight, LENGTH, low, high, 2, 0, np.empty(count), rtol=1e-12)


@pytest.mark.parametrize("q", [2.0, -0.01, 0.0, -4.0])
@pytest.mark.parametrize("v", [0.3, -2.0])
def test_a_layer_equals_that_of_the_interpreter(q: float, v: float) -> None:
    assert_interpreted_alike(propagate_layer, 1.0, v, 1.0, q, 5.0, rtol=1e-13)

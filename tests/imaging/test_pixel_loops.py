"""Compiled loops over pixels against the interpreter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.interpreted import assert_interpreted_alike

from tsis.imaging._pixel_loops import develop, paint, ring_sums
from tsis.inclusion.checks._sectors import _gather

if TYPE_CHECKING:
    from collections.abc import Callable

RNG = np.random.default_rng(1)
X, Y = np.linspace(-3.0, 3.0, 9), np.linspace(-2.5, 2.5, 7)  # both cross 0; the corners lie beyond the profile
RADIUS = np.linspace(0.0, 3.5, 12)
PROFILES = (RADIUS, np.exp(-RADIUS), 0.5 * np.exp(-RADIUS / 2), -0.3 * RADIUS)
NODES = np.array([-2.0, -1.3, 0.1, 0.8, 2.2])  # pixels lie beyond them
LIGHT, FLUX_X, FLUX_Y, GROWTH, BEND = RNG.uniform(0.5, 1.5, (5, 5, 5))
GREY = RNG.uniform(0.0, 100.0, 60)


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        (paint, (X, Y, *PROFILES, NODES, NODES, LIGHT, FLUX_X, FLUX_Y, GROWTH, BEND)),
        (paint, (X, Y, *PROFILES, NODES, NODES, LIGHT, FLUX_X, FLUX_Y, 0 * GROWTH, 0 * BEND)),
        (develop, (RNG.normal(size=(6, 8)), RNG.uniform(-1.0, 99.0, (6, 8)), 2.0, 1.5, 0.1, 90.0)),
        (ring_sums, (GREY, GREY > 80, np.arange(60) % 7, 5, 40.0)),
        (_gather, (GREY, np.sort(RNG.integers(0, 30, 60)).astype(np.uint8), 80.0)),
    ],
    ids=["paint growing", "paint", "develop", "ring sums", "sectors"],
)
def test_loops_equal_those_of_the_interpreter(function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    assert_interpreted_alike(function, *arguments, rtol=1e-12)

"""Compiled loops over pixels against the interpreter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.interpreted import assert_interpreted_alike

from tsis.imaging.pixels import develop, paint, ring_sums
from tsis.inclusion.checks.sectors import _gather

if TYPE_CHECKING:
    from collections.abc import Callable

RNG = np.random.default_rng(1)


def _fixed(*arrays: np.ndarray) -> list[np.ndarray]:
    """Read-only arrays, as those that callers keep: no second code is compiled."""
    for array in arrays:
        array.flags.writeable = False
    return list(arrays)


X, Y = np.linspace(-3.0, 3.0, 9), np.linspace(-2.5, 2.5, 7)  # both cross 0; the corners lie beyond the profile
RADIUS, DISPLACEMENT = _fixed(np.linspace(0.0, 3.5, 12), np.linspace(0.5, 0.1, 12))
PROFILES = (RADIUS, np.exp(-RADIUS), DISPLACEMENT, -0.3 * RADIUS)
(NODES,) = _fixed(np.array([-2.0, -1.3, 0.1, 0.8, 2.2]))  # pixels lie beyond them
LIGHT = _fixed(*RNG.uniform(0.5, 1.5, (3, 5, 5)))  # its level and its flux along x and y
GROWTH, FLAT = _fixed(*RNG.uniform(0.5, 1.5, (2, 5, 5))), _fixed(*np.zeros((2, 5, 5)))
(GREY,) = _fixed(RNG.uniform(0.0, 100.0, 60))
SECTOR = np.sort(RNG.integers(0, 30, 60)).astype(np.uint8)
(RINGS,) = _fixed(np.arange(60) % 7)


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        (paint, (X, Y, *PROFILES, NODES, NODES, *LIGHT, *GROWTH)),
        (paint, (X, Y, *PROFILES, NODES, NODES, *LIGHT, *FLAT)),
        (develop, (RNG.normal(size=(6, 8)), RNG.uniform(-1.0, 99.0, (6, 8)), 2.0, 1.5, 0.1, 90.0)),
        (ring_sums, (GREY, GREY > 80, RINGS, 5, 40.0)),
        (_gather, (GREY, SECTOR, 80.0)),
    ],
    ids=["paint growing", "paint", "develop", "ring sums", "sectors"],
)
def test_loops_equal_those_of_the_interpreter(function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    assert_interpreted_alike(function, *arguments, rtol=1e-12)

"""Blur and block means against SciPy and scikit-image, compiled loops against the interpreter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from skimage.transform import resize_local_mean
from tests.interpreted import assert_interpreted_alike

from tsis.imaging.pixels import block_means, develop, gaussian_blur, paint, ring_sums
from tsis.inclusion.checks.sectors import _gather

if TYPE_CHECKING:
    from collections.abc import Callable


@pytest.mark.parametrize("mode", ["reflect", "nearest", "mirror"])
@pytest.mark.parametrize("sigma", [(1.0, 1.0), (0.7, 2.5), (6.0, 0.3)])
@pytest.mark.parametrize("shape", [(40, 61), (3, 50), (1, 1)])
def test_it_equals_the_filter(shape: tuple[int, int], sigma: tuple[float, float], mode: Any) -> None:
    grey = np.random.default_rng(5).uniform(0.0, 255.0, shape)
    np.testing.assert_allclose(
        gaussian_blur(grey, sigma, mode=mode), gaussian_filter(grey, sigma, mode=mode), rtol=1e-12
    )


@given(st.data())
def test_block_means_are_those_of_scikit_image(data: st.DataObject) -> None:
    size = data.draw(st.tuples(st.integers(2, 60), st.integers(2, 60)), label="rows, columns")
    shape = data.draw(st.tuples(*(st.integers(1, side) for side in size)), label="blocks")
    levels = np.random.default_rng(data.draw(st.integers(0, 99))).integers(0, 256, size).astype(np.uint8)
    expected = resize_local_mean(levels.astype(float), shape)  # type: ignore[no-untyped-call]
    np.testing.assert_allclose(block_means(levels, shape), expected, rtol=1e-12)


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

"""Blur and block means by matrices, against SciPy's filter and scikit-image."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from skimage.transform import resize_local_mean

from tsis.imaging.pixels import block_means, gaussian_blur


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

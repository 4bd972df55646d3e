"""The blur by matrices against SciPy's filter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from tsis.imaging._filters import gaussian_blur


@pytest.mark.parametrize("mode", ["reflect", "nearest", "mirror"])
@pytest.mark.parametrize("sigma", [(1.0, 1.0), (0.7, 2.5), (6.0, 0.3)])
@pytest.mark.parametrize("shape", [(40, 61), (3, 50), (1, 1)])
def test_it_equals_the_filter(shape: tuple[int, int], sigma: tuple[float, float], mode: Any) -> None:
    grey = np.random.default_rng(5).uniform(0.0, 255.0, shape)
    np.testing.assert_allclose(
        gaussian_blur(grey, sigma, mode=mode), gaussian_filter(grey, sigma, mode=mode), rtol=1e-12
    )

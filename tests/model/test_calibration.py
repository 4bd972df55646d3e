from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from tsis.errors import InputError
from tsis.model.calibration import LightMap


def some(seed: int = 1, **changes: Any) -> LightMap:
    rng = np.random.default_rng(seed)
    values: dict[str, Any] = {
        name: rng.uniform(0.5, 1.5, (2, 3)) for name in ("relative", "flux_x", "flux_y", "growth_per_mm")
    }
    grid = {"x_mm": [-3.0, 0.5, 2.0], "y_mm": [-1.0, 4.0]}
    return LightMap(**{**grid, **values, "error": 0.01, **changes})


def test_between_the_points_it_is_scipys_linear_interpolation() -> None:
    light, rng = some(), np.random.default_rng(2)
    x, y = np.sort(rng.uniform(-3.0, 2.0, 7)), np.sort(rng.uniform(-1.0, 4.0, 5))
    peer = RegularGridInterpolator((light.y_mm, light.x_mm), light.relative)
    expected = peer(np.stack(np.meshgrid(y, x, indexing="ij"), axis=-1))
    np.testing.assert_allclose(light.at(x, y), expected, rtol=1e-13)


def test_outside_its_grid_it_is_the_nearest_value() -> None:
    light = some()
    assert light.at([-9.0, 9.0], [9.0]).tolist() == [[light.relative[1, 0], light.relative[1, 2]]]


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"relative": [[1.0, 1.0, 1.0]]}, r"shape \(2, 3\)"),
        ({"flux_x": np.zeros((3, 2))}, r"shape \(2, 3\)"),
        ({"relative": np.zeros((2, 3))}, "relative must hold some light"),
        ({"relative": -np.ones((2, 3))}, r"relative must lie in \[0, inf\]"),
        ({"x_mm": [0.0, 0.0, 1.0]}, "x_mm must hold at least two ascending"),
        ({"growth_per_mm": np.full((2, 3), -101.0)}, "growth_per_mm must lie in"),
        ({"growth_per_mm": np.full((2, 3), np.nan)}, "growth_per_mm must be finite"),
    ],
)
def test_a_map_that_is_none_is_refused(values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        some(**values)

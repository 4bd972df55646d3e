from __future__ import annotations

import numpy as np
import pytest

from tsis.errors import InputError
from tsis.imaging.surface import height_surface
from tsis.model.image import TactileImage


def test_a_tilted_plane_stays_that_plane_at_every_thinning() -> None:
    y, x = np.mgrid[:120, :200]
    image = TactileImage(grey=0.5 * x + 0.2 * y, mm_per_pixel=(0.1, 0.3))
    for limit in (400, 100, 50, 7):
        lifted = height_surface(image, max_points=limit)
        assert max(lifted.height.shape) <= limit
        assert lifted.height.shape == (lifted.y_mm.size, lifted.x_mm.size)
        columns, rows = lifted.x_mm / 0.1 + 99.5, lifted.y_mm / 0.3 + 59.5
        np.testing.assert_allclose(lifted.height, 0.5 * columns + 0.2 * rows[:, None], atol=0.005)


def test_the_mean_height_is_kept_and_scaled() -> None:
    grey = np.random.default_rng(53).uniform(0.0, 200.0, (96, 128))
    lifted = height_surface(TactileImage(grey=grey, mm_per_pixel=(0.1, 0.1)), max_points=32, height_per_grey=0.01)
    assert lifted.height.mean() == pytest.approx(0.01 * grey.mean(), rel=1e-12)


def test_bad_input_is_named() -> None:
    with pytest.raises(InputError, match="mm_per_pixel is not known"):
        height_surface(TactileImage(grey=np.ones((4, 4))))
    with pytest.raises(InputError, match="max_points must lie in"):
        height_surface(TactileImage(grey=np.ones((4, 4)), mm_per_pixel=(1.0, 1.0)), max_points=1)

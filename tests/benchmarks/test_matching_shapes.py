from __future__ import annotations

import numpy as np
import pytest
from benchmarks.matching.distort import LONGEST_SIDE, SHAPES, even_texture, fourier_curve, scattered_texture
from scipy.spatial.distance import pdist

from tsis.errors import InputError


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("count", [10, 97])
def test_shapes_fill_the_unit_box_with_as_many_different_points_as_asked_for(name: str, count: int) -> None:
    for seed in range(20):
        points = SHAPES[name](count, rng=np.random.default_rng(seed))
        assert points.shape == (count, 3 if name == "surface" else 2)
        assert np.ptp(points, axis=0).max() == pytest.approx(LONGEST_SIDE)
        assert points.min() > 0.2
        assert points.max() < 1.0
        assert len(np.unique(points, axis=0)) == count
        assert np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-3) == points.shape[1]


@pytest.mark.parametrize("name", SHAPES)
def test_a_seed_makes_a_shape(name: str) -> None:
    make = SHAPES[name]
    one, same, other = (make(40, rng=np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert not np.allclose(one, other)


def test_a_curve_is_closed_and_even() -> None:
    points = fourier_curve(400, rng=np.random.default_rng(3))
    steps = np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1)
    assert steps.max() / np.median(steps) < 1.05


def test_an_even_texture_keeps_its_points_apart() -> None:
    apart = [
        pdist(points).min()
        for points in (make(300, rng=np.random.default_rng(4)) for make in (even_texture, scattered_texture))
    ]
    assert apart[0] > 5 * apart[1]


def test_too_few_points_are_refused() -> None:
    with pytest.raises(InputError, match=r"count must lie in \[10, 100000\]"):
        fourier_curve(9, rng=np.random.default_rng(0))

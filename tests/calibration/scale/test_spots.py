"""Noise of the answer that spots must exceed, against noise that is drawn; spots in noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from tsis.calibration.dot_board import BORDER, STEP, _noise_gain, _peaks, _sub_pixel, find_spots


@pytest.mark.parametrize("blur", [1.7, 2.6, 4.0])
def test_the_noise_of_two_blurs_is_that_of_drawn_noise(blur: float) -> None:
    noise = np.random.default_rng(5).standard_normal((600, 600))
    difference = gaussian_filter(noise, blur) - gaussian_filter(noise, STEP * blur)
    assert _noise_gain(blur) == pytest.approx(difference.std(), rel=0.03)


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["bright", "dark"])
def test_all_spots_and_no_noise_are_found(sign: float) -> None:
    y, x = np.mgrid[:160, :200]
    places = np.array([(30.3 + 35 * i, 40.6 + 40 * j) for i in range(5) for j in range(3)])
    spots = sum(np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * 4.0**2)) for a, b in places)
    grey = 100 + sign * 20 * spots + 2.0 * np.random.default_rng(6).standard_normal(x.shape)
    found = find_spots(grey, least=4)
    assert found.bright == (sign > 0)
    assert found.width_px == pytest.approx(4.0, rel=0.1)
    assert len(found.positions_px) == len(places)
    apart = np.linalg.norm(found.positions_px[:, None] - places[None], axis=2)
    assert apart.min(axis=1).max() < 0.6
    assert len(set(apart.argmin(axis=1).tolist())) == len(places)


@pytest.mark.parametrize("sigma", [2.0, 4.0, 7.0])
def test_spots_that_are_symmetric_about_a_pixel_lie_on_it(sigma: float) -> None:
    y, x = np.mgrid[:140, :160]
    grey = 50 * np.exp(-((x - 80) ** 2 + (y - 70) ** 2) / (2 * sigma**2))
    found = find_spots(grey, least=1)
    np.testing.assert_allclose(found.positions_px, [[80.0, 70.0]], atol=1e-6)


def test_a_top_further_than_a_pixel_away_is_left_where_it_was_seen() -> None:
    y, x = np.mgrid[:21, :21]
    for top, expected in ((10.6, 10.6), (12.3, 10.0)):
        paraboloid = -((x - top) ** 2) - 0.5 * (y - 10.0) ** 2
        found = _sub_pixel(paraboloid, np.array([10]), np.array([10]), 2)
        np.testing.assert_allclose(found, [[expected, 10.0]], atol=1e-9)


@pytest.mark.parametrize("blur", [1.5, 2.0])
def test_maxima_at_the_border_are_left_out(blur: float) -> None:
    """Where a spot has less than its border and a pixel on any side, its blur lacks a part."""
    first = int(np.ceil(BORDER * blur)) + 1
    size = 6 * first
    for at, count in ((first - 1, 0), (first, 1), (size - 1 - first, 1), (size - first, 0)):
        response = np.zeros((size, size))
        response[3 * first, at] = 1.0
        assert len(_peaks(response, blur, 0.5)[0]) == count
        assert len(_peaks(response.T, blur, 0.5)[0]) == count

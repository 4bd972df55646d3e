"""Means of the calibration's light over rings, against light whose means are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tsis
from tsis.inclusion.frames import depletion_per_n, ring_light
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage

EDGES = np.array([0.0, 2.0, 4.0, 6.0, 40.0, 44.0])
FRAME = TactileImage(
    grey=np.zeros((241, 321)), mm_per_pixel=(0.1, 0.1), force_n=1.0
)  # 32 by 24 mm: no pixel beyond 20 mm


def known(light: LightMap | None) -> Calibration:
    return Calibration(gain_grey_per_kpa=30.0, saturation_kpa=60.0, background_grey=8.0, light=light)


def test_means_are_those_of_the_map_and_a_ring_without_pixels_is_undented() -> None:
    side = np.linspace(-10.0, 10.0, 5)
    x, y = np.meshgrid(side, side)
    light = LightMap(
        x_mm=side,
        y_mm=side,
        relative=1 + 0.03 * x - 0.02 * y,
        flux_x=0.01 * x,
        flux_y=0.01 * y,
        growth_per_mm=np.full_like(x, 0.2),
        bend_per_mm2=np.full_like(x, -0.05),
        error=0.0,
    )
    found = ring_light(FRAME, known(light), EDGES)
    np.testing.assert_allclose(found.level[:3], 1.0, atol=2e-3)  # what is linear cancels around the axis
    np.testing.assert_allclose(found.shading.growth_per_mm[:4], 0.2, rtol=1e-6)
    np.testing.assert_allclose(found.shading.bend_per_mm2[:4], -0.05, rtol=1e-6)
    inner, outer = EDGES[:3], EDGES[1:4]
    middle = 2 * (outer**3 - inner**3) / (3 * (outer**2 - inner**2))
    np.testing.assert_allclose(found.shading.flux[:3], 0.01 * middle, rtol=0.01)
    assert found.level[4] == 1.0
    assert [found.shading.growth_per_mm[4], found.shading.bend_per_mm2[4], found.shading.flux[4]] == [0.0, 0.0, 0.0]


def test_a_uniform_map_is_even_light_that_is_known() -> None:
    found = ring_light(FRAME, known(LightMap.uniform()), EDGES)
    np.testing.assert_allclose(found.level, np.ones(5))
    for part in (found.shading.growth_per_mm, found.shading.bend_per_mm2, found.shading.flux):
        np.testing.assert_array_equal(part, np.zeros(5))
    assert found.shading.uncertainty.count == 0


def test_no_map_is_even_light_whose_change_by_a_dent_is_hardly_known() -> None:
    edges = np.linspace(0.0, 9.6, 21)
    found = ring_light(FRAME, known(None), edges)
    np.testing.assert_array_equal(found.level, np.ones(20))
    np.testing.assert_allclose(found.shading.growth_per_mm, 0.25)
    assert found.shading.flux[-1] == 0.8 * 0.5  # at 9.6 of 12 mm
    np.testing.assert_allclose(found.shading.flux / found.shading.flux[-1], (np.arange(20) + 0.5) / 19.5)
    sd = np.sqrt((found.shading.uncertainty.by_displacement**2).sum(axis=1))
    assert (sd > 0.25).all()
    assert (sd < 1.0).all(), "traced lamps grow by -0.4 to 0.4 per mm along the radius"


def test_contact_takes_light_by_the_share_of_the_face_that_touches() -> None:
    """An even pressure on the face lets its fraction of the saturation pressure touch, and divides the light by it."""
    probe, force_n = tsis.load_probe("tsis-2011"), 0.8
    even_kpa = 1e3 * force_n / (np.pi * probe.radius_mm**2)  # a newton on a square millimetre is 1000 kPa
    light = replace(LightMap.uniform(), depletion=0.4)
    assert depletion_per_n(known(light), probe) * force_n == pytest.approx(0.4 * even_kpa / 60.0)
    assert depletion_per_n(known(None), probe) == 0.0

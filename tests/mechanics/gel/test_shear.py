"""Shear force from markers: against finite elements of the benchmark, rendered dots, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.gel_shear import brick
from scipy.ndimage import gaussian_filter, map_coordinates

from tsis.catalog.sensors import load_sensor
from tsis.errors import InputError
from tsis.imaging.gel_contact import marker_shift
from tsis.mechanics.gel.contact import GelGrid
from tsis.mechanics.gel.shear import gel_shear
from tsis.model.gel_sensor import BoundedValue, GelSensor

SENSOR = GelSensor(
    name="dotted",
    width_mm=19.2,
    height_mm=14.4,
    thickness_mm=BoundedValue(value=3.5, low=3.3, high=3.7),
    young_kpa=BoundedValue(value=150.0, low=135.0, high=165.0),
    poisson=BoundedValue(value=0.48, low=0.47, high=0.49),
    image_px=(160, 120),
    mm_per_pixel=(0.12, 0.12),
    marker_pitch_mm=1.2,
)


def dragged(radius: float, shear: tuple[float, float], pressure: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Movement of the face's pixels by a disc of even shear and a Hertzian pressure, and its force."""
    y, x = (np.mgrid[:120, :160] - np.array([59.5, 79.5])[:, None, None]) * 0.12
    rho = np.hypot(x, y) / radius
    inside = (rho < 1).astype(float)
    traction = np.stack([inside * shear[0], inside * shear[1]])
    grid = GelGrid((120, 160), (0.12, 0.12), 150.0, 0.48, 3.5)
    moved = grid.displacement_mm(pressure * np.sqrt(np.maximum(1 - rho**2, 0.0)), traction)
    return moved[:2], traction.sum(axis=(1, 2)) * 0.12**2 / 1000, np.stack([x, y])


def test_a_brick_moves_and_turns_without_force() -> None:
    """The benchmark's elements know no force of a rigid motion, and the right one of a stretch."""
    size, young, poisson = np.array([0.5, 0.4, 0.7]), 100.0, 0.45
    stiffness = brick(size, young, poisson)
    places = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * size
    for motion in (np.tile([1.0, 2.0, 3.0], 8), np.cross([0.1, 0.2, 0.3], places).ravel()):
        assert np.abs(stiffness @ motion).max() < 1e-9
    held = places * np.array([-poisson * 0.01, -poisson * 0.01, 0.01])  # a bar that is free at its sides
    force = (stiffness @ held.ravel()).reshape(8, 3)
    assert force[places[:, 2] > 0, 2].sum() == pytest.approx(young * 0.01 * size[0] * size[1], rel=1e-6)
    assert np.abs(force[:, :2]).max() < 1e-9


@pytest.mark.parametrize("pressure", [0.0, 40.0])
def test_an_even_shear_has_its_force(pressure: float) -> None:
    moved, truth, place = dragged(2.2, (6.0, -3.0), pressure)
    rng = np.random.default_rng(4)
    rows, columns = (part.ravel() for part in np.meshgrid(np.arange(5, 118, 9), np.arange(5, 158, 9), indexing="ij"))
    shift = moved[:, rows, columns].T + rng.normal(0, 0.005, (rows.size, 2))
    found = gel_shear(
        place[:, rows, columns].T, shift, sensor=SENSOR, centre_mm=(0.0, 0.0), radius_mm=2.2, sd_mm=0.005, draws=100
    )
    assert found.force_n == pytest.approx(truth, abs=0.08 * float(np.hypot(*truth)))
    for part, (low, high) in zip(truth, found.interval_n(), strict=True):
        assert low < part < high
    assert not found.problems


def test_dots_of_a_picture_tell_how_far_they_moved() -> None:
    moved, _, _ = dragged(2.2, (8.0, 4.0), 0.0)
    y, x = np.mgrid[:120, :160].astype(float)
    dots = np.ones((120, 160))
    for row in range(5, 120, 10):
        for column in range(5, 160, 10):
            dots[np.hypot(x - column, y - row) < 2.2] = 0.3
    dots = gaussian_filter(dots, 0.7)
    pulled = map_coordinates(dots, (y - moved[1] / 0.12, x - moved[0] / 0.12), order=1, mode="nearest")
    colour = np.array([120.0, 130.0, 110.0])
    frames = [part[..., None] * colour for part in (pulled, dots)]
    found = marker_shift(frames[0], frames[1], SENSOR)
    assert len(found.points_mm) > 150
    row, column = (found.points_mm / 0.12 + (79.5, 59.5)).round().astype(int).T[::-1]
    expected = moved[:, row, column].T
    assert np.abs(found.shift_mm - expected).max() < 0.06
    assert np.sqrt(np.mean((found.shift_mm - expected) ** 2)) < 0.015


def test_what_has_no_markers_is_refused() -> None:
    blank = np.full((120, 160, 3), (100.0, 110.0, 120.0))
    with pytest.raises(InputError, match=r"dotted must show markers every 1\.2 mm; got none"):
        marker_shift(blank, blank, SENSOR)
    with pytest.raises(InputError, match="has no markers; put marker_pitch_mm into its file"):
        marker_shift(blank, blank, replace(load_sensor("gelsight-mini"), marker_pitch_mm=None))
    with pytest.raises(InputError, match="with n at least 6; got"):
        gel_shear(np.zeros((3, 2)), np.zeros((3, 2)), sensor=SENSOR, centre_mm=(0.0, 0.0), radius_mm=2.0)

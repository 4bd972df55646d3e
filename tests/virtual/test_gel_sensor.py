"""The virtual gel sensor against closed forms of contact, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tsis.catalog import load_sensor
from tsis.errors import InputError
from tsis.imaging import contacts
from tsis.mechanics.finite_strain import SphereResolution
from tsis.model import BoundedValue, GelSensor, Layer
from tsis.virtual import VirtualGelSensor

COARSE = SphereResolution(order=3, cells=4, rings=2, face_cells=6)
GEL = Layer(thickness_mm=8.0, young_kpa=150.0, poisson=0.45)


def small_sensor() -> GelSensor:
    sensor = load_sensor("gelsight-mini")
    return replace(sensor, image_px=(160, 120), mm_per_pixel=(0.1264, 0.1264), thickness_mm=BoundedValue(value=8.0))


def test_a_rigid_ball_is_that_of_hertz_and_its_contact_is_found() -> None:
    """Hertz on a half-space: a³ = 3 F R / 4 E*; a layer seven contact radii thick is stiffer."""
    virtual = VirtualGelSensor(small_sensor(), rng=np.random.default_rng(3), gel=GEL, resolution=COARSE)
    press = virtual.press(virtual.rigid_ball(3.0), force_n=0.3, centre_px=(70.0, 55.0))
    hertz = (0.75 * 300.0 * 3.0 * (1.0 - 0.45**2) / 150.0) ** (1.0 / 3.0)
    assert press.radius_px * 0.1264 == pytest.approx(hertz, rel=0.05)
    assert press.depth_mm.max() == pytest.approx(hertz**2 / 3.0, rel=0.2)
    assert press.depth_mm.max() < hertz**2 / 3.0
    assert press.force_n == 0.3
    (found,) = contacts([press.frame], sensor=press.sensor, reference=press.reference)
    assert found.good
    assert np.hypot(*np.subtract(found.centre_px, (70.0, 55.0))) < 0.5
    assert found.radius_px == pytest.approx(press.radius_px, rel=0.12)  # the mesh is coarse


def test_calibration_presses_lie_inside_the_frame_at_several_depths() -> None:
    virtual = VirtualGelSensor(small_sensor(), rng=np.random.default_rng(4), gel=GEL, resolution=COARSE)
    made = virtual.calibration_presses(4, ball_radius_mm=3.0, depths=2)
    assert len({press.force_n for press in made}) == 2
    assert len({press.centre_px for press in made}) == 4
    for press in made:
        assert all(press.radius_px < part < 160 - press.radius_px for part in press.centre_px)
        assert press.depth_mm.max() < 0.3 * GEL.thickness_mm


@pytest.mark.parametrize(
    ("sensor", "said"),
    [
        (load_sensor("digit"), "a virtual gel sensor must be flat; digit is curved"),
        (replace(small_sensor(), mm_per_pixel=None), "mm_per_pixel of gelsight-mini is not known"),
    ],
)
def test_a_sensor_that_is_no_layer_or_has_no_scale_is_refused(sensor: GelSensor, said: str) -> None:
    with pytest.raises(InputError, match=said):
        VirtualGelSensor(sensor, rng=np.random.default_rng(1))

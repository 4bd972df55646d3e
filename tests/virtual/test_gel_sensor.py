"""The virtual gel sensor against closed forms of contact, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tsis.catalog.sensors import load_sensor
from tsis.errors import CameraError, InputError
from tsis.imaging.gel_contact import contacts, marker_shift
from tsis.instrument.camera import Camera
from tsis.mechanics.finite_strain.soft_sphere import SphereResolution
from tsis.mechanics.gel.shear import gel_shear
from tsis.model.gel_sensor import BoundedValue, GelSensor
from tsis.model.phantom import SoftSphere
from tsis.model.probe import Layer
from tsis.virtual.camera import GEL_PRESS_SETTING, VirtualGelCamera
from tsis.virtual.gel_frames import marker_ink, rendered_series
from tsis.virtual.gel_sensor import VirtualGelSensor

COARSE = SphereResolution(order=3, cells=4, rings=2, face_cells=6)
GEL = Layer(thickness_mm=8.0, young_kpa=150.0, poisson=0.45)


def small_sensor() -> GelSensor:
    sensor = load_sensor("gelsight-mini")
    return replace(sensor, image_px=(160, 120), mm_per_pixel=(0.1264, 0.1264), thickness_mm=BoundedValue(value=8.0))


@pytest.mark.parametrize("seed", [1, 2])
def test_the_gel_lies_within_the_limits_of_the_file_and_another_seed_has_another(seed: int) -> None:
    sensor = load_sensor("gelsight-mini")
    gel = VirtualGelSensor(small_sensor(), rng=np.random.default_rng(seed)).gel
    other = VirtualGelSensor(small_sensor(), rng=np.random.default_rng(seed + 10)).gel
    low, high = sensor.young_kpa.limits
    assert low <= gel.young_kpa <= high
    assert gel.young_kpa != other.young_kpa


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("seed", [8, 104])
def test_white_light_calls_no_contact_good_that_is_far_off(seed: int) -> None:
    """Two minima of the radius, one at half of it, were taken for the truth."""
    virtual = VirtualGelSensor(load_sensor("9dtact"), rng=np.random.default_rng(seed))
    ball = SoftSphere(radius_mm=5.0, young_kpa=100.0)
    presses = (
        *virtual.calibration_presses(6, ball_radius_mm=3.0),
        *virtual.presses(ball, forces_n=(0.3, 0.6, 0.9)),
    )
    found = contacts([press.frame for press in presses], sensor=virtual.sensor, reference=virtual.reference)
    off = [contact.radius_px / press.radius_px - 1 for contact, press in zip(found, presses, strict=True)]
    good = [abs(error) for error, contact in zip(off, found, strict=True) if contact.good]
    assert len(good) >= 5
    assert max(good) < 0.15
    assert np.median(good) < 0.05


@pytest.mark.slow
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


def test_a_marker_lies_where_it_moved() -> None:
    sensor = replace(small_sensor(), marker_pitch_mm=2.0)
    shift = np.zeros((2, 120, 160))
    shift[0], shift[1] = 0.3, -0.2
    still, moved = marker_ink(sensor), marker_ink(sensor, shift)
    assert still.sum() * 0.1264**2 == pytest.approx(
        10 * 7.7 * np.pi * 0.34**2, rel=0.05
    )  # 10 x 8 dots, the last row cut
    y, x = np.mgrid[:120, :160]
    dot = (np.abs(x - 7.9) < 6) & (np.abs(y - 23.7) < 6)
    places = [np.array([(part * axis)[dot].sum() / part[dot].sum() for axis in (x, y)]) for part in (still, moved)]
    assert places[0] == pytest.approx([1.0 / 0.1264, 3.0 / 0.1264], abs=0.1)
    assert (places[1] - places[0]) * 0.1264 == pytest.approx([0.3, -0.2], abs=0.02)
    assert not marker_ink(small_sensor()).any()


@pytest.mark.slow
def test_a_dragged_ball_has_its_shear_force_from_frames_with_markers() -> None:
    """From rendered frames to newtons along the face; the gel is known. Dots move up to 0.8 of their pitch."""
    sensor = replace(
        load_sensor("gelsight-mini"), thickness_mm=BoundedValue(value=4.0), young_kpa=BoundedValue(value=150.0),
        poisson=BoundedValue(value=0.48), marker_pitch_mm=1.0,
    )  # fmt: skip
    gel = Layer(thickness_mm=4.0, young_kpa=150.0, poisson=0.48)
    virtual = VirtualGelSensor(sensor, rng=np.random.default_rng(61), gel=gel, resolution=COARSE)
    (press,) = virtual.presses(virtual.rigid_ball(3.0), forces_n=(0.8,), centre_px=(160.0, 120.0), shear=(0.4, -0.2))
    (contact,) = contacts([press.frame], sensor=sensor, reference=virtual.reference)
    assert contact.good
    assert contact.centre_mm is not None
    assert contact.radius_mm is not None
    moved = marker_shift(press.frame, virtual.reference, sensor)
    found = gel_shear(
        moved.points_mm, moved.shift_mm, sensor=sensor, centre_mm=contact.centre_mm, radius_mm=contact.radius_mm
    )
    assert press.shear_n == pytest.approx((0.32, -0.16))
    assert found.force_n == pytest.approx(press.shear_n, abs=0.15 * 0.36)


def test_the_camera_shows_the_presses_of_a_series_in_colour() -> None:
    made = rendered_series(small_sensor(), 6, ball_radius_mm=3.0, seed=5)
    camera = VirtualGelCamera(small_sensor(), seed=5, per_s=1000.0)
    assert isinstance(camera, Camera)
    with pytest.raises(CameraError, match="must be opened first"):
        camera.start()
    camera.open()
    camera.start(camera.modes()[0])
    stream = camera.frames()
    untouched = next(stream)
    assert untouched.colour is not None
    np.testing.assert_array_equal(untouched.colour, made[0].reference)
    camera.adjust(GEL_PRESS_SETTING, 3)
    pressed = next(stream)
    assert pressed.colour is not None
    np.testing.assert_array_equal(pressed.colour, made[2].frame)
    assert (untouched.sequence, pressed.sequence, camera.settings()[0].value, camera.lost) == (0, 1, 3.0, False)
    with pytest.raises(InputError, match="press must lie in"):
        camera.adjust(GEL_PRESS_SETTING, 7)
    camera.stop()
    assert list(stream) == []

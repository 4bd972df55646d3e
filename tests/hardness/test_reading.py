"""Reading a contact off a frame: known pressures come back, whatever gain, place and light are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.hardness.stand_ins import hertzian_field

import tsis
from tsis.errors import InputError
from tsis.hardness.reading import ContactReading, read_contact
from tsis.imaging.rendering import render
from tsis.imaging.sensor import Sensor, expose
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage
from tsis.virtual.direct_contact import direct_contact_calibration

PROBE, SENSOR = tsis.load_probe("tsis-direct"), Sensor()
KNOWN = direct_contact_calibration(SENSOR, probe=PROBE)


def picture(contact_mm: float, force_n: float, known: Calibration = KNOWN, *, gain: float = 1.0) -> TactileImage:
    light = gain * render(hertzian_field(PROBE, contact_mm, force_n), SENSOR, known)
    if known.light is not None:
        light *= known.light.at(*SENSOR.axes_mm())
    return TactileImage(
        grey=expose(light, SENSOR, np.random.default_rng(1)), mm_per_pixel=SENSOR.mm_per_pixel, force_n=force_n
    )


def read(image: TactileImage, known: Calibration = KNOWN) -> ContactReading:
    return read_contact(image, probe=PROBE, calibration=known, blur_mm=0.05)


@pytest.mark.parametrize(("contact_mm", "force_n"), [(0.8, 0.2), (1.5, 0.5), (3.0, 0.5)])
def test_a_hertzian_contact_comes_back(contact_mm: float, force_n: float) -> None:
    found = read(picture(contact_mm, force_n))
    assert found.radius_mm == pytest.approx(contact_mm, rel=3 * found.radius_sd)
    assert found.radius_sd < 0.006
    assert found.light_force_n == pytest.approx(force_n, rel=5e-3)
    assert found.axis_ratio == pytest.approx(1.0, abs=0.02)


def test_the_radius_does_not_depend_on_the_gain() -> None:
    first, brighter = read(picture(2.0, 0.5)), read(picture(2.0, 0.5, gain=1.2))
    assert brighter.radius_mm == pytest.approx(first.radius_mm, rel=2e-3)
    assert brighter.light_force_n == pytest.approx(1.2 * first.light_force_n, rel=1e-2)


def test_stray_light_is_taken_off() -> None:
    image = picture(2.0, 0.5)
    found, stray = read(image), read(replace(image, grey=image.grey + 3.0))
    assert stray.radius_mm == pytest.approx(found.radius_mm, rel=1e-3)
    assert stray.light_force_n == pytest.approx(found.light_force_n, rel=3e-3)


def test_uneven_light_that_is_known_is_evened() -> None:
    ends = np.linspace(-14.0, 14.0, 29)
    tilt = 1 + 0.03 * ends[None, :] + 0 * ends[:, None]
    none = np.zeros_like(tilt)
    light = LightMap(x_mm=ends, y_mm=ends, relative=tilt, flux_x=none, flux_y=none, growth_per_mm=none, error=0.0)
    known = replace(KNOWN, light=light)
    found = read(picture(2.0, 0.5, known), known)
    assert found.radius_mm == pytest.approx(2.0, rel=3 * found.radius_sd)
    assert found.light_force_n == pytest.approx(0.5, rel=5e-3)


def test_no_contact_is_refused() -> None:
    empty = TactileImage(
        grey=expose(np.zeros((492, 768)), SENSOR, np.random.default_rng(1)), mm_per_pixel=SENSOR.mm_per_pixel
    )
    with pytest.raises(InputError, match="nothing stands out"):
        read(empty)


def test_a_contact_at_the_border_is_refused() -> None:
    image = picture(2.0, 0.5)
    cut = replace(image, grey=image.grey[:, 384:], axis_px=None)
    with pytest.raises(InputError, match="inside the picture"):
        read(cut)


def test_a_contact_beyond_the_face_is_refused() -> None:
    small = replace(PROBE, radius_mm=3.0)
    with pytest.raises(InputError, match="inside the face"):
        read_contact(picture(2.9, 0.5), probe=small, calibration=KNOWN, blur_mm=0.05)


def test_a_skin_that_saturates_is_refused() -> None:
    known = replace(KNOWN, saturation_kpa=20.0)
    with pytest.raises(InputError, match="rougher skin"):
        read(picture(1.5, 1.0), known)

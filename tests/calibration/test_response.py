from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erf
from tests.calibration.bench import even_reference

from tsis.calibration.force_line import MIDDLE, Loading, read_loading_frame
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.response import (
    LEAST_FRACTION,
    PressureResponse,
    Saturation,
    fit_response,
    light_fraction,
    peakedness,
    spread_factor,
)
from tsis.errors import CalibrationError, InputError
from tsis.imaging.rendering import render
from tsis.imaging.sensor import Sensor
from tsis.mechanics.closed_forms import HertzContact
from tsis.model.calibration import Calibration
from tsis.model.image import TactileImage
from tsis.model.press import PressField

if TYPE_CHECKING:
    from tsis.calibration.camera_reference import CameraReference

SENSOR = Sensor(columns=256, rows=216)
GAIN, FORCES, MODULUS = 0.5, (0.2, 0.4, 0.8, 1.2, 1.6, 2.0), 660.0
C = np.sqrt(np.pi) / 2


def reference(*, lamp_sd: float | None = None) -> CameraReference:
    some = MeasuredValue(value=0.5, sd=0.01)
    noise = {"read_noise_grey": some, "shot_noise_grey": MeasuredValue(value=0.02, sd=0.001), "stray_grey": some}
    patch = {} if lamp_sd is None else {"patch_px": (4, 4, 36, 36), "patch_grey": some, "lamp_sd": lamp_sd}
    shape = (SENSOR.rows, SENSOR.columns)
    return even_reference(shape, dark=0.0, untouched=0.0, mm_per_pixel=SENSOR.mm_per_pixel, **noise, **patch)


def loading(
    tip_mm: float, saturation_kpa: float, *, gain: float = GAIN, blur_mm: float = 0.05, noise: float = 0.0
) -> Loading:
    """Pictures by the package's renderer of press fields, which the calibration does not use."""
    rng, readings = np.random.default_rng(round(tip_mm)), []
    answer = Calibration(gain_grey_per_kpa=gain, saturation_kpa=saturation_kpa)
    for force in FORCES:
        edge = (3 * 1000 * force * tip_mm / (4 * MODULUS)) ** (1 / 3)
        contact = HertzContact(
            force_mn=1000 * force, contact_radius_mm=edge, peak_pressure_kpa=1500 * force / (np.pi * edge**2)
        )
        radius = np.concatenate([edge * np.sin(np.linspace(0.0, np.pi / 2, 600)), [1.001 * edge, 12.0]])
        field = PressField(
            radius_mm=radius,
            pressure_kpa=contact.pressure_kpa(radius),
            face_displacement_mm=np.zeros_like(radius),
            approach_mm=0.0,
            force_n=force,
        )
        grey = render(field, SENSOR, answer, blur_mm=blur_mm)
        grey = grey + noise * rng.standard_normal(grey.shape)
        image = TactileImage(grey=grey, mm_per_pixel=SENSOR.mm_per_pixel)
        readings.append(read_loading_frame(image, reference(), force_n=force, touched=True))
    return Loading.from_frames(tip_mm, readings)


@pytest.mark.parametrize("x", [1e-3, 0.3, 0.8, 1.5])
def test_shapes_are_the_integrals_over_the_contact(x: float) -> None:
    def ring(r: float, power: int) -> float:
        return float(2 * np.pi * r ** (1 + power) * erf(C * x * np.sqrt(1 - r**2)) / x)

    total, square = quad(ring, 0, 1, args=(0,))[0], quad(ring, 0, 1, args=(2,))[0]
    spread = square / total
    edge = MIDDLE * np.sqrt(2.5 * spread)
    middle = quad(ring, 0, edge, args=(0,))[0] / (np.pi * edge**2)
    at = np.array([x**2])
    assert float(light_fraction(at)[0]) == pytest.approx(total / (2 * np.pi / 3), rel=1e-4)
    assert float(spread_factor(at)[0]) == pytest.approx(spread, rel=1e-4)
    assert float(peakedness(at)[0]) == pytest.approx(middle * spread / total, rel=1e-4)


def test_shapes_go_smoothly_through_no_saturation() -> None:
    at = np.linspace(-0.2, 0.2, 21)
    for shape in (light_fraction, spread_factor, peakedness):
        bend = np.diff(shape(at), 2)
        assert np.abs(bend).max() < 0.05 * np.abs(np.diff(shape(at))).max()


@pytest.mark.parametrize("saturation_kpa", [500.0, 1000.0])
def test_gain_and_saturation_of_rendered_contacts_are_found(saturation_kpa: float) -> None:
    found = fit_response([loading(tip, saturation_kpa) for tip in (2.0, 10.0, 14.0)], reference=reference())
    assert found.saturation.value_kpa == pytest.approx(saturation_kpa, rel=0.05)
    assert found.gain_grey_per_kpa.value == pytest.approx(GAIN, rel=0.005)
    presses = 3 * sum(force >= LEAST_FRACTION * max(FORCES) for force in FORCES)
    assert found.saturation.bend_per_kpa2.degrees_of_freedom == presses - 2  # its bend and its blur are fitted


def test_uncorrected_sums_would_give_too_small_a_gain() -> None:
    one = loading(2.0, 500.0)
    slope = np.polyfit(one.force_n, one.total_grey, 1)[0] * SENSOR.mm_per_pixel[0] * SENSOR.mm_per_pixel[1] / 1000
    assert slope < 0.95 * GAIN


def test_a_straight_answer_leaves_the_saturation_open_above() -> None:
    runs = [loading(tip, 1e5, noise=0.7) for tip in (2.0, 10.0, 14.0)]
    found = fit_response(runs, reference=reference()).saturation
    low, high = found.interval()
    assert low > 500.0
    assert high == np.inf
    assert not found.identified
    assert np.isfinite(found.value_kpa)


def test_blur_is_not_taken_for_saturation() -> None:
    for blur in (0.0, 0.1):
        runs = [loading(tip, 700.0, blur_mm=blur) for tip in (2.0, 10.0, 14.0)]
        assert fit_response(runs, reference=reference()).saturation.value_kpa == pytest.approx(700.0, rel=0.12)


def test_tips_that_differ_widen_the_gain() -> None:
    gains = (0.49, 0.5, 0.51)
    runs = [loading(tip, 1000.0, gain=gain) for tip, gain in zip((2.0, 10.0, 14.0), gains, strict=True)]
    found = fit_response(runs, reference=reference(), gauge_fraction=0.0).gain_grey_per_kpa
    assert found.value == pytest.approx(0.5, rel=0.005)
    assert found.sd == pytest.approx(0.01 / np.sqrt(3), rel=0.1)
    assert found.degrees_of_freedom < 3
    rough = fit_response(runs, reference=reference(), gauge_fraction=0.0, area_fraction=0.02).gain_grey_per_kpa
    assert rough.sd == pytest.approx(np.hypot(found.sd, 0.02 * 0.5), rel=0.01)


def test_the_estimates_get_what_was_measured() -> None:
    response = PressureResponse(
        gain_grey_per_kpa=MeasuredValue(value=0.5, sd=0.01),
        saturation=Saturation(bend_per_kpa2=MeasuredValue(value=1e-6, sd=1e-8)),
        repeatability_share=0.002,
        gauge_share=0.001,
    )
    known = response.calibration(reference(lamp_sd=0.0), name="today", probe="tsis-direct")
    assert known.saturation_kpa == pytest.approx(1000.0)
    assert known.gain_sd == pytest.approx(np.hypot(0.02, 0.002), rel=0.01)
    assert [known.read_noise_grey, known.shot_noise_grey, known.force_sd] == [0.5, 0.02, 0.001]
    assert (known.name, known.probe) == ("today", "tsis-direct")
    for lamp_sd, drift in ((0.015, 0.015), (None, 0.01)):  # lamps that no patch tells count as 1 %, as in every force
        doubtful = response.calibration(reference(lamp_sd=lamp_sd), name="", probe="")
        assert doubtful.gain_sd == pytest.approx(np.linalg.norm([0.02, 0.002, drift]), rel=1e-3)
    few = replace(response, gain_grey_per_kpa=MeasuredValue(value=0.5, sd=0.01, degrees_of_freedom=2))
    wide = few.calibration(reference(lamp_sd=0.0), name="", probe="").gain_sd
    assert wide == pytest.approx(0.02 * 4.303 / 1.96, rel=0.01)


def test_what_makes_no_answer_is_refused() -> None:
    one = loading(2.0, 1000.0)
    with pytest.raises(CalibrationError, match="at least 2 loadings"):
        fit_response([one], reference=reference())
    with pytest.raises(InputError, match="mm_per_pixel"):
        fit_response([one, one], reference=replace(reference(), mm_per_pixel=None))
    clipped = replace(one, clipped=np.ones_like(one.clipped))
    with pytest.raises(CalibrationError, match="presses"):
        fit_response([clipped, clipped], reference=reference())

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import erf

import tsis
from tsis.calibration.camera_reference import make_reference
from tsis.calibration.force_line import ForceLine, ForceLineDiagnostics
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.specification import Specification, edge_width, frame_rate, specification_sheet
from tsis.errors import CalibrationError, InputError, UnknownNameError
from tsis.imaging.sensor import Sensor
from tsis.model.image import TactileImage
from tsis.virtual.loading_machine import VirtualLoadingMachine

SCALE = (0.03, 0.04)
TEN_TO_NINETY = 2 * 1.2815515655446004  # standard deviations between 10 and 90 % of a normal distribution


def edge(
    sigma_mm: float, *, angle_deg: float = 10.0, noise: float = 1.0, radius_mm: float | None = None
) -> TactileImage:
    x = (np.arange(240) - 119.5) * SCALE[0]
    y = (np.arange(200) - 99.5) * SCALE[1]
    turn = np.radians(angle_deg)
    away = x[None, :] * np.cos(turn) + y[:, None] * np.sin(turn)
    if radius_mm is not None:
        away = radius_mm - np.hypot(x[None, :], y[:, None])
    grey = 60 * (1 + erf(away / (np.sqrt(2) * sigma_mm)))
    return TactileImage(grey=grey + noise * np.random.default_rng(1).standard_normal(grey.shape), mm_per_pixel=SCALE)


@pytest.mark.parametrize("sigma_mm", [0.05, 0.12])
@pytest.mark.parametrize("angle_deg", [0.0, 10.0, -40.0, 85.0])
def test_the_width_of_a_straight_edge_is_that_of_its_blur(sigma_mm: float, angle_deg: float) -> None:
    found = edge_width(edge(sigma_mm, angle_deg=angle_deg))
    low, high = found.interval(0.999)
    assert low < TEN_TO_NINETY * sigma_mm < high
    assert found.sd < 0.02 * found.value


def test_the_width_of_a_circular_edge_is_that_of_its_blur() -> None:
    found = edge_width(edge(0.1, radius_mm=2.0), shape="circle")
    assert found.value == pytest.approx(TEN_TO_NINETY * 0.1, rel=0.02)


@pytest.mark.parametrize(("shape", "radius_mm"), [("straight", None), ("circle", 1.8)])
def test_pixels_that_the_correction_leaves_out_do_not_draw_the_edge_aside(shape: str, radius_mm: float | None) -> None:
    whole = edge(0.1, radius_mm=radius_mm)
    holed = whole.grey.copy()
    # inside the contact, and joined to the dark beside it: their border is longer than a fifth of the edge
    rows, columns = ((70, 150), (190, 240)) if radius_mm is None else ((90, 115), (110, 240))
    holed[slice(*rows), slice(*columns)] = 0.0
    found = edge_width(replace(whole, grey=holed), shape=shape)
    assert found.value == pytest.approx(TEN_TO_NINETY * 0.1, rel=0.03)


def test_the_width_is_not_the_size_of_a_pixel() -> None:
    narrow, wide = (edge_width(edge(sigma)).value for sigma in (0.06, 0.12))
    assert wide / narrow == pytest.approx(2.0, rel=0.03)


def test_the_virtual_probe_resolves_what_lens_and_pixels_let_through() -> None:
    rng, sensor = np.random.default_rng(2), Sensor(columns=256, rows=216)
    machine = VirtualLoadingMachine(tsis.load_probe("tsis-direct"), rng=rng, sensor=sensor, blur_mm=0.05)
    dark, untouched, flat = ([take() for _ in range(4)] for take in (machine.dark, machine.no_contact, machine.flat))
    reference = make_reference(dark, untouched, [flat], patch_px=machine.patch_px)
    found = edge_width(reference.corrected(machine.edge(5.0)))
    # a pixel that an edge runs through shows the share that is covered, a box of its own width
    assert found.value == pytest.approx(TEN_TO_NINETY * np.hypot(0.05, 0.0336 / np.sqrt(12)), rel=0.02)


@pytest.mark.parametrize(
    "image",
    [
        TactileImage(grey=np.zeros((60, 60)), mm_per_pixel=SCALE),
        TactileImage(grey=np.random.default_rng(3).normal(50, 3, (60, 60)), mm_per_pixel=SCALE),
        TactileImage(grey=np.full((60, 60), 100.0), mm_per_pixel=SCALE),
    ],
    ids=["dark", "noise", "lit all over"],
)
def test_frames_without_an_edge_are_refused(image: TactileImage) -> None:
    with pytest.raises(CalibrationError, match="edge"):
        edge_width(image)


@pytest.mark.parametrize("noise", [0.5, 2.0, 5.0])
def test_a_step_must_be_eight_times_the_noise(noise: float) -> None:
    def step_of(height: float) -> TactileImage:
        clean = edge(0.1, noise=0.0).grey * height / 120
        return TactileImage(
            grey=clean + noise * np.random.default_rng(4).standard_normal(clean.shape), mm_per_pixel=SCALE
        )

    with pytest.raises(CalibrationError, match=r"its step of .* does not stand out of noise of"):
        edge_width(step_of(4.0 * noise))  # percentiles of the noise itself add as much again
    assert edge_width(step_of(20.0 * noise)).value == pytest.approx(TEN_TO_NINETY * 0.1, rel=0.15)


def test_an_edge_needs_a_scale() -> None:
    with pytest.raises(InputError, match="mm_per_pixel"):
        edge_width(TactileImage(grey=edge(0.1).grey))


def test_the_frame_rate_counts_what_was_lost() -> None:
    times = np.arange(301) / 30.0
    assert frame_rate(times).value == pytest.approx(30.0)
    assert frame_rate(np.delete(times, slice(100, 130))).value == pytest.approx(27.0)
    jitter = times + 1e-3 * np.random.default_rng(4).standard_normal(301)
    low, high = frame_rate(jitter).interval()
    assert low < 30.0 < high
    assert high - low < 0.5
    for bad in ([0.0, 1.0], [0.0, 1.0, 1.0]):
        with pytest.raises(InputError, match="ascending"):
            frame_rate(bad)


LOOP = MeasuredValue(value=-0.002, sd=2e-5)


def sheet(
    *,
    line: ForceLine | None = None,
    edge_mm: MeasuredValue | None = None,
    hysteresis: MeasuredValue | None = LOOP,
) -> Specification:
    def known(value: float, unit: str = "") -> MeasuredValue:
        return MeasuredValue(value=value, sd=0.01 * abs(value), degrees_of_freedom=9, unit=unit)

    some_line = ForceLine(
        intercept_grey=known(0.0),
        slope_grey_per_n=known(4e5),
        unit_covariance=(0.0, 0.0, 1e6),
        units=3,
        residual_grey=known(100.0),
        residual_share=known(0.002),
        least_n=0.1,
        most_n=2.0,
        pixels=55296,
        full_scale=255.0,
        tips_mm=(2.0, 10.0, 14.0),
    )
    diagnostics = ForceLineDiagnostics(
        residual_sd_grey=1.0,
        r_squared=1.0,
        linearity=known(0.001),
        exponent=1.0,
        hysteresis=hysteresis,
        repeatability=None,
        tip_difference=None,
        detectable_n=known(1.5e-3, "N"),
        saturated=False,
    )
    return specification_sheet(probe="tsis-direct", line=line or some_line, diagnostics=diagnostics, edge_mm=edge_mm)


def test_the_sheet_holds_what_was_measured_and_leaves_the_rest_empty() -> None:
    found = sheet(edge_mm=MeasuredValue(value=0.13, sd=0.001, unit="mm"))
    assert found["spatial resolution"].measured == MeasuredValue(value=0.13, sd=0.001, unit="mm")
    assert found["frame rate"].measured is None
    assert found["repeatability"].measured is None
    detectable = found["smallest detectable force"].measured
    assert detectable is not None
    assert detectable.value == 1.5e-3
    largest = found["largest force"].measured
    assert largest is not None
    assert largest.value == 2.0
    with pytest.raises(UnknownNameError, match="hysteresis"):
        found["hysteresys"]


def test_the_interval_of_the_largest_force_rests_on_the_few_tips_that_were_loaded() -> None:
    sure = MeasuredValue(value=0.0, sd=0.0)
    line = ForceLine(
        intercept_grey=sure,
        slope_grey_per_n=MeasuredValue(value=4e5, sd=1e3, degrees_of_freedom=2),
        unit_covariance=(0.0, 0.0, (0.01 * 4e5) ** 2),
        units=3,
        residual_grey=sure,
        residual_share=sure,
        least_n=0.1,
        most_n=2.0,
        pixels=55296,
        full_scale=255.0,
        tips_mm=(2.0, 10.0, 14.0),
    )
    largest = sheet(line=line)["largest force"].measured
    assert largest is not None
    # a fourth tip differs from the mean of three by 1 % sqrt(1 + 1/3); Student's t of two degrees of freedom is 4.303
    half = 4.30265 * 2.0 * 0.01 * np.sqrt(4 / 3)
    assert largest.interval() == pytest.approx((2.0 - half, 2.0 + half), rel=1e-5)


def test_hysteresis_that_nobody_measured_is_left_open() -> None:
    assert sheet(hysteresis=None)["hysteresis"].measured is None
    assert "0.6 of the largest force" in sheet()["hysteresis"].note


def test_the_sheet_stands_beside_the_fingertip_and_says_where_the_source_disagrees() -> None:
    found = sheet()
    assert found["spatial resolution"].fingertip == "0.1 mm"
    assert found["frame rate"].fingertip == "0 to 100 Hz"
    assert found["smallest detectable force"].fingertip == "2.5e-2 N"
    note = found["smallest detectable force"].note
    assert all(number in note for number in ("2.5e-3", "2.0e-2", "2.0e-3", "2.5e-2"))
    assert "pitch" in found["spatial resolution"].note

"""Depth of gel sensors against closed forms, rendered presses, and the ball of real presses."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.catalog.sensors import load_sensor
from tsis.errors import CalibrationError, InputError
from tsis.files.reading import parse_object
from tsis.imaging.depth import (
    DepthCalibration,
    DepthMap,
    DepthMapper,
    calibrate_depth,
    depth_calibration_json,
    parse_depth_calibration,
    polynomial_features,
    polynomial_slopes,
)
from tsis.imaging.surface import integrate_gradients
from tsis.instrument.image_files import read_levels
from tsis.virtual.gel_frames import marker_ink, rendered_series

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.model.gel_sensor import GelSensor


def small(name: str) -> GelSensor:
    sensor = load_sensor(name)
    columns, rows = (size // 2 for size in sensor.image_px)
    scale = sensor.mm_per_pixel
    assert scale is not None
    return replace(sensor, image_px=(columns, rows), mm_per_pixel=(2 * scale[0], 2 * scale[1]))


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(0.02, 0.1), st.floats(0.02, 0.1))
def test_a_smooth_surface_is_its_gradients_integral(a: float, b: float, sx: float, sy: float) -> None:
    y, x = np.mgrid[:40, :56].astype(float)
    x, y = x * sx, y * sy
    surface = a * x + b * y + 0.1 * x * y - 0.05 * x**2  # neighbours' mean slopes are its differences exactly
    slope_x, slope_y = a + 0.1 * y - 0.1 * x, b + 0.1 * x
    found = integrate_gradients(slope_x, slope_y, (sx, sy))
    assert found - found.mean() == pytest.approx(surface - surface.mean(), abs=1e-9)


@pytest.mark.parametrize(("name", "known"), [pytest.param("gelsight-mini", 6, marks=pytest.mark.slow), ("9dtact", 2)])
def test_depth_of_rendered_presses_that_were_not_calibrated(name: str, known: int) -> None:
    sensor = small(name)
    made = rendered_series(sensor, known + 2, ball_radius_mm=3.0, seed=11)
    calibration = calibrate_depth(
        [press.frame for press in made[:known]], sensor=sensor, reference=made[0].reference, ball_mm=6.0
    )
    assert calibration.other_sd_mm is not None
    assert calibration.other_sd_mm > np.sqrt(np.mean(np.square(calibration.errors_mm)))  # the best method was taken
    again = parse_depth_calibration(parse_object(depth_calibration_json(calibration), "depth.json", values=10**6))
    assert again.method == calibration.method
    mapper = DepthMapper(again, sensor, made[0].reference)
    for press in made[known:]:
        result = mapper.map(press.frame)
        rows, columns = result.depth_mm.shape
        y, x = np.mgrid[:rows, :columns]
        inside = np.hypot(x - press.centre_px[0], y - press.centre_px[1]) < 0.8 * press.radius_px
        error = (result.depth_mm - press.depth_mm)[inside]
        assert np.std(error) < 0.06
        assert result.sd_mm.min() > 0.0


def test_a_depth_map_becomes_points_and_a_file() -> None:
    result = DepthMap(depth_mm=np.full((3, 5), 0.2), sd_mm=np.full((3, 5), 0.01), mm_per_pixel=(0.1, 0.2))
    points = result.points()
    assert points[0] == pytest.approx((-0.2, -0.2, -0.2))
    assert points.mean(axis=0) == pytest.approx((0.0, 0.0, -0.2))
    header, _, body = result.ply_bytes().partition(b"end_header\n")
    assert b"element vertex 15" in header
    assert np.frombuffer(body, "<f4").reshape(-1, 3) == pytest.approx(points)


def test_what_cannot_be_calibrated_is_refused() -> None:
    sensor = small("gelsight-mini")
    made = rendered_series(sensor, 1, ball_radius_mm=3.0, seed=2)
    with pytest.raises(CalibrationError, match=r"needs 3 good presses of the ball; got 0 of 2 .*no contact"):
        calibrate_depth([made[0].reference] * 2, sensor=sensor, reference=made[0].reference, ball_mm=6.0)
    with pytest.raises(InputError, match="mm_per_pixel of gelsight-mini is not known"):
        calibrate_depth(
            [made[0].frame], sensor=replace(sensor, mm_per_pixel=None), reference=made[0].reference, ball_mm=6.0
        )
    with pytest.raises(InputError, match="must be a depth calibration"):
        parse_depth_calibration({"format": "other"})


def tiny(name: str) -> GelSensor:
    sensor = load_sensor(name)
    assert sensor.mm_per_pixel is not None
    fewer = sensor.image_px[0] / 160
    across, down = sensor.mm_per_pixel
    return replace(sensor, image_px=(160, 120), mm_per_pixel=(fewer * across, fewer * down))


def test_a_contact_wider_than_the_ball_is_refused() -> None:
    sensor = tiny("9dtact")
    made = rendered_series(sensor, 2, ball_radius_mm=3.0, seed=11)
    scale = sensor.mm_per_pixel
    assert scale is not None
    radius = max(press.radius_px for press in made) * scale[0]
    frames, reference = [press.frame for press in made], made[0].reference
    assert calibrate_depth(frames, sensor=sensor, reference=reference, ball_mm=6.0).presses == 2
    said = r"must show a contact that the ball can make, at most .* mm in radius; it shows .*check the diameter of"
    with pytest.raises(CalibrationError, match=said):
        calibrate_depth(frames, sensor=sensor, reference=reference, ball_mm=1.6 * radius)
    wide = replace(sensor, mm_per_pixel=(2.6 * scale[0], 2.6 * scale[1]))
    with pytest.raises(CalibrationError, match=said):
        calibrate_depth(frames, sensor=wide, reference=reference, ball_mm=6.0)


def test_a_frame_that_is_given_again_counts_once() -> None:
    sensor = tiny("9dtact")
    made = rendered_series(sensor, 1, ball_radius_mm=3.0, seed=11)[0]
    once, thrice = (
        calibrate_depth([made.frame.copy() for _ in range(count)], sensor=sensor, reference=made.reference, ball_mm=6.0)
        for count in (1, 3)
    )
    assert (thrice.presses, thrice.errors_mm, thrice.sd_relative) == (1, once.errors_mm, once.sd_relative)
    sensor = tiny("gelsight-mini")
    made = rendered_series(sensor, 1, ball_radius_mm=3.0, seed=11)[0]
    with pytest.raises(CalibrationError, match=r"3 good presses of the ball; got 1 of 3 \(a frame is given twice\)"):
        calibrate_depth([made.frame] * 3, sensor=sensor, reference=made.reference, ball_mm=6.0)


@pytest.mark.parametrize("name", ["gelsight-mini", "9dtact"])
def test_a_press_taken_for_the_untouched_face_is_a_problem_of_the_map(name: str) -> None:
    sensor = tiny(name)
    made = rendered_series(sensor, 5, ball_radius_mm=3.0, seed=11)
    untouched = made[0].reference
    calibration = calibrate_depth([press.frame for press in made[:4]], sensor=sensor, reference=untouched, ball_mm=6.0)
    straight = DepthMapper(calibration, sensor, untouched)
    for press in made:
        assert straight.map(press.frame).problems == ()
        problems = DepthMapper(calibration, sensor, press.frame).map(untouched).problems
        assert any("reference and press may be swapped" in problem for problem in problems)
    for seed, light in ((1, 0.97), (2, 1.0), (3, 1.02), (4, 0.97)):
        noise = np.random.default_rng(seed).normal(0.0, 2.0, untouched.shape)
        again = np.clip(np.rint(light * np.minimum(untouched, 255) + noise), 0, 255).astype(np.uint8)
        assert straight.map(again).problems == ()


def test_real_presses_are_neither_too_wide_nor_swapped(shared_data: Path) -> None:
    with np.load(shared_data / "real" / "taxim_ball" / "dataPack_small.npz", allow_pickle=False) as data:
        untouched, presses = data["f0"], data["imgs"][3::12]
    sensor = load_sensor("gelsight-taxim")
    calibration = calibrate_depth(list(presses), sensor=sensor, reference=untouched, ball_mm=4.0)
    assert calibration.presses == len(presses)
    mapper = DepthMapper(calibration, sensor, untouched)
    assert not any("swapped" in problem for press in presses for problem in mapper.map(press).problems)
    for number in (1, 2):
        folder = shared_data / "real" / "9dtact" / f"sensor_{number}"
        press, reference = (
            read_levels(folder / f"depth_calibration_rectify_crop_{kind}.png") for kind in ("sample", "ref")
        )
        sensor = load_sensor("9dtact")
        calibration = calibrate_depth([press], sensor=sensor, reference=reference, ball_mm=8.0)
        for taken, pressed, swapped in ((reference, press, False), (press, reference, True)):
            problems = DepthMapper(calibration, sensor, taken).map(pressed).problems
            assert any("swapped" in problem for problem in problems) == swapped


def test_a_relative_calibration_divides_by_the_untouched_brightness() -> None:
    """Grey levels that fall by 30 % everywhere are one depth, however uneven the light is."""
    columns, rows = 46, 34
    sensor = replace(load_sensor("9dtact"), image_px=(columns, rows))
    rng = np.random.default_rng(4)
    untouched = np.clip(np.linspace(80.0, 200.0, columns) + rng.normal(0.0, 2.0, (rows, columns)), 0, 255)
    pressed = untouched.copy()
    inner = np.s_[8:26, 8:38]
    pressed[inner] *= 0.7
    frames = [np.repeat(np.rint(part).astype(np.uint8)[..., None], 3, axis=2) for part in (untouched, pressed)]
    spread = {}
    for method in ("grey", "relative"):
        calibration = DepthCalibration(
            sensor=sensor.name, light="white", method=method, weights=np.array([-100.0, 0.0]), ball_mm=4.0,
            presses=1, sd_mm=0.01, sd_relative=0.0,
        )  # fmt: skip
        depth = DepthMapper(calibration, sensor, frames[0]).map(frames[1]).depth_mm[inner]
        spread[method] = float(depth.std() / depth.mean())
    assert spread["relative"] < 0.02
    assert spread["grey"] > 0.15


def test_markers_that_move_leave_no_trace_in_the_depth() -> None:
    """A face 0.3 mm deep, with dots that moved by half of their size, beside the same face without dots."""
    sensor = replace(load_sensor("9dtact"), image_px=(92, 69), mm_per_pixel=(0.25, 0.25), marker_pitch_mm=3.0)
    y, x = np.mgrid[:69, :92]
    levels = 150.0 - 30.0 * np.exp(-((x - 46) ** 2 + (y - 34) ** 2) / 100.0)
    calibration = DepthCalibration(
        sensor=sensor.name, light="white", method="grey", weights=np.array([-100.0]), ball_mm=4.0, presses=1,
        sd_mm=0.01, sd_relative=0.0,
    )  # fmt: skip
    shift = np.stack([np.full(x.shape, 0.25), np.zeros(x.shape)])
    dots = [1.0 - 0.8 * marker_ink(sensor, part) for part in (None, shift)]
    frames = [np.repeat(part[..., None], 3, axis=2) for part in (150.0 * dots[0], levels * dots[1])]
    with_dots = DepthMapper(calibration, sensor, frames[0]).map(frames[1]).depth_mm
    expected = (150.0 - levels) / 100.0
    assert np.sqrt(np.mean((with_dots - expected) ** 2)) < 0.01
    blind = DepthMapper(calibration, replace(sensor, marker_pitch_mm=None), frames[0]).map(frames[1]).depth_mm
    assert np.sqrt(np.mean((blind - expected) ** 2)) > 0.03


def test_a_depth_by_three_terms_is_the_root_of_its_polynomial() -> None:
    calibration = DepthCalibration(
        sensor="9dtact", light="white", method="grey", weights=np.array([-80.0, 20.0, -2.0]), ball_mm=4.0, presses=1,
        sd_mm=0.01, sd_relative=0.0,
    )  # fmt: skip
    for depth in (0.1, 0.5, 1.5):
        change = -80.0 * depth + 20.0 * depth**2 - 2.0 * depth**3
        assert calibration.depth_of_grey(np.array([change]))[0] == pytest.approx(depth, abs=2e-4)
    assert calibration.depth_of_grey(np.array([10.0]))[0] == 0.0


def test_slopes_of_colours_are_the_cubic_polynomial_written_out() -> None:
    """Every monomial to the third degree, and those to the second times x and y, over more than one block."""
    rng = np.random.default_rng(12)
    count = 5000
    change, place = rng.uniform(-60.0, 60.0, (count, 3)), rng.uniform(-1.0, 1.0, (count, 2))
    r, g, b = (change / 64.0).T
    low = [r, g, b, r * r, r * g, r * b, g * g, g * b, b * b]
    cubic = [r**3, r * r * g, r * r * b, r * g * g, r * g * b, r * b * b, g**3, g * g * b, g * b * b, b**3]
    written = np.stack([*low, *cubic, *(t * place[:, 0] for t in low), *(t * place[:, 1] for t in low)], axis=1)
    weights = rng.normal(size=(written.shape[1], 2))
    found = polynomial_slopes(change.astype(np.float32), place.astype(np.float32), weights.astype(np.float32))
    assert found == pytest.approx(written @ weights, abs=1e-4)
    assert polynomial_features(change, place) == pytest.approx(written, abs=1e-5)

"""Scale from a ball, its value, and whether intervals of 95 % hold the truth as often as they say."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.calibration_scale import covered
from scipy.stats import binom

from tsis.calibration.measured import MeasuredValue
from tsis.calibration.scale import PixelScale, axis_ratio_from_ball, scale_from_ball
from tsis.errors import CalibrationError, ImageMismatchError, InputError
from tsis.imaging.sensor import Sensor
from tsis.instrument.image_files import read_image
from tsis.model.image import TactileImage
from tsis.virtual.calibration_bench import ball_frame, untouched_frame

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


FIELDS = {
    "mm_per_pixel_x": MeasuredValue(value=0.0336, sd=1e-4, degrees_of_freedom=9, unit="mm/px"),
    "mm_per_pixel_y": MeasuredValue(value=0.0392, sd=1e-4, unit="mm/px"),
    "shape": (492, 768),
    "at_px": (383.5, 245.5),
    "method": "dots",
    "count": 63,
}


def scale(**other: object) -> PixelScale:
    return PixelScale(**(FIELDS | other))  # type: ignore[arg-type]


def test_a_frame_gets_both_axes() -> None:
    frame = TactileImage(grey=np.ones((492, 768)), name="press")
    scaled = scale().on(frame)
    assert scaled.mm_per_pixel == scale().mm_per_pixel == (0.0336, 0.0392)
    assert scaled.name == "press"


def test_a_frame_of_another_mode_is_refused() -> None:
    with pytest.raises(ImageMismatchError, match=r"\(492, 768\).*\(246, 384\).*camera mode"):
        scale().on(TactileImage(grey=np.ones((246, 384))))
    with pytest.raises(InputError, match="TactileImage"):
        scale().on(np.ones((492, 768)))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wrong",
    [
        {"mm_per_pixel_x": 0.0336},
        {"mm_per_pixel_x": MeasuredValue(value=0.0336, sd=0.0, unit="mm")},
        {"mm_per_pixel_y": MeasuredValue(value=-1.0, sd=0.0, unit="mm/px")},
        {"shape": 5},
        {"shape": (0, 768)},
        {"at_px": (np.nan, 1.0)},
        {"method": "guess"},
        {"count": 0},
        {"residual_px": -1.0},
        {"rotation_deg": 90.0},
        {"skew_deg": np.inf},
    ],
    ids=lambda wrong: next(iter(wrong)),
)
def test_values_out_of_range(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong)).split("_")[0]):
        scale(**wrong)


SENSOR = Sensor(columns=640, rows=480, mm_per_pixel=(0.032, 0.038))
RADIUS_MM = 4.0
TRAVEL_MM = (0.0, 0.4, 0.8)


def presses(seed: int = 1, *, first_mm: float = 0.6, travel_mm: Sequence[float] = TRAVEL_MM) -> list[TactileImage]:
    rng = np.random.default_rng(seed)
    return [ball_frame(SENSOR, rng=rng, ball_radius_mm=RADIUS_MM, depth_mm=first_mm + travel) for travel in travel_mm]


def untouched() -> TactileImage:
    return untouched_frame(SENSOR, rng=np.random.default_rng(2))


def test_three_presses_give_both_axes() -> None:
    scale, found = scale_from_ball(presses(), untouched(), ball_radius_mm=RADIUS_MM, travel_mm=TRAVEL_MM)
    for size, true in zip((scale.mm_per_pixel_x, scale.mm_per_pixel_y), SENSOR.mm_per_pixel, strict=True):
        assert abs(size.value - true) < 4 * size.sd
        assert size.sd < 0.02 * true
    assert (scale.method, scale.count, scale.shape) == ("ball", 3, (480, 640))
    np.testing.assert_allclose(found.centres_px, np.tile([319.5, 239.5], (3, 1)), atol=1.0)
    assert found.darker
    assert abs(found.axis_ratio.value - 0.038 / 0.032) < 4 * found.axis_ratio.sd
    assert np.all(np.diff(found.radii_px) > 0)


def test_radius_and_travel_bring_their_uncertainty() -> None:
    """The geometry: sizes go with the root of radius times travel, as long as the presses are shallow."""
    frames, bare = presses(), untouched()
    sharp, _ = scale_from_ball(frames, bare, ball_radius_mm=RADIUS_MM, travel_mm=TRAVEL_MM, travel_sd_mm=0.0)
    large, _ = scale_from_ball(
        frames, bare, ball_radius_mm=RADIUS_MM, ball_radius_sd_mm=0.4, travel_mm=TRAVEL_MM, travel_sd_mm=0.0
    )
    own, total = sharp.mm_per_pixel_x, large.mm_per_pixel_x
    assert total.value == own.value
    by_radius = np.sqrt(total.sd**2 - own.sd**2) / own.value
    assert by_radius == pytest.approx(0.5 * 0.4 / RADIUS_MM, rel=0.3)


@pytest.mark.parametrize("angle", ["wide", "high"])
def test_one_press_gives_the_ratio_of_the_axes(angle: str) -> None:
    size = (0.04, 0.03) if angle == "wide" else (0.03, 0.04)
    sensor = Sensor(columns=640, rows=480, mm_per_pixel=size)
    rng = np.random.default_rng(3)
    frame, bare = ball_frame(sensor, rng=rng, depth_mm=1.4), untouched_frame(sensor, rng=rng)
    ratio = axis_ratio_from_ball(frame, bare)
    assert abs(ratio.value - size[1] / size[0]) < 4 * ratio.sd
    assert ratio.sd < 0.02 * ratio.value
    brighter = TactileImage(grey=255.0 - frame.grey), TactileImage(grey=255.0 - bare.grey)
    assert abs(axis_ratio_from_ball(*brighter).value - size[1] / size[0]) < 4 * ratio.sd


def test_one_press_is_no_scale() -> None:
    with pytest.raises(CalibrationError, match="two presses or more"):
        scale_from_ball(presses()[:1], untouched(), ball_radius_mm=RADIUS_MM, travel_mm=TRAVEL_MM[:1])


@pytest.mark.parametrize("travel_mm", [(0.0, 0.0, 0.01), (0.0, 400.0, 800.0)])
def test_travels_too_small_or_in_another_unit(travel_mm: tuple[float, ...]) -> None:
    with pytest.raises(CalibrationError, match="another unit"):
        scale_from_ball(presses(), untouched(), ball_radius_mm=RADIUS_MM, travel_mm=travel_mm)


def test_a_frame_without_a_ball_is_refused() -> None:
    rng = np.random.default_rng(5)
    frames = [*presses()[:2], untouched_frame(SENSOR, rng=rng)]
    with pytest.raises(CalibrationError, match="one ball"):
        scale_from_ball(frames, untouched(), ball_radius_mm=RADIUS_MM, travel_mm=TRAVEL_MM)
    aside = ball_frame(SENSOR, rng=rng, depth_mm=1.4, offset_mm=(10.0, 0.0))
    with pytest.raises(CalibrationError, match="one ball"):
        axis_ratio_from_ball(aside, untouched())
    small = ball_frame(SENSOR, rng=rng, ball_radius_mm=0.4, depth_mm=0.2, blur_px=1.0)
    with pytest.raises(CalibrationError, match=r"pixels or more|one ball"):
        axis_ratio_from_ball(small, untouched())


def test_presses_of_both_signs_are_refused() -> None:
    bare = untouched()
    frames = presses()
    brighter = TactileImage(grey=2 * bare.grey - frames[1].grey)
    with pytest.raises(CalibrationError, match="one direction"):
        scale_from_ball([frames[0], brighter, frames[2]], bare, ball_radius_mm=RADIUS_MM, travel_mm=TRAVEL_MM)


def test_arguments_out_of_range() -> None:
    frames, bare = presses()[:2], untouched()
    with pytest.raises(InputError, match="ball_radius_mm"):
        scale_from_ball(frames, bare, ball_radius_mm=np.nan, travel_mm=(0.0, 0.4))
    with pytest.raises(InputError, match="one reading for each"):
        scale_from_ball(frames, bare, ball_radius_mm=RADIUS_MM, travel_mm=TRAVEL_MM)
    with pytest.raises(InputError, match="travel_mm"):
        scale_from_ball(frames, bare, ball_radius_mm=RADIUS_MM, travel_mm=(0.0, np.nan))
    with pytest.raises(ImageMismatchError, match="shape"):
        scale_from_ball(frames, TactileImage(grey=np.ones((4, 4))), ball_radius_mm=RADIUS_MM, travel_mm=(0.0, 0.4))


@pytest.mark.parametrize("sensor", ["sensor_1", "sensor_2"])
def test_a_real_ball_in_the_rectified_frame_is_round(shared_data: Path, sensor: str) -> None:
    """Its makers made the pixels square, to whole pixels; one press says no more of the scale."""
    folder = shared_data / "real" / "9dtact" / sensor
    frames = (read_image(folder / f"depth_calibration_rectify_crop_{name}.png") for name in ("sample", "ref"))
    ratio = axis_ratio_from_ball(*frames)
    low, high = ratio.interval(0.95)
    assert low < 1.0 < high
    assert high - low < 0.04


@pytest.mark.slow
@pytest.mark.parametrize(("ball", "runs"), [(False, 60), (True, 40)], ids=["dots", "ball"])
def test_intervals_hold_as_often_as_they_say(ball: bool, runs: int) -> None:
    found = covered(runs, 3, ball=ball)
    assert found["refused"] == 0
    few = int(binom.ppf(0.002, runs, 0.95))
    for axis in "xy":
        share = found[f"held {axis} / %"]
        assert isinstance(share, float)
        assert few <= round(share * runs / 100)
    # An interval as wide as the world would hold too.
    uncertainty = found["mean standard uncertainty / %"]
    assert isinstance(uncertainty, float)
    assert uncertainty < (1.5 if ball else 0.2)

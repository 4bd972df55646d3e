"""What one frame shows, against closed forms and NumPy."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.calibration.guard.reading import FrameShape, GuardReference
from tsis.calibration.guard.watch import PressWatch, WatchState
from tsis.calibration.settling import UNKNOWN
from tsis.console.services.choice import PressForce
from tsis.console.services.frames import (
    BINS,
    LARGEST_SIDE_PX,
    analyse_frame,
    contact,
    exposure_warnings,
    histogram,
    reduced,
)
from tsis.instrument.camera import Frame
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from numpy.typing import NDArray

BACKGROUND = 8.0
ROWS, COLUMNS = 492, 768


def frame(grey: NDArray[Any], *, full_scale: float = 255.0, seed: int = 1, time_s: float = 0.0) -> Frame:
    """The levels with a camera's noise, rounded."""
    noisy = np.asarray(grey, float) + np.random.default_rng(seed).normal(0, 0.6, np.shape(grey))
    kind = np.uint8 if full_scale == 255.0 else np.uint16
    return Frame(
        pixels=noisy.round().clip(0, full_scale).astype(kind), sequence=0, time_s=time_s, full_scale=full_scale
    )


def away(x: float, y: float, rows: int = ROWS, columns: int = COLUMNS) -> NDArray[np.float64]:
    """Distance of each pixel from a place."""
    return np.asarray(np.hypot(np.arange(columns)[None, :] - x, np.arange(rows)[:, None] - y))


def area(outline: tuple[tuple[float, float], ...]) -> float:
    """Of a polygon."""
    x, y = np.array(outline).T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


@settings(max_examples=15)
@given(x=st.floats(200, 560), y=st.floats(170, 320), radius=st.floats(40, 150), seed=st.integers(0, 99))
def test_a_disc_is_found_where_it_lies(x: float, y: float, radius: float, seed: int) -> None:
    observed = contact(frame(np.where(away(x, y) < radius, 120.0, BACKGROUND), seed=seed), None)
    assert observed is not None
    assert observed.centroid_px == pytest.approx((x, y), abs=0.5)
    assert area(observed.outline_px) == pytest.approx(np.pi * radius**2, rel=0.04)
    reach = [np.hypot(px - x, py - y) for px, py in observed.outline_px]
    assert radius - 2.5 < min(reach) <= max(reach) < radius + 2.5


@pytest.mark.parametrize("shape", [(492, 768), (480, 640), (1200, 1600), (100, 130)])
def test_a_gaussian_is_centred_where_it_is_centred(shape: tuple[int, int]) -> None:
    rows, columns = shape
    x, y, width = 0.4 * columns, 0.55 * rows, 0.09 * columns
    grey = BACKGROUND + 150 * np.exp(-((away(x, y, rows, columns) / width) ** 2) / 2)
    observed = contact(frame(grey), None)
    assert observed is not None
    assert observed.centroid_px == pytest.approx((x, y), abs=0.004 * columns)


def test_what_was_there_untouched_is_no_contact() -> None:
    rim = np.where(np.abs(away(384, 246) - 200) < 12, 200.0, BACKGROUND)
    pressed = rim + np.where(away(420, 230) < 60, 50.0, 0.0)
    calibration_with = reduced(rim)
    result = contact(frame(pressed), calibration_with)
    assert result is not None
    assert result.centroid_px == pytest.approx((420, 230), abs=1.0)
    assert contact(frame(rim), calibration_with) is None


def test_noise_alone_is_no_contact() -> None:
    assert contact(frame(np.full((ROWS, COLUMNS), BACKGROUND)), None) is None
    assert contact(Frame(pixels=np.zeros((40, 50), np.uint8), sequence=0), None) is None


@pytest.mark.parametrize("shape", [(1, 1), (2, 900), (900, 2), (3, 3)])
def test_frames_of_odd_shapes_are_borne(shape: tuple[int, int]) -> None:
    grey = np.full(shape, BACKGROUND)
    grey[: shape[0] // 2 + 1, : shape[1] // 2 + 1] = 90.0
    observed = contact(frame(grey), None)
    if observed is not None:
        across, down = np.array([observed.centroid_px, *observed.outline_px]).T
        assert ((across >= -1) & (across <= shape[1]) & (down >= -1) & (down <= shape[0])).all()


@pytest.mark.parametrize("shape", [(492, 768), (3000, 4000), (50, 60), (4000, 30)])
def test_a_thinned_frame_is_small_and_keeps_its_mean(shape: tuple[int, int]) -> None:
    levels = np.random.default_rng(2).integers(0, 255, shape).astype(np.uint8)
    small = reduced(levels)
    assert max(small.shape) <= max(LARGEST_SIDE_PX, 3)
    assert small.mean() == pytest.approx(levels.mean(), rel=0.01)


@pytest.mark.parametrize(
    ("full_scale", "kind"), [(255.0, np.uint8), (4095.0, np.uint16), (65535.0, np.uint16), (255.0, np.float64)]
)
def test_the_histogram_is_that_of_numpy(full_scale: float, kind: type[np.generic]) -> None:
    rng = np.random.default_rng(5)
    levels = (rng.beta(0.4, 0.5, (97, 131)) * full_scale).round().astype(kind)
    counts = histogram(Frame(pixels=levels, sequence=0, full_scale=full_scale))
    expected = np.histogram(levels, bins=BINS, range=(0.0, full_scale + 1.0))[0]
    assert counts.sum() == levels.size
    assert counts.tolist() == expected.tolist()


@pytest.mark.parametrize(
    ("bin_of_pixels", "clipped", "message"),
    [(2, 0.0, "uses 3% of the scale"), (40, 0.0, ""), (63, 0.25, "25.0% of the pixels are at full scale")],
)
def test_the_exposure_is_judged(bin_of_pixels: int, clipped: float, message: str) -> None:
    counts = np.zeros(BINS, dtype=np.int64)
    counts[bin_of_pixels] = 1000
    warnings = exposure_warnings(counts, clipped)
    assert bool(warnings) == bool(message)
    assert all(message in item for item in warnings)


@pytest.mark.parametrize("level", [BACKGROUND, 20.0, 120.0, 255.0])
def test_the_whole_of_a_frame_in_numbers_that_json_has(level: float) -> None:
    grey = np.where(away(384, 246) < 90, level, BACKGROUND)
    one = frame(grey)
    watch = PressWatch(FrameShape.of(one.tactile_image(mm_per_pixel=(0.03, 0.04))), reference=GuardReference())
    analysis, after = analyse_frame(
        watch, WatchState(), one, number=7, force=PressForce(value_n=1.0, source="typed"), untouched=None
    )
    assert json.loads(json.dumps(asdict(analysis), allow_nan=False))["number"] == 7
    assert analysis.clipped_share == pytest.approx(float((one.pixels == 255).mean()))
    assert sum(analysis.histogram) == one.pixels.size
    assert bool(analysis.contact) == (level >= 20.0)
    assert after.reading is not None


def test_flags_that_are_up_leave_no_contact_where_there_is_none() -> None:
    grey = np.full((ROWS, COLUMNS), BACKGROUND)
    reference = GuardReference(untouched=TactileImage(grey=grey))
    watch = PressWatch(FrameShape.of(TactileImage(grey=grey)), reference=reference)
    analysis, _ = analyse_frame(watch, WatchState(), frame(grey), number=1, force=None, untouched=reduced(grey))
    assert [flag.name for flag in analysis.flags] == ["no-contact"]
    assert analysis.contact is None


@pytest.mark.parametrize(
    ("verdict", "wait_s", "message"),
    [("settled", 0.0, "settled"), ("settling", 3.6, "wait 4 s"), ("cannot tell", None, "moving")],
)
def test_stillness_in_words(verdict: str, wait_s: float | None, message: str) -> None:
    assert replace(UNKNOWN, verdict=verdict, wait_s=wait_s).text == message

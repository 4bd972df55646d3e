"""What one frame shows, against closed forms and NumPy, and the thread that looks at frames."""

from __future__ import annotations

import json
from contextlib import contextmanager
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.console.live.feed import Feed
from tests.waiting import until

from tsis.calibration.guard.limits import GuardFlag
from tsis.calibration.guard.reading import FrameShape, GuardReference
from tsis.calibration.guard.watch import PressWatch, WatchState
from tsis.calibration.settling import UNKNOWN, Settling
from tsis.console.services.choice import PressForce
from tsis.console.services.frames import (
    BINS,
    LARGEST_SIDE_PX,
    Watcher,
    analyse_frame,
    contact,
    exposure_warnings,
    histogram,
    reduced,
)
from tsis.instrument.camera import Frame
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from tsis.instrument.acquisition import ReceivedFrame


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
    [(8, 0.0, "uses 3% of the scale"), (160, 0.0, ""), (255, 0.25, "25.0% of the pixels are at full scale")],
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


def test_a_settled_press_is_not_asked_to_hold_still() -> None:
    class Watch:
        """Raises the flag for a moment after the press has settled, as the guard's hysteresis does."""

        def __init__(self, settling: Settling) -> None:
            self.settling = settling

        def step(self, *_: object) -> tuple[tuple[GuardFlag, ...], WatchState]:
            flag = GuardFlag(name="moving", value=0.009, limit=0.01, advice="hold still for 0 s")
            return (flag,), WatchState(settling=self.settling)

    names = {}
    for verdict in ("settled", "settling"):
        watch = cast("PressWatch", Watch(replace(UNKNOWN, verdict=verdict, wait_s=0.0)))
        analysis, _ = analyse_frame(
            watch, WatchState(), frame(np.full((48, 64), 9.0)), number=1, force=None, untouched=None
        )
        names[verdict] = [flag.name for flag in analysis.flags]
    assert names == {"settled": [], "settling": ["moving"]}


SHAPE = (120, 160)
DARK = np.full(SHAPE, 8, dtype=np.uint8)


def pressed(x: int) -> NDArray[np.uint8]:
    grey = np.random.default_rng(x).integers(7, 10, SHAPE, dtype=np.uint8)
    grey[40:80, x - 20 : x + 20] = 120
    return grey


class Watched:
    """A watcher and what it is asked to look at."""

    def __init__(self) -> None:
        self.feed: Feed | None = Feed()
        self.reference = GuardReference(untouched=TactileImage(grey=DARK.astype(float)))
        self.force: PressForce | Exception = PressForce(value_n=1.5, source="typed")
        self.asked = self.forces = 0
        self.watcher = Watcher(lambda: self.feed, self._reference, self._force)  # type: ignore[arg-type, return-value]

    def check(self, pixels: NDArray[np.uint8], full_scale: float = 255.0) -> int:
        """Bring a frame; its number."""
        assert self.feed is not None
        self.feed.bring(pixels, full_scale=full_scale)
        return self.feed.ring.end

    def observed(self, number: int) -> bool:
        return self.watcher.frame_analysis is not None and self.watcher.frame_analysis.number == number

    def _reference(self) -> tuple[GuardReference, tuple[float, float] | None]:
        self.asked += 1
        return self.reference, None

    def _force(self, arrival: ReceivedFrame) -> PressForce:
        self.forces += 1
        if isinstance(self.force, Exception):
            raise self.force
        return self.force


@contextmanager
def watching() -> Iterator[Watched]:
    watched = Watched()
    try:
        yield watched
    finally:
        watched.watcher.close()


@pytest.fixture
def watched() -> Iterator[Watched]:
    with watching() as running:
        yield running


def test_it_tells_of_the_newest_frame(watched: Watched) -> None:
    for x in (40, 90):
        number = watched.check(pressed(x))
        until(lambda number=number: watched.observed(number))  # type: ignore[misc]
        analysis = watched.watcher.frame_analysis
        assert analysis is not None
        assert analysis.contact is not None
        assert analysis.contact.centroid_px == pytest.approx((x - 0.5, 59.5), abs=1.0)
        assert analysis.force == PressForce(value_n=1.5, source="typed")
    number = watched.check(DARK)
    until(lambda: watched.observed(number))
    assert watched.watcher.frame_analysis is not None
    assert watched.watcher.frame_analysis.contact is None
    assert watched.asked == 1  # the reference is made ready once


def test_without_a_camera_nothing_is_seen(watched: Watched) -> None:
    number = watched.check(pressed(40))
    until(lambda: watched.observed(number))
    watched.feed = None
    until(lambda: watched.watcher.frame_analysis is None)
    assert watched.watcher.failure == ""


def test_nothing_is_told_of_a_press_before_the_camera_went_away(watched: Watched) -> None:
    feed = watched.feed
    assert feed is not None
    number = watched.check(pressed(40))
    until(lambda: watched.observed(number))
    feed.lost = True
    until(lambda: watched.watcher.frame_analysis is None)
    feed.lost = False
    number = watched.check(pressed(90))
    until(lambda: watched.observed(number))
    assert watched.asked == 2  # it is compared anew


def test_another_camera_is_compared_anew(watched: Watched) -> None:
    number = watched.check(pressed(40))
    until(lambda: watched.observed(number))
    watched.feed, watched.reference = Feed(), GuardReference()
    number = watched.check(np.tile(pressed(70), (2, 2)))
    until(lambda: watched.observed(number) and watched.asked == 2)


def test_to_begin_anew_asks_for_the_reference_again(watched: Watched) -> None:
    number = watched.check(pressed(40))
    until(lambda: watched.observed(number))
    watched.watcher.begin_anew()
    number = watched.check(pressed(40))
    until(lambda: watched.asked == 2 and watched.observed(number))


def test_a_reference_of_another_size_is_said_in_a_sentence(watched: Watched) -> None:
    watched.check(np.tile(pressed(40), (2, 2)))
    until(lambda: watched.watcher.failure != "")
    assert watched.watcher.frame_analysis is None
    assert "(120, 160)" in watched.watcher.failure or "160" in watched.watcher.failure
    watched.reference = GuardReference()
    watched.watcher.begin_anew()
    number = watched.check(np.tile(pressed(40), (2, 2)))
    until(lambda: watched.observed(number))
    assert watched.watcher.failure == ""


def test_what_nobody_foresaw_ends_nothing(watched: Watched, caplog: pytest.LogCaptureFixture) -> None:
    watched.force = ZeroDivisionError("of a gauge")
    for requested in (1, 2):
        number = watched.check(pressed(40))
        until(lambda requested=requested: watched.forces == requested)  # type: ignore[misc]
    until(lambda: "ZeroDivisionError: of a gauge" in watched.watcher.failure)
    watched.force = PressForce(value_n=2.0, source="gauge")
    number = watched.check(pressed(40))
    until(lambda: watched.observed(number))
    assert watched.watcher.failure == ""
    assert len(caplog.records) == 1  # told once, and not with every frame


def test_it_ends_when_it_is_told_to() -> None:
    with watching() as watched:
        number = watched.check(pressed(40))
        until(lambda: watched.observed(number))
    assert not watched.watcher._thread.is_alive()

"""The thread that looks at frames, with frames that a test brings one by one."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.console.live.feed import Feed
from tests.waiting import until

from tsis.calibration.guard.reading import GuardReference
from tsis.console.services.choice import PressForce
from tsis.console.services.frames import Watcher
from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from tsis.instrument.acquisition import ReceivedFrame

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

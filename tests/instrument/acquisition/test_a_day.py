"""A day of frames, simulated: the clock advances with the frames, and the camera is lost every half hour."""

from __future__ import annotations

import gc
import os
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.endurance import scaled
from tests.waiting import until

from tsis.errors import CameraError
from tsis.instrument.acquisition import Acquisition
from tsis.instrument.camera import Frame, Mode

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.instrument.camera import Setting

FRAMES_PER_S = 30.0
LOSS_EVERY_S = 1800.0


class SimulatedDay:
    """A camera whose clock stands still between frames, and which is lost every half hour."""

    def __init__(self) -> None:
        self.now_s, self.lost, self.frames_made = 0.0, False, 0
        rng = np.random.default_rng(1)
        self._pixels = [rng.integers(0, 256, (492, 768), dtype=np.uint8) for _ in range(4)]
        self._running = threading.Event()

    name = "simulated day"

    def open(self) -> None:
        """Nothing to take hold of."""
        self.lost = False

    def modes(self) -> tuple[Mode, ...]:
        """The one mode."""
        return (Mode(width_px=768, height_px=492, frames_per_s=FRAMES_PER_S),)

    def settings(self) -> tuple[Setting, ...]:
        """None."""
        return ()

    def adjust(self, name: str, value: float) -> None:
        """Refuse."""
        raise CameraError(f"{name} cannot be set to {value:g}")

    def start(self, mode: Mode | None = None) -> None:
        """Begin."""
        self._running.set()

    def frames(self) -> Iterator[Frame]:
        """Half an hour of frames, then a loss."""
        sequence, ends_s = 0, self.now_s + LOSS_EVERY_S
        while self._running.is_set():
            self.now_s += 1 / FRAMES_PER_S
            if self.now_s > ends_s:
                self.lost = True
                self.now_s += 1.0
                raise CameraError("the simulated camera was unplugged")
            self.frames_made += 1
            yield Frame(pixels=self._pixels[sequence % 4], sequence=sequence, time_s=self.now_s)
            sequence += 1

    def stop(self) -> None:
        """End."""
        self._running.clear()


def held() -> tuple[float, int]:
    """Resident memory in MB and open descriptors of this process."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6, len(list(Path("/proc/self/fd").iterdir()))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
def test_hours_of_frames_and_losses_leave_memory_as_it_was() -> None:
    source, hours = SimulatedDay(), scaled(6)
    acquisition = Acquisition(lambda: source, clock=lambda: source.now_s, retry_s=0.0)
    acquisition.start()
    until(lambda: source.now_s >= 3600 * hours / 20)
    before_mb, descriptors = held()
    until(lambda: source.now_s >= 3600 * hours)
    after_mb, descriptors_after = held()
    account = acquisition.account()
    acquisition.stop()
    assert account.connections >= 2 * hours - 1
    assert after_mb - before_mb < 20
    assert descriptors_after == descriptors

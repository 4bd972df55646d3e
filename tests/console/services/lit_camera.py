"""A camera in a world that a test changes: what lies before it, whether it is plugged, how its driver behaves."""

from __future__ import annotations

import threading
from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.waiting import HANGS_S

from tsis.errors import CameraError
from tsis.instrument.camera import Frame, Mode, Setting
from tsis.model.require import require_one_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

ROWS, COLUMNS, FRAMES_PER_S = 48, 64, 100.0
USUAL_GAIN, MOST_GAIN = 2.0, 24.0


def observed(level: int, gain: float, rows: int = ROWS) -> NDArray[np.uint8]:
    """A contact of that brightness on a dark face."""
    y, x = np.mgrid[:rows, :COLUMNS]
    spot = np.exp(-((x - COLUMNS / 2) ** 2 + (y - rows / 2) ** 2) / 60.0)
    return np.asarray(np.rint(8 + gain + level * spot), dtype=np.uint8)


class World:
    """What cameras look at.

    Attributes
    ----------
    level
        Brightness of the contact, from frame to frame as a test changes it.
    queued
        Frames that wait in the driver before they are delivered.
    refuses
        Why no camera can be opened; empty when it can.
    opening
        Where it is set, cameras wait for it in ``open``.
    plugged
        Frames stay away, with an error, while it is False.
    """

    def __init__(self) -> None:
        self.level, self.queued, self.rows = 50, 0, ROWS
        self.refuses, self.most_gain, self.gain = "", MOST_GAIN, USUAL_GAIN
        self.opening: threading.Event | None = None
        self.waits = threading.Event()
        self.plugged = True
        self.cameras: list[LitCamera] = []

    def connect(self, spec: str) -> LitCamera:
        camera = LitCamera(self, spec)
        self.cameras.append(camera)
        return camera


class LitCamera:
    """Follows the camera protocol; each frame shows the world and the gain of when it began."""

    lost = False

    def __init__(self, world: World, spec: str) -> None:
        self._world, self.name = world, spec
        self.gain = world.gain
        self.adjusted: list[float] = []
        self._running, self._stopped = threading.Event(), threading.Event()

    def open(self) -> None:
        if self._world.opening is not None:
            self._world.waits.set()
            self._world.opening.wait(HANGS_S)
        if self._world.refuses or not self._world.plugged:
            raise CameraError(self._world.refuses or "nothing answers at aravis:lit; check its cable")

    def modes(self) -> tuple[Mode, ...]:
        return (Mode(width_px=COLUMNS, height_px=self._world.rows, frames_per_s=FRAMES_PER_S, pixel_format="Mono8"),)

    def settings(self) -> tuple[Setting, ...]:
        return (Setting(name="gain", value=self.gain, low=0.0, high=self._world.most_gain, unit="dB"),)

    def adjust(self, name: str, value: float) -> None:
        require_one_of("setting", name, ["gain"])
        self.gain = self.settings()[0].checked(value)
        self.adjusted.append(self.gain)

    def start(self, mode: Mode | None = None) -> None:
        self._stopped.clear()
        self._running.set()

    def frames(self) -> Iterator[Frame]:
        waiting: deque[NDArray[Any]] = deque()
        sequence = 0
        while self._running.is_set():
            if not self._world.plugged:
                raise RuntimeError("bulk transfer failed")
            waiting.append(observed(self._world.level, self.gain, self._world.rows))
            if self._stopped.wait(1 / FRAMES_PER_S):  # the exposure
                return
            if len(waiting) > self._world.queued:
                yield Frame(
                    pixels=waiting.popleft(), sequence=sequence, name=f"lit#{sequence}", settings={"gain": self.gain}
                )
                sequence += 1

    def stop(self) -> None:
        self._running.clear()
        self._stopped.set()

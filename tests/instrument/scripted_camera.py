"""A camera that does what a script says: delivers, stalls in its driver, breaks, changes its mode."""

from __future__ import annotations

import queue
import threading
from typing import TYPE_CHECKING

import numpy as np
from tests.waiting import HANGS_S

from tsis.errors import CameraError
from tsis.instrument.camera import Frame, Mode, Setting
from tsis.model.require import require_one_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

END, BREAK = "end", "break"


def pixels(level: int = 7, rows: int = 6, columns: int = 8) -> NDArray[np.uint8]:
    return np.full((rows, columns), level, np.uint8)


def frame(sequence: int, level: int = 7, *, rows: int = 6) -> Frame:
    return Frame(pixels=pixels(level, rows=rows), sequence=sequence, time_s=sequence / 30, name=f"scripted#{sequence}")


class ScriptedCamera:
    """Frames, and the words `END` and `BREAK`, come from a queue that the test fills."""

    def __init__(self, *, fails_to_open: bool = False, deaf: bool = False) -> None:
        self.script: queue.Queue[Frame | str] = queue.Queue()
        self.fails_to_open, self.deaf = fails_to_open, deaf
        self.gain, self.stops = 1.0, 0
        self.started_in: Mode | None = None
        self.lost = False
        self._running = threading.Event()

    name = "scripted"

    def open(self) -> None:
        if self.fails_to_open:
            raise CameraError("scripted is held by another program; close it")

    def modes(self) -> tuple[Mode, ...]:
        return (Mode(width_px=8, height_px=6, frames_per_s=30.0), Mode(width_px=4, height_px=3, frames_per_s=60.0))

    def settings(self) -> tuple[Setting, ...]:
        return (Setting(name="gain", value=self.gain, low=0.0, high=24.0, unit="dB"),)

    def adjust(self, name: str, value: float) -> None:
        require_one_of("setting", name, ["gain"])
        self.gain = self.settings()[0].checked(value)

    def start(self, mode: Mode | None = None) -> None:
        self.started_in = mode
        self._running.set()

    def frames(self) -> Iterator[Frame]:
        while self._running.is_set():
            try:
                item = self.script.get(timeout=HANGS_S if self.deaf else 0.02)
            except queue.Empty:
                continue
            if item == END:
                return
            if item == BREAK:
                self.lost = True
                raise RuntimeError("bulk transfer failed")
            assert isinstance(item, Frame)
            yield item

    def stop(self) -> None:
        self.stops += 1
        self._running.clear()

"""Frames exposed here, or in a process of their own: their noise then costs the program that shows them no time."""

from __future__ import annotations

import os
import signal
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.imaging import Sensor, expose

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.context import SpawnProcess

    from numpy.typing import NDArray


def exposed(light: NDArray[np.float64], factor: float, sensor: Sensor, rng: np.random.Generator) -> NDArray[Any]:
    """Pixels of a frame of ``factor`` times a light, shape (rows, columns), uint8 or uint16; the rest as `expose`."""
    return expose(light * factor, sensor, rng).astype(_type_of(sensor))


def load_exposure() -> None:
    """Load what exposes frames, which takes half a second before the first one else."""
    exposed(np.zeros((8, 8)), 1.0, Sensor(rows=8, columns=8), np.random.default_rng(0))


FIRST_HERE = 15  # frames; the first picture does not share the processor with the start of a process


class ExposingProcess:
    """Exposes frames in a process of its own, with a generator spawned from ``rng``.

    The process begins after `FIRST_HERE` frames. Frames are exposed here until it is ready, and again if it was killed.
    It ends with `close`, or with this program. One thread at a time.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._light: NDArray[np.float64] | None = None  # which the process has
        self._process: SpawnProcess | None = None
        self._there: Connection | None = None
        self._apart, self._here = False, 0

    @property
    def pid(self) -> int | None:
        """Number of the process that exposes; None while frames are exposed here."""
        return self._process.pid if self._process is not None and self._apart else None

    def expose(self, light: NDArray[np.float64], factor: float, sensor: Sensor) -> NDArray[Any]:
        """Pixels as `exposed`; a light is taken to be unchanged while it is the same array."""
        try:
            if (there := self._ready()) is not None:
                there.send((None if light is self._light else light, factor, sensor))
                self._light = light
                return np.frombuffer(there.recv_bytes(), dtype=_type_of(sensor)).reshape(light.shape)
        except (EOFError, OSError):  # it was killed
            self.close()
        self._here += 1
        if self._here == FIRST_HERE:
            self._begin()
        return exposed(light, factor, sensor, self._rng)

    def close(self) -> None:
        """End the process; another call does nothing."""
        self._apart = False
        if self._there is not None:
            self._there.close()
        if self._process is not None:
            self._process.kill()  # it may still be loading, and has nothing to save
            self._process.join()

    def _begin(self) -> None:
        context = get_context("spawn")
        self._there, end = context.Pipe()
        self._process = context.Process(target=_serve, args=(end,), name="exposing", daemon=True)
        self._process.start()
        end.close()

    def _ready(self) -> Connection | None:
        """The connection to the process, once that is ready."""
        there = self._there
        if there is None or there.closed:
            return None
        if not self._apart and there.poll():
            there.recv()
            there.send(self._rng.spawn(1)[0])
            self._apart = True
        return there if self._apart else None


def _type_of(sensor: Sensor) -> type[np.uint8 | np.uint16]:
    return np.uint8 if sensor.full_scale <= np.iinfo(np.uint8).max else np.uint16


def _serve(requests: Connection) -> None:
    """Answer requests until the other end is closed; it alone is interrupted at a terminal."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(2, 1)  # standard output is for the other program's messages
    load_exposure()
    light = np.zeros((8, 8))
    try:
        requests.send(None)
        rng = requests.recv()
        while True:
            changed, factor, sensor = requests.recv()
            light = light if changed is None else changed
            requests.send_bytes(exposed(light, factor, sensor, rng).tobytes())
    except (EOFError, OSError):  # closed
        return

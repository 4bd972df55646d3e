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

    from numpy.typing import NDArray


def exposed(light: NDArray[np.float64], factor: float, sensor: Sensor, rng: np.random.Generator) -> NDArray[Any]:
    """Pixels of a frame of ``factor`` times a light, shape (rows, columns), uint8 or uint16; the rest as `expose`."""
    return expose(light * factor, sensor, rng).astype(_type_of(sensor))


def load_exposure() -> NDArray[np.float64]:
    """Load what exposes frames, half a second before the first one else; returns the light of a small dark frame."""
    light = np.zeros((8, 8))
    exposed(light, 1.0, Sensor(rows=8, columns=8), np.random.default_rng(0))
    return light


class ExposingProcess:
    """Exposes frames in a process of its own, with a generator spawned from ``rng``.

    Frames are exposed here until that process is ready, and again if it was killed. It ends with `close`, or with this
    program. One thread at a time.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._light: NDArray[np.float64] | None = None  # which the process has
        context = get_context("spawn")
        self._there, end = context.Pipe()
        self._process = context.Process(target=_serve, args=(end,), name="exposing", daemon=True)
        self._process.start()
        end.close()
        self._apart = False

    @property
    def pid(self) -> int | None:
        """Number of the process that exposes; None while frames are exposed here."""
        return self._process.pid if self._apart else None

    def expose(self, light: NDArray[np.float64], factor: float, sensor: Sensor) -> NDArray[Any]:
        """Pixels as `exposed`; a light is taken to be unchanged while it is the same array."""
        try:
            if self._is_ready():
                self._there.send((None if light is self._light else light, factor, sensor))
                self._light = light
                return np.frombuffer(self._there.recv_bytes(), dtype=_type_of(sensor)).reshape(light.shape)
        except (EOFError, OSError):  # it was killed
            self.close()
        return exposed(light, factor, sensor, self._rng)

    def close(self) -> None:
        """End the process; another call does nothing."""
        self._there.close()
        self._apart = False
        self._process.kill()  # it may still be loading, and has nothing to save
        self._process.join()

    def _is_ready(self) -> bool:
        if not self._apart and not self._there.closed and self._there.poll():
            self._there.recv()
            self._there.send(self._rng.spawn(1)[0])
            self._apart = True
        return self._apart


def _type_of(sensor: Sensor) -> type[np.uint8 | np.uint16]:
    return np.uint8 if sensor.full_scale <= np.iinfo(np.uint8).max else np.uint16


def _serve(requests: Connection) -> None:
    """Answer requests until the other end is closed; it alone is interrupted at a terminal."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(2, 1)  # standard output is for the other program's messages
    light = load_exposure()
    try:
        requests.send(None)
        rng = requests.recv()
        while True:
            changed, factor, sensor = requests.recv()
            light = light if changed is None else changed
            requests.send_bytes(exposed(light, factor, sensor, rng).tobytes())
    except (EOFError, OSError):  # closed
        return

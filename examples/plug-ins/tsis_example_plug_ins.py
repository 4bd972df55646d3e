"""One plug-in of each kind for tsis, each as short as it can be. pyproject.toml beside this file names them."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import CameraError, GaugeError
from tsis.instrument.camera import Frame, Mode
from tsis.instrument.discovery import CameraInfo
from tsis.instrument.gauge import ForceReading
from tsis.matching.methods import MatchFit
from tsis.model.probe import Layer, Probe
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.instrument.camera import Setting
    from tsis.records.values import TargetRecord


class RampCamera:
    """A camera that shows a ramp of grey levels, as many frames as its identity says."""

    lost = False
    name = "ramp"

    def __init__(self, identity: str) -> None:
        self._count = int(require_number("number of frames", float(identity or 1), 1, 1000))
        self._running = False

    def open(self) -> None:
        """Connect; nothing to do here."""

    def modes(self) -> tuple[Mode, ...]:
        """The only mode."""
        return (Mode(width_px=64, height_px=48),)

    def settings(self) -> tuple[Setting, ...]:
        """No settings."""
        return ()

    def adjust(self, name: str, value: float) -> None:
        """Refuse: there are no settings."""
        raise CameraError(f"{name} cannot be set to {value:g}; the ramp has no settings")

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames."""
        self._running = True

    def frames(self) -> Iterator[Frame]:
        """Yield the frames."""
        ramp = np.tile(np.arange(64, dtype=np.uint8), (48, 1))
        for number in range(self._count):
            if self._running:
                yield Frame(pixels=ramp + number, sequence=number, name=f"ramp {number}")

    def stop(self) -> None:
        """End the stream."""
        self._running = False


cameras = SimpleNamespace(
    find_cameras_here=lambda: [CameraInfo(source="ramp", identity="3", model="three frames")],
    missing_requirement=lambda: None,  # or a message with its cure, where a driver must be installed first
    connect=RampCamera,
)


def soft_block() -> Probe:
    """A probe of one soft layer."""
    return Probe(radius_mm=10.0, layers=(Layer(thickness_mm=8.0, young_kpa=20.0),))


class dead_weight:  # noqa: N801 - called as a function of the text after "dead-weight:"
    """A gauge that always reads the force of a weight, in newtons."""

    lost = False
    skipped = 0

    def __init__(self, force_n: str) -> None:
        self._force_n = require_number("force of the weight", float(force_n), 0.0, 100.0)
        self.name = f"weight of {self._force_n:g} N"
        self._open = False

    def open(self) -> None:
        """Connect to the gauge."""
        self._open = True

    def readings(self) -> Iterator[ForceReading]:
        """Yield readings until it is closed."""
        while self._open:
            yield ForceReading(time_s=time.monotonic(), force_n=self._force_n)
            time.sleep(0.01)

    def tare(self) -> None:
        """Refuse: a weight has no zero."""
        raise GaugeError("a weight has no zero to set")

    def close(self) -> None:
        """End the readings."""
        self._open = False


def affine(source: Any, target: Any, /, *, rng: np.random.Generator) -> MatchFit:
    """Match points that lie in the same order, and fit an affine map to the pairs."""
    count = min(len(source), len(target))
    ones = np.ones((count, 1))
    solution, *_ = np.linalg.lstsq(np.hstack([source[:count], ones]), target[:count], rcond=None)
    pairs = np.where(np.arange(len(source)) < count, np.arange(len(source)), -1)
    return MatchFit(
        move=lambda points: points @ solution[:-1] + solution[-1], matches=pairs, trust=(pairs >= 0).astype(float)
    )


def forces(record: TargetRecord, path: Path) -> None:
    """Write the force of each press of a target, a line each. Research use only."""
    lines = [f"{press.force_n}" for press in record.presses]
    path.write_text("\n".join(["# Research use only. Force of each press, newtons", *lines, ""]), encoding="utf-8")

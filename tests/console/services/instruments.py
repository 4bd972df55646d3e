"""Benches of tests: before a camera of a test's own world, or with the virtual probe; a gauge, and work for them."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.console.services.lit_camera import World
from tests.waiting import HANGS_S

from tsis.console.services.choice import InstrumentSettings
from tsis.console.services.instrument import Instrument
from tsis.instrument.force_log import ForceLog
from tsis.instrument.gauge import SimulatedGauge

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.console.services.jobs import Job

ANN, BOB = "tab ann", "tab bob"
LIT = "aravis:lit"


def lit_instrument(folder: Path, world: World | None = None, **terms: Any) -> Instrument:
    """An instrument with a camera of that world; Ann is its owner."""
    given: dict[str, Any] = {"camera": LIT, "workspace": folder / "workspace", "store": folder / "store"} | terms
    instrument = Instrument(InstrumentSettings(**given), connect_to=(world or World()).connect)
    instrument.control.take(ANN, "Ann", held_s=600.0)
    return instrument


def virtual_instrument(folder: Path, **terms: Any) -> Instrument:
    """An instrument with the virtual probe; Ann is its owner."""
    given: dict[str, Any] = {"workspace": folder / "workspace", "store": folder / "store", "probe": "tsis-2011"}
    given |= terms
    instrument = Instrument(InstrumentSettings(**given))
    instrument.control.take(ANN, "Ann", held_s=600.0)
    return instrument


class FixedGauge:
    """Work that goes on until it is let go, or asked to end."""

    def __init__(self) -> None:
        self.begun, self.over = threading.Event(), threading.Event()

    def __call__(self, job: Job) -> str:
        self.begun.set()
        while not self.over.wait(0.01):
            job.advance(1, 2)
        return "ended in order"


def gauge(force_n: float = 0.8, **options: Any) -> ForceLog:
    """A started log of a gauge that reads that force."""
    log = ForceLog(SimulatedGauge(lambda _: force_n, rng=np.random.default_rng(1), rate_per_s=200.0, **options))
    log.start()
    assert log.wait_for(8, timeout_s=HANGS_S)
    return log

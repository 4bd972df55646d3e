from __future__ import annotations

import shutil
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.calibration_force import PROBE, SENSOR

from tsis.calibration.session import SessionFolder, SessionSetup
from tsis.virtual.calibration_bench import VirtualBench

if TYPE_CHECKING:
    from pathlib import Path

PITCH_MM = 1.5  # so that the small field holds enough dots
BEGAN = datetime(2026, 11, 22, 10, 0, tzinfo=UTC)


@dataclass(frozen=True)
class Bench:
    """A bench that has done every step, and the folder of its frames."""

    virtual: VirtualBench
    session: SessionFolder
    lamps: float  # mean true brightness of the lamps in the untouched frames


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    virtual = VirtualBench(PROBE, rng=np.random.default_rng(5), sensor=SENSOR, pitch_mm=PITCH_MM)
    session = SessionFolder(tmp_path_factory.mktemp("bench") / "frames")
    session.begin(
        SessionSetup(
            name="bench",
            probe=PROBE.name,
            camera="small",
            began=BEGAN,
            settings={"exposure_ms": 10.0},
            pitch_mm=PITCH_MM,
            patch_px=virtual.patch_px,
        )
    )
    for step in session.plan():
        session.save(step, virtual.shots(step))
        if step.name == "untouched":
            lamps = float(np.mean(virtual.machine.lamps[-step.frames :]))
    return Bench(virtual, session, lamps)


@pytest.fixture
def copied(bench: Bench, tmp_path: Path) -> SessionFolder:
    """The session's folder again, to be changed."""
    shutil.copytree(bench.session.path, tmp_path / "frames")
    return SessionFolder(tmp_path / "frames")

"""What an instrument remembers from run to run."""

from __future__ import annotations

import json
import threading
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.calibration.file import calibration_bytes
from tsis.calibration.frames import UsableCalibration, apply_calibration, load_calibration
from tsis.catalog.probes import load_probe
from tsis.console.services.choice import CameraChoice
from tsis.errors import InputError, TsisError
from tsis.files.atomic import write_durably
from tsis.files.canonical_json import content_sha256
from tsis.files.json_values import from_json_value, to_json_value
from tsis.inclusion.tissue import protocol_forces, tissue_modulus

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.console.services.jobs import JobState
    from tsis.records.values import TargetRecord


LIGHT_N = 0.2  # of the light press by which the virtual probe reads tissue
NOT_ON_TISSUE = (
    "the press does not look like one on even tissue without an inclusion: press another place lightly, and measure "
    "the tissue again"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TissueReading:
    """Tissue as a light press shows it: modulus with its 90 % interval, and the forces that use the probe well on it.

    ``press`` is the light press, which no estimate uses beside its own reading.
    """

    press: str
    young_kpa: float
    interval_kpa: tuple[float, float]
    forces_n: tuple[float, ...]


def read_tissue(record: TargetRecord, press: str) -> TissueReading:
    """The tissue under a stored light press of a target, and the forces that follow from it.

    Raises
    ------
    InputError
        When the press has no calibration, force or scale, does not look like one on even tissue, or no forces are known
        for its tissue.
    """
    stored = next(item for item in record.presses if item.id == press)
    if stored.calibration is None:
        raise InputError(
            "tissue is measured with a calibrated press; this one has no active calibration (activate one)"
        )
    probe, calibration = load_probe(stored.probe), record.calibrations[stored.calibration]
    (ready,), response = apply_calibration(
        calibration, [record.image(stored)], identity=stored.calibration, on_tissue=True
    )
    tissue = tissue_modulus(ready, probe=probe, calibration=response)
    if not tissue.trusted:
        raise InputError(NOT_ON_TISSUE)
    forces_n = protocol_forces(probe, tissue_young_kpa=tissue.young_kpa)
    return TissueReading(press=press, young_kpa=tissue.young_kpa, interval_kpa=tissue.interval_kpa, forces_n=forces_n)


class TissueReadings:
    """The last reading of each target, in a file that survives a restart; safe for several threads."""

    def __init__(self, file: Path) -> None:
        self._file, self._lock = file, threading.Lock()
        self._readings: dict[int, TissueReading] = {}
        with suppress(OSError, ValueError, AttributeError, InputError):  # none yet, or of another release
            items = json.loads(file.read_text(encoding="utf-8")).items()
            self._readings = {int(number): from_json_value(TissueReading, item, "tissue") for number, item in items}

    def of(self, number: int) -> TissueReading | None:
        """That of a target; None before the first."""
        return self._readings.get(number)

    def add(self, number: int, reading: TissueReading) -> None:
        """Replace that of a target; `FileInputError` when it cannot be written, and it holds until the end then."""
        with self._lock:
            self._readings = {**self._readings, number: reading}
            content = {str(target): to_json_value(item) for target, item in self._readings.items()}
            write_durably(self._file, json.dumps(content).encode())


class CalibrationMemory:
    """Keeps in a folder which calibration was activated for each camera, and for the virtual probe of each seed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def of(self, choice: CameraChoice) -> tuple[UsableCalibration | None, str]:
        """The calibration of a camera's last run, and a message about it; None and empty where none was active."""
        file = self._file(choice)
        if not file.exists():
            return None, ""
        try:
            usable = load_calibration(file)
        except TsisError as error:
            return None, f"The calibration of the last session was not activated: {error}."
        return usable, f"Calibration {usable.calibration.name!r} of the last session is active again."

    def keep(self, choice: CameraChoice, given: UsableCalibration | None) -> None:
        """Keep the one that was activated, or that none is; a disk that refuses it stops nothing."""
        file = self._file(choice)
        with suppress(OSError):
            file.unlink(missing_ok=True)
            if given is not None:
                file.parent.mkdir(parents=True, exist_ok=True)
                write_durably(file, calibration_bytes(given.calibration))

    def _file(self, choice: CameraChoice) -> Path:
        own = [choice.probe, choice.seed, choice.is_sphere] if choice.is_virtual else []
        return self._folder / f"{content_sha256([choice.spec, *own])[:16]}.json"


class InstrumentMemory:
    """Keeps camera and target in a file while the program runs, so that a start after a kill finds them again."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def begin(self, choice: CameraChoice) -> tuple[CameraChoice, int] | None:
        """Camera and target of a run of the same ``choice`` at the start that did not end in order; None without."""
        try:
            last = json.loads(self._file.read_text(encoding="utf-8"))
            started, chosen = (from_json_value(CameraChoice, last[name], "camera") for name in ("start", "choice"))
            target = int(last["target"])
        except (OSError, ValueError, KeyError, TypeError, InputError):  # ended in order, or never begun
            return None
        return (chosen, target) if started == choice else None

    def keep(self, start: CameraChoice, choice: CameraChoice, target: int) -> None:
        """Keep the present ones; a disk that refuses them stops nothing."""
        content = {"start": to_json_value(start), "choice": to_json_value(choice), "target": target}
        with suppress(OSError):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            self._file.write_text(json.dumps(content), encoding="utf-8")

    def ended(self) -> None:
        """Forget them: the program ends in order."""
        with suppress(OSError):
            self._file.unlink()


def interruption_message(jobs: tuple[JobState, ...], restored: tuple[CameraChoice, int] | None) -> str:
    """What a program that was killed left behind; empty without that."""
    cut = ", ".join(state.title for state in jobs)
    parts = [f"Interrupted (saved data are safe): {cut}." if cut else ""]
    if restored is not None:
        choice, target = restored
        object_ = f" on {choice.phantom}" if choice.is_virtual else ""
        parts.append(f"Restored: camera {choice.spec}{object_}, target {target}; start the camera to continue.")
    text = " ".join(part for part in parts if part)
    return f"The console was not shut down properly. {text}" if text else ""

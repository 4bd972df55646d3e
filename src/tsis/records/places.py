"""Places of presses: a scan as a target of a store, and what a map of it rests on."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from tsis.calibration.frames import UsableCalibration
from tsis.errors import RecordsError
from tsis.files.json_values import from_json_value
from tsis.mapping.scan import Scan, ScanPress
from tsis.mapping.scan_folder import StoredScan

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from tsis.records.values import StoredPress, TargetRecord

PLACE = "place"  # in the settings of a press, which every export and import of targets keeps
NUMBERS = ("x_mm", "y_mm", "place_sd_mm", "angle_deg", "force_sd")
REFERENCE = "plain"  # role of a press on tissue without lump


def place_settings(numbers: Mapping[str, float | None]) -> dict[str, Any]:
    """The place of a press as a part of its settings; unknown numbers are left out."""
    return {PLACE: {name: value for name in NUMBERS if (value := numbers.get(name)) is not None}}


def placed_presses(record: TargetRecord) -> tuple[StoredPress, ...]:
    """The presses of a target that have a place, in the order of `recorded_scan`."""
    return tuple(press for press in record.presses if PLACE in press.settings)


def press_inputs(presses: Iterable[StoredPress]) -> list[dict[str, Any]]:
    """Frame, force, role and place of each press of a map, by which a later map tells what changed."""
    return [
        {"name": press.name, "sha256": press.frame, "force_n": press.force_n, "role": press.role}
        | {name: value for name, value in press.settings[PLACE].items() if name in NUMBERS}
        for press in presses
    ]


def recorded_scan(record: TargetRecord) -> StoredScan:
    """The scan of a target, of its presses with a place; others are named in ``left_out``.

    Raises
    ------
    RecordsError
        When no press has a place, or several probes pressed.
    InputError
        When a place lies outside its range.
    """
    placed = placed_presses(record)
    if not placed:
        raise RecordsError(
            f"target {record.target.number} must have presses with a place to be mapped; it has none: import a folder "
            "with poses.csv"
        )
    probes = {press.probe for press in placed}
    if len(probes) > 1:
        raise RecordsError(f"a scan must be of one probe; target {record.target.number} has {len(probes)}")
    scan = Scan(
        presses=tuple(_scan_press(record, press) for press in placed),
        name=record.target.name or f"target {record.target.number}",
        left_out=tuple(f"{press.name} has no place." for press in record.presses if PLACE not in press.settings),
    )
    return StoredScan(scan=scan, probe=probes.pop())


def recorded_calibration(record: TargetRecord) -> UsableCalibration | None:
    """The calibration that the presses of a target's scan cite; None where they cite none.

    Raises
    ------
    RecordsError
        When they cite several, or it is damaged.
    CalibrationError
        When it has expired.
    """
    cited = {press.calibration for press in placed_presses(record)} - {None}
    if len(cited) > 1:
        raise RecordsError(f"a scan must be of one calibration; target {record.target.number} has {len(cited)}")
    if not cited:
        return None
    identity = str(cited.pop())
    if (calibration := record.calibrations.get(identity)) is None:
        raise RecordsError(f"the calibration {identity[:12]} must be as it was stored; it is not (tsis records verify)")
    calibration.require_usable(datetime.now(UTC))
    return UsableCalibration(calibration=calibration, identity=identity)


def _scan_press(record: TargetRecord, press: StoredPress) -> ScanPress:
    stored = press.settings[PLACE]
    known = [name for name in NUMBERS if name in stored]
    number: dict[str, Any] = {name: from_json_value(float, stored[name], f"place.{name}") for name in known}
    x, y = number.pop("x_mm"), number.pop("y_mm")
    return ScanPress(
        place_mm=(x, y), frame=record.image(press), reference=press.role == REFERENCE, name=press.name, **number
    )

"""A snapshot in the store of records, beside its files: taken in by the same way as an import takes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.cli.cited_calibration import CitedCalibration
    from tsis.cli.keeping import Destination

ROLES = ("target", "plain", "untouched", "ball")  # those of tsis.records, whose libraries load when one is kept


@dataclass(frozen=True, slots=True, kw_only=True)
class SnapshotDestination:
    """Where a snapshot shall be kept, and as what.

    Attributes
    ----------
    destination
        The store.
    role
        What is pressed.
    probe
        Name of the probe, where no calibration tells it.
    """

    destination: Destination
    role: str
    probe: str = ""


def keep_snapshot(where: SnapshotDestination, sidecar: Path, calibration: CitedCalibration | None) -> dict[str, Any]:
    """Store the snapshot of a sidecar; what a result says of it.

    Raises
    ------
    TsisError
        When it could not be stored.
    """
    from tsis.records.importing import Given, enter
    from tsis.records.importing.snapshots import snapshots

    known = None if calibration is None else calibration.known
    probe = where.probe if known is None or not known.probe else known.probe
    found = snapshots([sidecar], Given(role=where.role, probe=probe, calibration=known), lambda: None)
    with where.destination.opened() as store:
        (entered,) = enter(store, found)
        (press,) = entered.presses
        return {
            "store": str(store.folder.resolve()),
            "target": entered.target.number,
            "press": press.id,
            "notes": list(entered.batch.notes),
        }

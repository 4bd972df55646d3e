"""A snapshot that was just taken goes into a store, beside its files: by the same way as an import takes it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.records.importing.entering import enter
from tsis.records.importing.found import ImportOptions
from tsis.records.importing.snapshots import snapshots

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.calibration.cited import UsableCalibration
    from tsis.records.store import Store


def keep_snapshot(
    store: Store, sidecar: Path, *, role: str, probe: str, calibration: UsableCalibration | None
) -> dict[str, Any]:
    """Store the snapshot of a sidecar; what a result says of it.

    Parameters
    ----------
    store
        Open for writing.
    sidecar
        The file that tells of the snapshot, beside its raw frame.
    role
        What is pressed: one of `tsis.records.values.ROLES`.
    probe
        Name of the probe, where no calibration tells it.
    calibration
        That with which the snapshot was taken; None without one.

    Raises
    ------
    TsisError
        When it could not be stored.
    """
    known = None if calibration is None else calibration.known
    named = probe if known is None or not known.probe else known.probe
    found = snapshots([sidecar], ImportOptions(role=role, probe=named, calibration=known), lambda: None)
    (entered,) = enter(store, found)
    (press,) = entered.presses
    return {
        "store": str(store.folder.resolve()),
        "target": entered.target.number,
        "press": press.id,
        "notes": list(entered.batch.notes),
    }

"""Where ``tsis acquire --keep`` keeps a snapshot, beside its files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.calibration.cited import UsableCalibration
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

    def keep(self, sidecar: Path, calibration: UsableCalibration | None) -> dict[str, Any]:
        """Store the snapshot of a sidecar; what a result says of it; `TsisError` when it could not be stored."""
        from tsis.records.importing.one_snapshot import keep_snapshot  # loads the libraries of records

        with self.destination.opened() as store:
            return keep_snapshot(store, sidecar, role=self.role, probe=self.probe, calibration=calibration)

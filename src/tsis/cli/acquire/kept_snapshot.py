"""A snapshot in the store of records, beside its files."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from tsis.cli.keeping import Keeping, numbered_target

if TYPE_CHECKING:
    from datetime import datetime
    from pathlib import Path

    from tsis.cli.cited_calibration import CitedCalibration
    from tsis.instrument import Frame
    from tsis.model import TactileImage

ROLES = ("target", "plain", "untouched", "ball")  # those of tsis.records, whose libraries load when one is kept


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptSnapshot:
    """Where a snapshot is kept, and as what.

    Attributes
    ----------
    keeping
        The store.
    role
        What is pressed.
    probe
        Name of the probe, where no calibration tells it.
    """

    keeping: Keeping
    role: str
    probe: str = ""


def keep_snapshot(
    kept: KeptSnapshot,
    image: TactileImage,
    raw: Path,
    frame: Frame,
    target: int,
    when: datetime,
    flags: tuple[str, ...],
    calibration: CitedCalibration | None,
) -> dict[str, Any]:
    """Store a snapshot as its import would, so that an import finds it there; what a result says of it."""
    known = None if calibration is None else calibration.known
    settings = {
        **image.settings,
        "camera": frame.name,
        "sequence": frame.sequence,
        "time_s": frame.time_s,
        "file": raw.name,
        "sha256": hashlib.sha256(raw.read_bytes()).hexdigest(),
    }
    with kept.keeping.opened() as store:
        press = store.add_press(
            numbered_target(store, target),
            replace(image, name=raw.name, settings=settings),
            role=kept.role,
            taken=when.replace(microsecond=when.microsecond // 1000 * 1000),  # as its sidecar has it
            probe=kept.probe if known is None or not known.probe else known.probe,
            calibration=known,
            flags=flags,
        )
        return {"store": str(store.folder.resolve()), "target": target, "press": press.id}

"""How a target and an estimate are entered by whoever brings both: an import, and a command with ``--keep``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.records.environment import environment
from tsis.records.frame_file import frame_bytes

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from tsis.calibration import ProbeCalibration
    from tsis.model import Estimate, TactileImage
    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, StoredPress, Target


def new_target(
    store: Store,
    first: Iterable[TactileImage],
    *,
    number: int | None = None,
    name: str = "",
    truth: Mapping[str, float] | None = None,
) -> Target:
    """Enter a target once its first frames lie on the disk, so that a full one leaves no target without a press."""
    for image in first:
        store.blobs.put(frame_bytes(image), "png")
    return store.add_target(number=number, name=name, truth=truth)


def enter_estimate(
    store: Store,
    target: Target,
    estimate: Estimate,
    *,
    kind: str,
    presses: Sequence[StoredPress],
    probe: str,
    calibration: ProbeCalibration,
    options: Mapping[str, Any],
) -> StoredEstimate:
    """Store an estimate that was made here and now; it rests on all presses but those of the untouched probe."""
    return store.add_estimate(
        target,
        estimate,
        kind=kind,
        presses=used(presses),
        probe=probe,
        calibration=calibration,
        options=options,
        environment=environment(),
    )


def used(presses: Iterable[StoredPress]) -> tuple[StoredPress, ...]:
    """Those that an estimate takes."""
    return tuple(press for press in presses if press.role != "untouched")

"""Snapshots, and where ``tsis acquire --save`` stores them."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

import tsis
from tsis.cli._force_gauge import force_then
from tsis.cli._output import print_json
from tsis.cli._saving import stop_not_saved
from tsis.errors import CameraError, TsisError
from tsis.present.terminal import people, print_notice

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from tsis.calibration.frames import UsableCalibration
    from tsis.calibration.guard.limits import GuardFlag
    from tsis.cli._saving import Destination
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame
    from tsis.instrument.camera import Frame
    from tsis.instrument.force_log import ForceLog
    from tsis.instrument.snapshot import Snapshot


ROLES = ("target", "plain", "untouched", "ball")  # as in tsis.records, which is imported only for --save


@dataclass(frozen=True, slots=True, kw_only=True)
class SnapshotDestination:
    """Store and role of a snapshot.

    Attributes
    ----------
    destination
        The store.
    role
        What is pressed.
    probe
        Name of the probe, where no calibration gives it.
    """

    destination: Destination
    role: str
    probe: str = ""

    def save(self, sidecar: Path, calibration: UsableCalibration | None) -> dict[str, Any]:
        """Store the snapshot of a sidecar and return the entry for the result; `TsisError` when it fails."""
        from tsis.records.importing import save_snapshot_to_store  # loads the libraries of records

        with self.destination.opened() as store:
            return save_snapshot_to_store(store, sidecar, role=self.role, probe=self.probe, calibration=calibration)


FRAME_S = 10.0  # longest wait for a frame


def take_snapshot(
    acquisition: Acquisition,
    folder: Path,
    *,
    target: int,
    picture: str,
    map_name: str,
    calibration: UsableCalibration | None,
    log: ForceLog | None,
    role: str,
    probe: str,
    where: SnapshotDestination | None = None,
    as_json: bool,
) -> None:
    """Save the next frame, and print where; ``probe`` is empty where no calibration and no virtual probe names it."""
    received = _next(acquisition)
    force = None if log is None else force_then(log, received.arrived_s)
    image = received.frame.tactile_image(force_n=None if force is None else max(0.0, force.force_n))
    flags = tsis.calibration.guard.watch.check_press(
        tsis.calibration.guard.watch.with_calibrated_scale(image, calibration),
        reference=tsis.calibration.guard.watch.guard_reference(calibration),
    )
    about: dict[str, Any] = {
        "camera": acquisition.name,
        "calibration": None if calibration is None else calibration.citation(),
        "force": None if force is None else asdict(force),
        "flags": [asdict(flag) for flag in flags],
    }

    when = datetime.now().astimezone()

    def coloured(frame: Frame) -> NDArray[np.uint8]:
        return tsis.imaging.colour.colour_map(frame.tactile_image(), name=map_name)

    saved = tsis.instrument.snapshot.save_snapshot(
        received.frame,
        folder,
        target=target,
        when=when,
        colour=coloured,
        picture=picture,
        about={**about, "role": role, "probe": probe or None},
    )
    failure = None
    if where is not None:
        try:
            about["saved"] = where.save(saved.sidecar, calibration)
        except TsisError as error:  # the files stay
            failure = error
    _print(saved, received, flags, about, as_json=as_json)
    if failure is not None:
        stop_not_saved(failure, str(saved.sidecar.parent.resolve()))


def _print(
    saved: Snapshot, received: ReceivedFrame, flags: Sequence[GuardFlag], about: dict[str, Any], *, as_json: bool
) -> None:
    files = {name: str(path.resolve()) for name, path in asdict(saved).items()}
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "acquire", "snapshot", files=files, sequence=received.frame.sequence, **about
            )
        )
        return
    console = people()
    for name, file in files.items():
        console.print(f"{name}: {file}", markup=False, soft_wrap=True)
    if about["force"] is not None:
        console.print(f"force: {about['force']['force_n']:.3f} N within {about['force']['error_n']:.3f} N")
    for flag in flags:
        console.print(f"- {flag.name}: {flag.advice}", markup=False, soft_wrap=True)
    if "saved" in about:
        from tsis.records.importing import saved_notes  # loads the libraries of records

        for note in saved_notes(about["saved"]):
            console.print(note, markup=False, soft_wrap=True)
    print_notice(console)


def _next(acquisition: Acquisition) -> ReceivedFrame:
    """The newest frame of a camera, or the first stored frame."""
    if not acquisition.ring.wait(0, FRAME_S):
        why = f": {acquisition.failure}" if acquisition.failure is not None else ""
        raise CameraError(f"{acquisition.name} must deliver a frame within {FRAME_S:g} s; got none{why}")
    waiting, _, _ = acquisition.ring.read(0)
    return waiting[0] if acquisition.ring.patient else waiting[-1]

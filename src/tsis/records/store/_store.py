"""The store: what was measured, kept so that nothing that was acknowledged is ever lost.

A press is written frame, sync, rename, sync of the folder, row, and only then acknowledged: by returning. Who loses
power before that has lost what nobody was told was kept; who loses it after has lost nothing.
"""

from __future__ import annotations

import threading
import uuid
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Self, TypeVar

from tsis.calibration.file import ProbeCalibration, calibration_bytes, calibration_sha256
from tsis.errors import InputError
from tsis.files import DISK, Disk, from_json_value, to_json_value
from tsis.model import TactileImage, require_type
from tsis.records._values import StoredEstimate, StoredPress, Target, entered, require_label, require_moment
from tsis.records.store import _rows as rows
from tsis.records.store import _tables as tables
from tsis.records.store._audit import (
    BEFORE,
    AuditChange,
    append_audit,
    locked_head,
    lost_after,
    require_anchored,
    write_anchor,
)
from tsis.records.store._editing import insert_row, insert_row_once, press_edit, require_row, target_edit
from tsis.records.store._files import Blobs, frame_bytes, samples_bytes
from tsis.records.store._reader import StoreReader
from tsis.records.store._secret import derived, entered_secret, read_secret
from tsis.records.store._transfer import (
    ImportedTarget,
    TargetImport,
    is_taken,
    next_number,
    require_kind,
    stored_frames,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path

    from sqlalchemy import Connection

    from tsis.model import Estimate
    from tsis.records._target_record import TargetRecord
    from tsis.records.store._database import Database


FILES = "files"
Kept = TypeVar("Kept")


class Store(StoreReader):
    """Targets with their presses, calibrations and estimates; made by `tsis.records.store.open_store`.

    Parameters
    ----------
    folder, database
        Where files and rows lie.
    identity, kind
        Of the store: its own, and ``"phantom"`` or ``"subject"``.
    actor
        Who works, for the audit.
    disk
        By which steps files get onto the disk.
    """

    def __init__(
        self, folder: Path, database: Database, *, identity: str, kind: str, actor: str, disk: Disk = DISK
    ) -> None:
        blobs = Blobs(folder / FILES, disk=disk, allowed=database.require_there)
        super().__init__(folder, database, blobs, identity=identity, kind=kind)
        require_label("actor", actor)
        self.actor = actor
        self._disk = disk
        self._write_lock = threading.Lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the database."""
        self.database.close()

    # What is stored

    def record(self, target: Target, *, limit: int | None = None, offset: int = 0) -> TargetRecord:
        """All that is stored of a target; a store that was begun without a secret gets it here, once."""
        with self.database.reading() as connection:
            secret = read_secret(connection)
        if secret is None:
            secret = self._write(entered_secret)
        return replace(super().record(target, limit=limit, offset=offset), secret=derived(secret, "target", target.id))

    def add_target(
        self, *, number: int | None = None, name: str = "", note: str = "", truth: Mapping[str, float] | None = None
    ) -> Target:
        """Enter a target; ``number`` is the next free one by default.

        Raises
        ------
        InputError
            When the number is taken, there is no next one, or a value is not accepted, as of `Target` and `entered`.
        RecordsError
            When it cannot be stored.
        """
        requested = Target(
            number=1 if number is None else number,
            kind=self.kind,
            name=name,
            note=note,
            truth=truth or {},
            made=datetime.now(UTC),
            id=uuid.uuid4().hex,
        )

        def enter(connection: Connection) -> tuple[Target, list[AuditChange]]:
            if number is not None and is_taken(connection, number):
                raise InputError(f"number must be that of no target of this store; {number} is taken")
            target = replace(requested, number=next_number(connection)) if number is None else requested
            return target, [insert_row(connection, tables.target_table, rows.target_row(entered(target)))]

        return self._write(enter)

    def add_press(
        self,
        target: Target,
        image: TactileImage,
        *,
        role: str = "target",
        taken: datetime,
        probe: str = "",
        calibration: ProbeCalibration | None = None,
        flags: tuple[str, ...] = (),
        note: str = "",
    ) -> StoredPress:
        """Keep a frame and what is known of it; when this returns, no loss of power takes it away.

        Parameters
        ----------
        target
            What was pressed.
        image
            The frame as the camera gave it: whole grey levels.
        role, taken, probe, flags, note
            As of `StoredPress`.
        calibration
            What was in force; kept with it.

        Raises
        ------
        InputError
            When grey levels are not whole numbers, or a value lies outside what `StoredPress` accepts.
        RecordsError
            When it cannot be stored; what was stored before is as it was.
        """
        require_type("target", target, Target)
        require_type("image", image, TactileImage)
        if calibration is not None:
            require_type("calibration", calibration, ProbeCalibration)
        require_moment("taken", taken)
        content = frame_bytes(image)
        shape = image.grey.shape
        press = StoredPress(
            role=role,
            taken=taken.astimezone(UTC),
            frame=self.blobs.put(content, "png"),
            rows=shape[0],
            columns=shape[1],
            full_scale=image.full_scale,
            force_n=image.force_n,
            mm_per_pixel=image.mm_per_pixel,
            axis_px=image.axis(),
            probe=probe,
            calibration=None if calibration is None else calibration_sha256(calibration),
            flags=flags,
            settings=image.settings,
            name=image.name,
            note=note,
            id=uuid.uuid4().hex,
            target=target.id,
        )
        # The value as a reader will get it: settings as lists, not as tuples.
        press = from_json_value(StoredPress, to_json_value(press), "press", complete=True)
        stored = None if calibration is None else self._calibration_row(calibration)
        frame = {"id": press.frame, "rows": shape[0], "columns": shape[1], "bytes": len(content)}

        def enter(connection: Connection) -> tuple[StoredPress, list[AuditChange]]:
            require_row(connection, tables.target_table, target.id, "target")
            return press, [
                *insert_row_once(connection, tables.calibration_table, stored),
                *insert_row_once(connection, tables.frame_table, frame),
                insert_row(connection, tables.press_table, rows.press_row(press)),
            ]

        return self._write(enter)

    def add_estimate(
        self,
        target: Target,
        estimate: Estimate,
        *,
        kind: str,
        presses: Iterable[StoredPress],
        probe: str,
        calibration: ProbeCalibration,
        options: Mapping[str, Any] | None = None,
        environment: Mapping[str, Any] | None = None,
        supersedes: StoredEstimate | None = None,
    ) -> StoredEstimate:
        """Keep an estimate with all that is needed to make it again; parameters as of `StoredEstimate`.

        Raises
        ------
        InputError
            When a value lies outside what `StoredEstimate` accepts.
        RecordsError
            When a press is none of this target, or it cannot be stored.
        """
        stored = StoredEstimate(
            kind=kind,
            estimate=estimate,
            made=datetime.now(UTC),
            probe=probe,
            presses=tuple(press.id for press in presses),
            calibration=calibration_sha256(calibration),
            options=options or {},
            environment=environment or {},
            supersedes=None if supersedes is None else supersedes.id,
            id=uuid.uuid4().hex,
            target=target.id,
        )
        held = self._calibration_row(calibration)
        row = rows.estimate_row(stored, self.blobs.put(samples_bytes(estimate), "samples"))

        def enter(connection: Connection) -> tuple[StoredEstimate, list[AuditChange]]:
            require_row(connection, tables.target_table, target.id, "target")
            for press in stored.presses:
                require_row(connection, tables.press_table, press, "press", target=target.id)
            changes = insert_row_once(connection, tables.calibration_table, held)
            return stored, [*changes, insert_row(connection, tables.estimate_table, row)]

        return self._write(enter)

    def take_in(self, record: TargetRecord, *, progress: Callable[[int, int], None] | None = None) -> ImportedTarget:
        """Enter a target of another store with its presses, estimates and calibrations, all of it or nothing.

        Parameters
        ----------
        record
            As `tsis.records.export.bundle.read_bundle` gives it.
        progress
            Told (done, all) of the frames.

        Raises
        ------
        RecordsError
            When it is of the other kind, an identity in it is that of something else here, or it cannot be stored.
        """
        require_kind(record.target, self.kind)
        with self.database.reading() as connection:
            stored = stored_frames(connection, record.presses)
        return self._write(TargetImport(record, self.blobs, stored, progress).enter)

    def _calibration_row(self, calibration: ProbeCalibration) -> rows.Row:
        return rows.calibration_row(calibration, self.blobs.put(calibration_bytes(calibration), "json"))

    # What is changed: the old version stays in the audit as a digest, the new one takes its place

    def edit_target(self, target: Target, **changes: Any) -> Target:
        """Change ``name``, ``note`` or ``truth`` of a target as it was read.

        Raises
        ------
        StaleRecordError
            When somebody else has changed it since it was read.
        InputError
            When a value is not accepted or may not be changed, or nothing is.
        RecordsError
            When it was changed behind the program's back.
        """
        return self._write(target_edit(target, changes))

    def edit_press(self, press: StoredPress, **changes: Any) -> StoredPress:
        """Change ``role``, ``force_n``, ``flags`` or ``note`` of a press as it was read; errors as `edit_target`."""
        return self._write(press_edit(press, changes))

    def _write(self, enter: Callable[[Connection], tuple[Kept, list[AuditChange]]]) -> Kept:
        """Run one transaction that enters rows and their audit; when this returns, it lasts."""
        with self._write_lock:
            with self.database.writing() as connection:
                head = locked_head(connection)
                lost = not require_anchored(connection, self.folder) and head != BEFORE
                saved, changes = enter(connection)
                changes = [lost_after(head), *changes] if lost else changes
                head = append_audit(connection, head, changes, actor=self.actor)
            # The record lasts by now, and who were told that it failed would store it twice: an anchor that cannot be
            # written lags behind until the next one, and `verify` tells by how much.
            with suppress(OSError):
                write_anchor(self.folder, self.identity, head, disk=self._disk)
        return saved

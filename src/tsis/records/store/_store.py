"""The store: durable storage of targets, presses, calibrations and estimates.

A press is saved in the order frame, sync, rename, sync of the folder, row. The call returns only then, so a loss of
power never loses a press whose saving was confirmed.
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
from tsis.records import schema as tables
from tsis.records._values import StoredEstimate, StoredPress, Target, require_label, require_moment, validated_entries
from tsis.records.store import _rows as rows
from tsis.records.store._audit import (
    BEFORE,
    AuditChange,
    append_audit,
    locked_head,
    lost_after,
    require_anchored,
    write_anchor,
)
from tsis.records.store._database import derived, read_secret
from tsis.records.store._editing import insert_row, insert_row_once, press_edit, require_row, target_edit
from tsis.records.store._files import Blobs, frame_bytes, samples_bytes
from tsis.records.store._reader import DELETED, StoreReader, TargetState, read_states
from tsis.records.store._removal import erase_expired, require_present, state_edit
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
Value = TypeVar("Value")


class Store(StoreReader):
    """Targets with their presses, calibrations and estimates; see `tsis.records.store.open_store`.

    ``folder`` has the files and ``database`` the rows; ``identity`` and ``kind``, ``"phantom"`` or ``"subject"``, are
    those of the store; ``actor`` is the user, for the audit.
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
        """Close the database."""
        self.database.close()

    # What is stored

    def record(self, target: Target, *, limit: int | None = None, offset: int = 0) -> TargetRecord:
        """All data of a target."""
        with self.database.reading() as connection:
            secret = read_secret(connection)
        return replace(super().record(target, limit=limit, offset=offset), secret=derived(secret, "target", target.id))

    def add_target(
        self, *, number: int | None = None, name: str = "", note: str = "", truth: Mapping[str, float] | None = None
    ) -> Target:
        """Enter a target; ``number`` is the next free one by default.

        Raises
        ------
        InputError
            When the number is taken, no number is left, or a value is invalid.
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
            return target, [insert_row(connection, tables.target_table, rows.target_row(validated_entries(target)))]

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
        """Save a frame with its metadata; when this returns, it survives a loss of power.

        The grey levels of the image must be whole. The active calibration is saved too; other parameters as in
        `StoredPress`.

        Raises
        ------
        InputError
            When grey levels are not whole numbers, or `StoredPress` refuses a value.
        RecordsError
            When it cannot be stored; earlier data stay intact.
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
            require_present(connection, target)
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
        """Save an estimate with everything needed to repeat it; parameters as in `StoredEstimate`.

        Raises
        ------
        InputError
            When `StoredEstimate` refuses a value.
        RecordsError
            When a press is not of this target, or the estimate cannot be stored.
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
        calibration_row = self._calibration_row(calibration)
        row = rows.estimate_row(stored, self.blobs.put(samples_bytes(estimate), "samples"))

        def enter(connection: Connection) -> tuple[StoredEstimate, list[AuditChange]]:
            require_present(connection, target)
            for press in stored.presses:
                require_row(connection, tables.press_table, press, "press", target=target.id)
            changes = insert_row_once(connection, tables.calibration_table, calibration_row)
            return stored, [*changes, insert_row(connection, tables.estimate_table, row)]

        return self._write(enter)

    def import_target(
        self, record: TargetRecord, *, progress: Callable[[int, int], None] | None = None
    ) -> ImportedTarget:
        """Import a target of another store with its presses, estimates and calibrations: all or nothing.

        ``progress`` is called with (done, all) frames.

        Raises
        ------
        RecordsError
            When the kind differs, an identity is taken by another row, or the record cannot be stored.
        """
        require_kind(record.target, self.kind)
        with self.database.reading() as connection:
            stored = stored_frames(connection, record.presses)
        return self._write(TargetImport(record, self.blobs, stored, progress).enter)

    def _calibration_row(self, calibration: ProbeCalibration) -> rows.Row:
        return rows.calibration_row(calibration, self.blobs.put(calibration_bytes(calibration), "json"))

    # Edits: the digest of the old version stays in the audit

    def edit_target(self, target: Target, **changes: Any) -> Target:
        """Change ``name``, ``note`` or ``truth`` of a target that was read before.

        Raises
        ------
        StaleRecordError
            When another user has changed it since.
        InputError
            When a value is invalid or cannot be changed, or there is no change.
        RecordsError
            When the stored row was changed outside this program.
        """
        return self._write(target_edit(target, changes))

    def edit_press(self, press: StoredPress, **changes: Any) -> StoredPress:
        """Change ``role``, ``force_n``, ``flags`` or ``note`` of a press; errors as `edit_target`."""
        return self._write(press_edit(press, changes))

    # Removal: hidden first, and for good only after some weeks

    def set_state(self, target: Target, state: str) -> TargetState | None:
        """Archive (``"archived"``), delete (``"deleted"``) or restore (``""``) a target; nothing of it is lost.

        `RecordsError` when it is not stored.
        """
        return self._write(state_edit(target, state))

    def erase_expired(self, *, now: datetime | None = None) -> int:
        """Remove what was deleted more than `UNDO_DAYS` days ago, and return how many targets.

        Rows and files go; number, time and count of presses stay, and the audit has an entry for each removed row.
        """
        now = now or datetime.now(UTC)
        with self.database.reading() as connection:
            if not any(state.name == DELETED for state in read_states(connection).values()):
                return 0
        count, files = self._write(erase_expired(now))
        for name, ending in files:
            self.blobs.remove(name, ending)
        return count

    def _write(self, enter: Callable[[Connection], tuple[Value, list[AuditChange]]]) -> Value:
        """Commit one transaction of rows and their audit entries."""
        with self._write_lock:
            with self.database.writing() as connection:
                head = locked_head(connection)
                lost = not require_anchored(connection, self.folder) and head != BEFORE
                saved, changes = enter(connection)
                changes = [lost_after(head), *changes] if lost else changes
                head = append_audit(connection, head, changes, actor=self.actor)
            # The rows are committed: an error here would make users save them twice. The anchor lags until the next
            # write, and `verify` reports by how much.
            with suppress(OSError):
                write_anchor(self.folder, self.identity, head, disk=self._disk)
        return saved

"""Import of snapshots of ``tsis acquire`` and the console: the raw frame and its sidecar."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING, Any

from tsis.__about__ import LARGEST_TARGET
from tsis.errors import FileInputError, InputError
from tsis.files import file_error, from_json_value, own_file, printable_name, printable_path, read_object, written_by
from tsis.instrument import RAW_ENDINGS, SIDECAR_FORMAT, SIDECAR_VERSION
from tsis.model import require_integer, require_one_of
from tsis.records._values import ROLES
from tsis.records.importing._batch import (
    MOST_FRAMES,
    ImportBatch,
    ImportOptions,
    IncomingPress,
    cited_calibration,
    inspect_file,
)
from tsis.records.importing._importing import import_batches

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from tsis.calibration import UsableCalibration
    from tsis.records.store import Store


def sidecar_of(path: Path) -> Path | None:
    """The sidecar of a snapshot, from the sidecar itself or one of its images; None for other files."""
    if path.suffix == ".json":
        return path
    beside = path.with_name(f"{path.stem.removesuffix('-raw')}.json")
    try:
        return beside if read_object(beside).get("format") == SIDECAR_FORMAT else None
    except FileInputError:
        return None


def snapshot_folder(folder: Path, given: ImportOptions, progress: Callable[[], None]) -> tuple[ImportBatch, ...]:
    """Snapshots in a folder and in the folders of targets in it."""
    try:
        inside = sorted(path for path in folder.iterdir() if path.is_dir() and not path.is_symlink())
        sidecars = [path for position in (folder, *inside) for path in sorted(position.glob("*.json"))]
    except OSError as error:
        raise file_error(folder, f"must be a folder that can be read; got: {error.strerror}") from error
    if len(sidecars) > MOST_FRAMES:
        raise file_error(folder, f"must hold at most {MOST_FRAMES} snapshots; it holds {len(sidecars)}")
    unfinished = [path for path in sidecars if not path.is_symlink() and path.stat().st_size == 0]
    result = snapshots([path for path in sidecars if path not in unfinished], given, progress, single=False)
    if not result or not unfinished:
        return result
    note = (
        f"{len(unfinished)} snapshots in {printable_path(folder)} were cut short while they were saved and are left out"
    )
    return (*result[:-1], replace(result[-1], notes=(*result[-1].notes, note)))


def snapshots(
    sidecars: Iterable[Path], given: ImportOptions, progress: Callable[[], None], *, single: bool = True
) -> tuple[ImportBatch, ...]:
    """A batch for each target that these sidecars name; with ``single`` other JSON files are an error.

    `FileInputError` when a sidecar is damaged, or its frame differs from its hash.
    """
    targets: dict[int, list[IncomingPress]] = {}
    notes: dict[int, dict[str, None]] = {}
    first: dict[int, Path] = {}
    for sidecar in sidecars:
        document = read_object(own_file(sidecar.parent, sidecar.name))
        if document.get("format") != SIDECAR_FORMAT:
            if not single:
                continue
            raise file_error(
                sidecar, f"must be the sidecar of a snapshot ({SIDECAR_FORMAT}); got {document.get('format')!r:.60}"
            )
        with written_by("tsis acquire", sidecar):
            target, press, message = _snapshot(sidecar, document, given)
        targets.setdefault(target, []).append(press)
        notes.setdefault(target, {}).update(dict.fromkeys(message))
        first.setdefault(target, sidecar.parent)
        progress()
    return tuple(
        ImportBatch(
            source=first[target], kind="snapshots", presses=tuple(item), number=target, notes=tuple(notes[target])
        )
        for target, item in targets.items()
    )


def _snapshot(
    sidecar: Path, document: dict[str, Any], given: ImportOptions
) -> tuple[int, IncomingPress, tuple[str, ...]]:
    if document["version"] != SIDECAR_VERSION:
        raise InputError(f"version must be {SIDECAR_VERSION}; got {document['version']!r:.20}")
    target = require_integer("target", document["target"], 1, LARGEST_TARGET)
    hashes: dict[str, Any] = document["sha256"]
    ending = next((item for item in RAW_ENDINGS if item in hashes), None)
    if ending is None:
        raise InputError(f"sha256 must tell of a raw frame; got {sorted(hashes)!r:.80}")
    raw = own_file(sidecar.parent, f"{sidecar.stem}{ending}")
    read = inspect_file(raw, full_scale=from_json_value(float, document["full_scale"], "snapshot.full_scale"))
    if read["sha256"] != hashes[ending]:
        raise file_error(raw, "must be as it was saved; its content does not match its sidecar")
    known, notes = cited_calibration(sidecar, document.get("calibration"), given)
    scale = given.mm_per_pixel if known is None or known.scale is None else known.scale.mm_per_pixel
    settings: dict[str, Any] = {
        name: document[name] for name in ("camera", "sequence", "time_s", "calibration") if name in document
    }
    press = IncomingPress(
        **read,
        role=given.role if document.get("role") is None else require_one_of("role", document["role"], ROLES),
        taken=from_json_value(datetime, document["taken"], "snapshot.taken"),
        name=printable_name(raw),
        force_n=_force_n(document.get("force")),
        mm_per_pixel=scale,
        probe=given.probe or ("" if known is None else known.probe) or _probe(document),
        calibration=known,
        flags=tuple(from_json_value(str, flag["name"], "flag.name") for flag in document.get("flags") or ()),
        settings=dict(document["settings"]) | settings,
    )
    return target, press, notes


def _probe(document: dict[str, Any]) -> str:
    return "" if document.get("probe") is None else from_json_value(str, document["probe"], "snapshot.probe")


def _force_n(force: Any) -> float | None:
    """The force of the gauge, at least 0: a press does not pull."""
    return None if force is None else max(0.0, from_json_value(float, force["force_n"], "force.force_n"))


def save_snapshot_to_store(
    store: Store, sidecar: Path, *, role: str, probe: str, calibration: UsableCalibration | None
) -> dict[str, Any]:
    """Store the snapshot of a sidecar; return store, target, press and notes for the result document.

    The raw frame lies beside the sidecar. ``role`` is one of `tsis.records.ROLES`; ``probe`` is used where the
    calibration names none.

    Raises
    ------
    TsisError
        When it cannot be stored.
    """
    active = None if calibration is None else calibration.calibration
    name = probe if active is None or not active.probe else active.probe
    batches = snapshots([sidecar], ImportOptions(role=role, probe=name, calibration=active), lambda: None)
    (imported,) = import_batches(store, batches)
    (press,) = imported.presses
    return {
        "store": str(store.folder.resolve()),
        "target": imported.target.number,
        "press": press.id,
        "notes": list(imported.batch.notes),
    }

"""Import of what ``tsis acquire`` and the console write: snapshots with sidecars, and recordings with an index."""

from __future__ import annotations

import csv
from dataclasses import replace
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from tsis.__about__ import LARGEST_TARGET
from tsis.errors import FileInputError, InputError
from tsis.files import (
    file_error,
    from_json_value,
    own_file,
    printable_name,
    printable_path,
    read_bytes,
    read_object,
    written_by,
)
from tsis.instrument import RAW_ENDINGS, SIDECAR_FORMAT, SIDECAR_VERSION
from tsis.instrument.recording import (
    RECORDING_COLUMNS,
    RECORDING_FORMAT,
    RECORDING_INDEX,
    RECORDING_SUMMARY,
    RECORDING_VERSION,
    VIDEO_NAME,
)
from tsis.model import require_integer, require_one_of
from tsis.records._values import ROLES, require_moment
from tsis.records.importing._batch import (
    MOST_FRAMES,
    ImportBatch,
    ImportOptions,
    IncomingPress,
    cited_calibration,
    inspect_file,
    modification_time,
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


LARGEST_INDEX_BYTES = 64 * 2**20
FORCE = "force_n"
CUT_SHORT = "the recording was cut short before its report was written; its frames are all that its index tells of"


def recording(folder: Path, given: ImportOptions, progress: Callable[[], None]) -> ImportBatch:
    """The frames of a recording, with the force of a gauge.

    A recording has its start time and the delay of each frame. Without the start time, in an interrupted recording or
    one of an old release, the modification time of the index is that of the last frame.

    `FileInputError` when it is no such folder, is a video, or its index does not fit its frames.
    """
    summary = _summary(folder)
    rows = _rows(own_file(folder, RECORDING_INDEX))
    saved = None if summary is None else summary["report"]["kept"]
    if saved is not None and saved != len(rows):
        raise file_error(
            folder / RECORDING_INDEX, f"must tell of the {saved!r:.20} frames of the report; it tells of {len(rows)}"
        )
    known, notes = cited_calibration(folder / RECORDING_SUMMARY, (summary or {}).get("calibration"), given)
    scale = given.mm_per_pixel if known is None or known.scale is None else known.scale.mm_per_pixel
    camera = str((summary or {}).get("camera", ""))[:200]
    moment_then, then_s = _clock(folder, summary, last_s=float(rows[-1]["arrived_s"]))
    presses = []
    for row in rows:
        path = own_file(folder, row["kept_in"])
        presses.append(
            IncomingPress(
                **inspect_file(path, full_scale=_full_scale(summary)),
                role=given.role,
                taken=_moment(moment_then, float(row["arrived_s"]) - then_s),
                name=path.name,
                force_n=max(0.0, float(row[FORCE])) if row.get(FORCE) else None,
                mm_per_pixel=scale,
                probe=given.probe or ("" if known is None else known.probe),
                calibration=known,
                settings={"camera": camera, "sequence": row["sequence"], "time_s": row["time_s"]},
            )
        )
        progress()
    notes = notes if summary is not None else (*notes, CUT_SHORT)
    return ImportBatch(source=folder, kind="recording", presses=tuple(presses), notes=notes)


def _summary(folder: Path) -> dict[str, Any] | None:
    source = own_file(folder, RECORDING_SUMMARY)
    if not source.exists():
        return None
    document = read_object(source)
    if document.get("format") != RECORDING_FORMAT or document.get("version") != RECORDING_VERSION:
        raise file_error(
            source,
            f"must be of {RECORDING_FORMAT} {RECORDING_VERSION}; got "
            f"{document.get('format')!r:.60} "
            f"{document.get('version')!r:.20}",
        )
    if not isinstance(document.get("report"), dict) or "kept" not in document["report"]:
        raise file_error(source, "must hold a report with the number of frames; it does not")
    return document


def _rows(path: Path) -> list[dict[str, str]]:
    try:
        lines = read_bytes(path, most=LARGEST_INDEX_BYTES).decode().splitlines()
        if len(lines) > MOST_FRAMES + 1:
            raise file_error(path, f"must tell of at most {MOST_FRAMES} frames; it has {len(lines)} lines")
        reader = csv.DictReader(lines, strict=True)
        rows = list(reader)
    except (UnicodeDecodeError, csv.Error) as error:
        raise file_error(path, f"must be a table of comma-separated values; got: {error}") from error
    if not rows or not set(RECORDING_COLUMNS) <= set(reader.fieldnames or ()):
        raise file_error(path, f"must have the columns {', '.join(RECORDING_COLUMNS)} and a frame; it has not")
    for at, row in enumerate(rows, start=2):
        _require_sound(path, at, row)
    if len({row["kept_in"] for row in rows}) < len(rows):
        raise file_error(path, "must name every frame once; it names one twice")
    return rows


def _require_sound(path: Path, at: int, row: dict[str, Any]) -> None:
    if None in row or None in row.values():
        raise file_error(path, f"must have one value a column; line {at} has more or fewer")
    if row["kept_in"].startswith(f"{VIDEO_NAME}#"):
        raise file_error(
            path.parent,
            "must be a recording of single frames; it is a video, of which a "
            "store keeps none "
            "(record without --video, or save the frames that you want as PNG files)",
        )
    for name in ("arrived_s", FORCE):
        if name == "arrived_s" or row.get(name):
            try:
                from_json_value(float, float(row[name]), name)
            except ValueError as error:
                raise file_error(path, f"must hold a finite {name}; line {at} has {row[name]!r:.40}") from error


def _full_scale(summary: dict[str, Any] | None) -> float | None:
    mode = (summary or {}).get("mode")
    if not isinstance(mode, dict) or "full_scale" not in mode:
        return None
    return from_json_value(float, mode["full_scale"], "mode.full_scale")


def _clock(folder: Path, summary: dict[str, Any] | None, *, last_s: float) -> tuple[datetime, float]:
    """A time of day, and ``arrived_s`` at that time."""
    if summary is None or "begun" not in summary:
        return modification_time(folder / RECORDING_INDEX), last_s
    try:
        begun = from_json_value(datetime, summary["begun"], f"{RECORDING_SUMMARY}.begun")
        require_moment("begun", begun)
        return begun, from_json_value(float, summary["begun_s"], f"{RECORDING_SUMMARY}.begun_s")
    except (ValueError, KeyError) as error:
        raise file_error(folder / RECORDING_SUMMARY, f"must tell when it began; {error}") from error


def _moment(then: datetime, after_s: float) -> datetime:
    try:
        return then + timedelta(seconds=after_s)
    except OverflowError as error:
        raise FileInputError(
            f"times of a recording must lie within it; got one {abs(after_s):g} s away from it"
        ) from error

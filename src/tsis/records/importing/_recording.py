"""Import of recordings of ``tsis acquire --frames`` or ``--seconds``: the frames that the index lists."""

from __future__ import annotations

import csv
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from tsis.errors import FileInputError
from tsis.files import file_error, from_json_value, own_file, read_bytes, read_object
from tsis.instrument.recording import (
    RECORDING_COLUMNS,
    RECORDING_FORMAT,
    RECORDING_INDEX,
    RECORDING_SUMMARY,
    RECORDING_VERSION,
    VIDEO_NAME,
)
from tsis.records._values import require_moment
from tsis.records.importing._batch import (
    MOST_FRAMES,
    ImportBatch,
    ImportOptions,
    IncomingPress,
    cited_calibration,
    inspect_file,
    modification_time,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


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

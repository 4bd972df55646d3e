"""Any folder of frames as a session folder: which frame was pressed by which force, guessed from tables and names.

A session folder has ``presses.csv`` beside its frames, which `tsis.calibration.frames.load_frames` reads.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from tsis.calibration.frames import (
    MOST_FRAMES,
    PICTURES,
    PRESS_COLUMNS,
    PRESSES_FILE,
    REFERENCE,
    TARGET,
    UNTOUCHED,
)
from tsis.files.atomic import write_durably
from tsis.files.reading import as_path, file_error, printable_path, read_bytes, read_object
from tsis.files.tables import LARGEST_CSV_BYTES, OtherTableError, parse_csv_rows, read_csv_rows, table_bytes

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence
    from pathlib import Path

    from tsis.files.tables import CsvRow


TABLES = (".csv", ".tsv", ".txt")
NO_FORCE = 0.01  # of a table's largest force: what a scale shows with nothing on it
FILE_COLUMNS = (
    "frame file",
    "file",
    "filename",
    "file name",
    "frame",
    "image",
    "image file",
    "picture",
    "path",
    "name",
    "bild",
    "datei",
    "dateiname",
)
ROLE_COLUMNS = ("role", "kind", "type", "class", "condition", "art")
_UNTOUCHED_NAME = re.compile(r"untouched|no.?contact|background|blank|(^|[^a-z])(ref|reference|zero|empty)([^a-z]|$)")
_PLAIN_NAME = re.compile(r"plain|healthy|control|(^|[^a-z])referen[cz]e?|(without|no).?(lump|inclusion)")
_TARGET_NAME = re.compile(r"target|lump|inclusion|press|ziel")
_FORCE_NAME = re.compile(r"(?<![\d.])(\d+(?:[.,]\d+)?)\s*_?(mN|N)(?![a-zA-Z])")


@dataclass(frozen=True, slots=True, kw_only=True)
class GuessedFrame:
    """A frame, its role, its force in newtons (None where nothing tells it), and what told the force."""

    file: str
    role: str
    force_n: float | None
    source: str


def guess_session(folder: str | os.PathLike[str]) -> tuple[GuessedFrame, ...]:
    """What the files of a folder tell of its frames: forces from tables, JSON files beside frames, or file names.

    Raises `FileInputError` when the folder is a session folder already, holds no frame, two tables tell forces, or a
    table does not fit the frames.
    """
    root = as_path(folder)
    if not root.is_dir():
        raise file_error(root, "must be a folder of frames; it is none")
    try:
        files = sorted(path for path in root.iterdir() if path.is_file() and not path.is_symlink())
    except OSError as error:
        raise file_error(root, f"must be a folder that can be read; got: {error.strerror}") from error
    if any(path.name == PRESSES_FILE for path in files):
        raise file_error(root, f"must have no {PRESSES_FILE} yet; it is a session folder already")
    frames = [path for path in files if path.suffix.lower() in PICTURES]
    if not 1 <= len(frames) <= MOST_FRAMES:
        raise file_error(root, f"must hold 1 to {MOST_FRAMES} frames ({', '.join(PICTURES)}); it holds {len(frames)}")
    told = _of_tables([path for path in files if path.suffix.lower() in TABLES], frames)
    largest = max((abs(row.force_n) for row in told.values() if row.force_n is not None), default=0.0)
    return tuple(_guessed(frame, told, NO_FORCE * largest) for frame in frames)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Told:
    """What a table tells of a frame; an empty role is none."""

    force_n: float | None
    role: str
    source: str


def _guessed(frame: Path, told: dict[str, _Told], least_n: float) -> GuessedFrame:
    row = told.get(frame.name, _Told(force_n=None, role="", source=""))
    force, source = row.force_n, row.source
    if force is None:
        force, source = _of_sidecar(frame)
    if force is None and (named := _FORCE_NAME.findall(frame.stem)):
        number, unit = named[-1]
        force, source = float(number.replace(",", ".")) * (1e-3 if unit == "mN" else 1.0), "its name"
    name = frame.stem.lower()
    role = row.role or (REFERENCE if _PLAIN_NAME.search(name) else TARGET)
    if not row.role and _UNTOUCHED_NAME.search(name) and not force:
        role, force, source = UNTOUCHED, 0.0, source or "its name"
    elif force == 0.0 or (not row.role and force is not None and abs(force) <= least_n):
        role = UNTOUCHED
    return GuessedFrame(file=frame.name, role=role, force_n=0.0 if role == UNTOUCHED else force, source=source)


def _role(text: str) -> str:
    """The role that a word of a table means; empty where it means none."""
    word = text.strip().lower()
    if _PLAIN_NAME.search(word):
        return REFERENCE
    if _UNTOUCHED_NAME.search(word) or word == "leer":
        return UNTOUCHED
    return TARGET if _TARGET_NAME.search(word) else ""


def _of_sidecar(frame: Path) -> tuple[float | None, str]:
    beside = frame.with_suffix(".json")
    if not beside.is_file():
        return None, ""
    document = read_object(beside)
    force = document.get("force_n", document.get("force"))
    force = force.get("force_n") if isinstance(force, dict) else force if "force_n" in document else None
    return (float(force), beside.name) if isinstance(force, int | float) else (None, "")


def _of_tables(tables: Sequence[Path], frames: Sequence[Path]) -> dict[str, _Told]:
    """Force and name of the table by the name of the frame."""
    found: list[tuple[Path, dict[str, _Told]]] = []
    for table in tables:
        content = read_bytes(table, most=LARGEST_CSV_BYTES)
        try:
            where, force = printable_path(table), ("force_n",)
            rows = list(
                parse_csv_rows(content, where, (), (*FILE_COLUMNS, *ROLE_COLUMNS), one_of=force, ignore_others=True)
            )
        except OtherTableError:  # notes, no forces
            continue
        found.append((table, _by_frame(table, rows, frames)))
    if len(found) > 1:
        names = " and ".join(path.name for path, _ in found[:2])
        raise file_error(found[0][0].parent, f"must hold one table of forces; got {names}: move the others elsewhere")
    return found[0][1] if found else {}


def _by_frame(table: Path, rows: Sequence[CsvRow], frames: Sequence[Path]) -> dict[str, _Told]:
    role_column = next((name for name in ROLE_COLUMNS if rows and name in rows[0]), "")
    told = [_Told(force_n=row.number("force_n"), role=_role(row.text(role_column)), source=table.name) for row in rows]
    known = {key: frame.name for frame in frames for key in (frame.name, frame.stem)}
    for column in FILE_COLUMNS:
        texts = [row.text(column).replace("\\", "/").rpartition("/")[2] for row in rows if column in row]
        if texts and set(texts) & set(known):
            lost = sorted(set(texts) - set(known))
            if lost:
                raise file_error(
                    table, f"must name frames of its folder; {lost[0]!r:.60} is none: add it, or take its row out"
                )
            if len({known[text] for text in texts}) < len(texts):
                raise file_error(table, "must name each frame once; it names one twice")
            return {known[text]: each for text, each in zip(texts, told, strict=True)}
    pressed = [frame for frame in frames if not _UNTOUCHED_NAME.search(frame.stem.lower())]
    for ordered in (frames, pressed):
        if len(ordered) == len(rows):
            source = f"{table.name}, in the order of names"
            return {frame.name: replace(each, source=source) for frame, each in zip(ordered, told, strict=True)}
    raise file_error(
        table,
        f"must name the frames in a column file, or have a row for each of the {len(frames)}; got {len(rows)} rows",
    )


def write_session(
    folder: str | os.PathLike[str],
    frames: Sequence[GuessedFrame],
    *,
    mm_per_pixel: tuple[float, float] | None = None,
    probe: str = "",
) -> Path:
    """Write ``presses.csv`` beside the frames; nothing else of the folder is changed."""
    x, y = mm_per_pixel or (None, None)
    heads = ["frame file", "force (N)", "role", "pixel size x (mm)", "pixel size y (mm)", "probe", "settings (JSON)"]
    rows = [
        [frame.file, frame.force_n, frame.role, x, y, probe, json.dumps({"force": frame.source})] for frame in frames
    ]
    path = as_path(folder) / PRESSES_FILE
    if path.exists():
        raise file_error(path, "exists and is not overwritten")
    write_durably(path, table_bytes([heads, *rows]))
    return path


def read_session(folder: str | os.PathLike[str]) -> tuple[GuessedFrame, ...]:
    """Frames, roles and forces of a session folder's ``presses.csv``, without the pictures."""
    path = as_path(folder) / PRESSES_FILE
    rows = read_csv_rows(path, PRESS_COLUMNS[:2], PRESS_COLUMNS[2:])
    return tuple(
        GuessedFrame(
            file=row.text("frame file"),
            role=row.text("role") or TARGET,
            force_n=row.number("force (N)"),
            source=path.name,
        )
        for row in rows
    )

"""A target as tables for spreadsheets: comma-separated values after RFC 4180, and its frames as PNG beside."""

from __future__ import annotations

import csv
import hashlib
import io
import json
from typing import TYPE_CHECKING, Any

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.records.export.csv_rows import estimate_rows, press_rows, target_rows
from tsis.records.export.frame_png import frame_png
from tsis.records.export.whole import export_folder

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence

    from tsis.records.dossier import TargetRecord

FORMAT, VERSION = "tsis-csv", 1
RISKY = ("=", "+", "-", "@", "\t", "\r", "＝", "＋", "－", "＠", "'")

README = f"""Target {{number}}, written by tsis {__version__}

{RESEARCH_USE_ONLY}

target.csv      what was pressed; of a phantom its true values
presses.csv     one row a press, in the order in which they were taken
estimates.csv   one row an estimate and parameter, in the order of making; "in force" is the last one of each kind
frames/         the grey levels as the camera gave them, PNG of 8 or 16 bits; presses.csv names the file of each press
manifest.json   SHA-256 and size in bytes of every file

Comma-separated values after RFC 4180: UTF-8, lines end in CR LF, cells are quoted where they must be, decimals have a
point. Headings hold the unit; in estimates.csv the column "unit" says it row by row. An empty cell says that nobody
measured it. Times are ISO 8601 with their offset from UTC.

Text that a spreadsheet could take for a formula, because it begins with = + - @ or a tab, has an apostrophe in front,
and so has text that begins with an apostrophe: take one away to have what was entered. Numbers are never changed.

Where "trusted" is no, the model did not hold, and there is no result: the cells are empty. Where "identified" is no,
the data told hardly more than was believed before, and the mean says little: use the interval.
"""


def cell(value: Any) -> str:
    """What a table shows of a value: text guarded so that no spreadsheet takes it for a formula.

    Examples
    --------
    >>> cell("=1+1"), cell(-1.5), cell(True), cell(None)
    ("'=1+1", '-1.5', 'yes', '')
    """
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return repr(value)
    text = str(value)
    return f"'{text}" if text.startswith(RISKY) or text.lstrip().startswith(RISKY) else text


def table_bytes(rows: Sequence[Sequence[Any]]) -> bytes:
    """Rows as RFC 4180 wants them, the first being the headings."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\r\n")
    writer.writerows([cell(each) for each in row] for row in rows)
    return out.getvalue().encode()


def csv_files(dossier: TargetRecord) -> dict[str, bytes]:
    """Every file of the export by its name, frames and all: `write_csv` does not hold all of them at once.

    Raises
    ------
    RecordsError
        When a frame is not what its press says.
    """
    return dict(_parts(dossier))


def write_csv(dossier: TargetRecord, folder: str | os.PathLike[str]) -> None:
    """Write the files into a new folder, frame by frame; it appears whole or not at all.

    Raises
    ------
    FileInputError
        When the folder exists or cannot be written.
    RecordsError
        When a frame is not what its press says.
    """
    with export_folder(folder) as draft:
        (draft / "frames").mkdir()
        for name, content in _parts(dossier):
            (draft / name).write_bytes(content)


def _parts(dossier: TargetRecord) -> Iterator[tuple[str, bytes]]:
    entries: dict[str, dict[str, Any]] = {}
    for name, content in _content(dossier):
        entries[name] = {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
        yield name, content
    manifest = {
        "format": FORMAT,
        "version": VERSION,
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "files": entries,
    }
    yield "manifest.json", (json.dumps(manifest, indent=2) + "\n").encode()


def _content(dossier: TargetRecord) -> Iterator[tuple[str, bytes]]:
    names = frame_names(dossier)
    yield "target.csv", table_bytes(target_rows(dossier.target))
    yield "presses.csv", table_bytes(press_rows(dossier, names))
    yield "estimates.csv", table_bytes(estimate_rows(dossier))
    yield "README.txt", README.format(number=dossier.target.number).encode()
    for press, name in zip(dossier.presses, names, strict=True):
        yield name, frame_png(dossier, press)


def frame_names(dossier: TargetRecord) -> list[str]:
    """Name of the file of each press's frame."""
    return [f"frames/{number:05d}-{press.role}.png" for number, press in enumerate(dossier.presses, start=1)]

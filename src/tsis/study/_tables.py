"""Rows of a small table of comma-separated values from elsewhere, every cell of them under its heading."""

from __future__ import annotations

import csv
import hashlib
import io
import math
from typing import TYPE_CHECKING, Any

from tsis.__about__ import __version__
from tsis.catalog import load_phantom
from tsis.errors import FileInputError, InputError
from tsis.files import as_path, one_line, printable_name, printable_path, read_bytes
from tsis.model import Inclusion, Phantom, require_number
from tsis.records.export import RISKY, table_bytes
from tsis.study._folder import enter_readings, user
from tsis.study._values import QUANTITIES, DeviceReading, TargetTruth, require_short_name

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from tsis.study._folder import Study


LARGEST_BYTES, MOST_ROWS, LONGEST_CELL = 32 * 2**20, 1_000_000, 500


class CsvRow:
    """A row; every error names the file and the line.

    Parameters
    ----------
    where
        File and line.
    cells
        Text by heading.
    """

    def __init__(self, where: str, cells: dict[str, str]) -> None:
        self.where, self._cells = where, cells

    def text(self, name: str) -> str:
        """What was entered, without the apostrophe that guards it from spreadsheets."""
        text = self._cells.get(name, "").strip()
        guarded = text.startswith("'") and text[1:].lstrip().startswith(RISKY)
        return text[1:] if guarded else text

    def number(self, name: str) -> float | None:
        """A finite number; None where the cell is empty."""
        text = self._cells.get(name, "").strip()
        if not text:
            return None
        try:
            value = float(text) if text.isascii() and "_" not in text else math.nan
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.refused(name, "a finite number with a decimal point, or empty", text)
        return value

    def refused(self, name: str, requested: str, got: str) -> FileInputError:
        """What to raise where a cell will not do."""
        return FileInputError(f"{name} must be {requested}; got {got!r:.60} ({self.where})")


def read_csv_rows(path: Path, needed: Sequence[str], optional: Sequence[str] = ()) -> Iterator[CsvRow]:
    """Rows of a file of UTF-8 whose first line names its columns, in any order.

    Parameters
    ----------
    path
        The file.
    needed, optional
        Columns that it must and may have; it has no others.

    Raises
    ------
    FileInputError
        When it cannot be read as such a table; the sentence names the line.
    """
    return parse_csv_rows(read_bytes(path, most=LARGEST_BYTES), printable_path(path), needed, optional)


def parse_csv_rows(content: bytes, name: str, needed: Sequence[str], optional: Sequence[str] = ()) -> Iterator[CsvRow]:
    """The same from the content of such a file, as somebody uploaded it under a name."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise FileInputError(f"{name} must be a table in UTF-8; line {line} holds other bytes") from error
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    headings: list[str] | None = None
    try:
        for count, cells in enumerate(reader):
            where = f"{name}, line {reader.line_num}"
            if not any(cell.strip() for cell in cells):
                continue
            if count > MOST_ROWS or any(len(cell) > LONGEST_CELL for cell in cells):
                raise FileInputError(
                    f"{name} must have at most {MOST_ROWS} rows with cells of at most {LONGEST_CELL} letters; line "
                    f"{reader.line_num} goes beyond"
                )
            if headings is None:
                headings = _headings(cells, where, needed, optional)
            elif len(cells) != len(headings):
                raise FileInputError(
                    f"a row must have {len(headings)} cells, as the headings; got {len(cells)} ({where})"
                )
            else:
                yield CsvRow(where, dict(zip(headings, cells, strict=True)))
    except csv.Error as error:
        raise FileInputError(
            f"{name} must be a table of comma-separated values; line {reader.line_num}: {one_line(error)}"
        ) from error
    if headings is None:
        raise FileInputError(f"{name} must begin with the headings {', '.join(needed)}; it is empty")


def _headings(cells: list[str], where: str, needed: Sequence[str], optional: Sequence[str]) -> list[str]:
    names = [cell.strip() for cell in cells]
    lost = [name for name in needed if name not in names]
    if lost:
        raise FileInputError(f"the headings must hold {', '.join(needed)}; missing: {', '.join(lost)} ({where})")
    unknown = [name for name in names if name not in (*needed, *optional)]
    if unknown or len(set(names)) < len(names):
        wrong = repr(unknown[0])[:60] if unknown else "one of them twice"
        raise FileInputError(
            f"the headings must be {', '.join((*needed, *optional))}, each once; got {wrong} ({where})"
        )
    return names


COLUMNS = ("label", "diameter_mm", "depth_mm", "young_kpa")
MORE_COLUMNS = ("offset_mm", "tissue_kpa", "thickness_mm", "poisson")


def read_truth_table(path: str | os.PathLike[str]) -> tuple[TargetTruth, ...]:
    """Targets from a file with the columns `COLUMNS`, and `MORE_COLUMNS` where they are known.

    Parameters
    ----------
    path
        Comma-separated values in UTF-8. A row whose diameter, depth and modulus are empty is a target without an
        inclusion; other empty cells are as in the phantom ``detection-blank`` of the catalog.

    Raises
    ------
    FileInputError
        When a row is no target, in one sentence with its line.
    """
    position = as_path(path)
    document: dict[str, TargetTruth] = {}
    for row in read_csv_rows(position, COLUMNS, MORE_COLUMNS):
        target = _target(row)
        if target.label in document:
            raise row.refused("label", "different in every row", target.label)
        document[target.label] = target
    if not document:
        raise FileInputError(f"{printable_path(position)} must hold at least one target; it has headings alone")
    return tuple(document.values())


def _target(row: CsvRow) -> TargetTruth:
    usual = load_phantom("detection-blank")
    numbers = {name: row.number(name) for name in (*COLUMNS[1:], *MORE_COLUMNS)}
    given = [name for name in COLUMNS[1:] if numbers[name] is not None]
    if given and len(given) < len(COLUMNS) - 1:
        lost = next(name for name in COLUMNS[1:] if name not in given)
        raise row.refused(lost, f"given where {given[0]} is, or all three empty", "")
    try:
        poisson = _or(numbers["poisson"], usual.poisson)
        lump = None
        if given:
            lump = Inclusion(
                diameter_mm=_or(numbers["diameter_mm"], 0.0),
                depth_mm=_or(numbers["depth_mm"], 0.0),
                young_kpa=_or(numbers["young_kpa"], 0.0),
                poisson=poisson,
                offset_mm=(_or(numbers["offset_mm"], 0.0), 0.0),
            )
        phantom = Phantom(
            young_kpa=_or(numbers["tissue_kpa"], usual.young_kpa),
            thickness_mm=_or(numbers["thickness_mm"], usual.thickness_mm),
            poisson=poisson,
            inclusion=lump,
        )
        return TargetTruth(label=row.text("label"), phantom=phantom)
    except InputError as error:
        raise FileInputError(f"{error} ({row.where})") from error


def _or(value: float | None, usual: float) -> float:
    return usual if value is None else value


READING_COLUMNS = ("code", "score", "operator", "repeat", *QUANTITIES)
NO_RESPONSE = "the device gave no answer"


def import_readings(
    study: Study,
    path: str | os.PathLike[str],
    *,
    device: str,
    threshold: float | None = None,
    actor: str = "",
) -> Study:
    """Enter the readings of a device from a file with the columns `READING_COLUMNS`, all or none.

    Parameters
    ----------
    study
        Which one; it must be blind.
    path
        Comma-separated values in UTF-8. An empty score is a reading without an answer; sizes, depths and moduli may be
        empty.
    device
        Name of the device.
    threshold
        From which score on it calls a target one with an inclusion; that of the study by default. It is fixed with the
        first import of a device.
    actor
        Who enters them.

    Raises
    ------
    InputError
        When a row is none, in one sentence with its line; then nothing is entered.
    RecordsError
        When the study is unblinded.
    """
    position = as_path(path)
    return import_table(
        study,
        read_bytes(position, most=LARGEST_BYTES),
        printable_name(position),
        device=device,
        threshold=threshold,
        actor=actor,
    )


def import_table(
    study: Study, content: bytes, name: str, *, device: str, threshold: float | None = None, actor: str = ""
) -> Study:
    """The same from the content of such a file, as somebody uploaded it under a name."""
    require_short_name("device", device)
    if device == study.plan.device:
        raise InputError(f"device must not be {device!r:.60}, which tsis study run reads with (choose another name)")
    limit = _threshold(study, device, threshold)
    readings: dict[tuple[str, str, str, int], DeviceReading] = {}
    given, codes = {reading.key for reading in study.readings}, frozenset(study.plan.codes)
    for row in parse_csv_rows(content, name, READING_COLUMNS):
        reading = _reading(row, codes, device)
        if reading.key in readings or reading.key in given:
            raise FileInputError(
                f"code, operator and repeat must be together but once for a device; {reading.code}, "
                f"{reading.operator!r:.60} and {reading.repeat} are there already ({row.where})"
            )
        readings[reading.key] = reading
    if not readings:
        raise FileInputError(f"{name} must hold at least one reading; it has headings alone")
    document: dict[str, Any] = {
        "device": device,
        "threshold": limit,
        "file": name,
        "sha256": hashlib.sha256(content).hexdigest(),
        "readings": len(readings),
        "tsis": __version__,
    }
    return enter_readings(study, list(readings.values()), actor=actor or user(), imported=document)


def _threshold(study: Study, device: str, threshold: float | None) -> float:
    before = study.threshold_of(device)
    if threshold is None:
        return before
    require_number("threshold", threshold, -1e12, 1e12)
    if device in study.devices and threshold != before:
        raise InputError(
            f"threshold must stay what it was when the first readings of {device!r:.60} came in, {before:g}; "
            f"got {threshold:g}"
        )
    return float(threshold)


def _reading(row: CsvRow, codes: frozenset[str], device: str) -> DeviceReading:
    code, repeat = row.text("code"), row.number("repeat")
    if code not in codes:
        raise row.refused("code", "one of this study's codes", code)
    if repeat is None or not repeat.is_integer():
        raise row.refused("repeat", "a whole number from 1", row.text("repeat"))
    score = row.number("score")
    values = {name: value for name in QUANTITIES if (value := row.number(name)) is not None}
    try:
        return DeviceReading(
            code=code,
            device=device,
            operator=row.text("operator"),
            repeat=int(repeat),
            score=score,
            reason=NO_RESPONSE if score is None else "",
            values=values,
        )
    except InputError as error:
        raise FileInputError(f"{error} ({row.where})") from error


def export_readings(study: Study, device: str | None = None) -> bytes:
    """Readings of a device as `import_readings` takes them, without anything of the truth.

    Parameters
    ----------
    study
        Which one.
    device
        Whose; of the only one by default.

    Raises
    ------
    InputError
        When there are no readings of that device, or several devices and none is named.
    """
    if device is None:
        if len(study.devices) != 1:
            raise InputError(
                f"device must be named where there is not exactly one; this study has readings of "
                f"{', '.join(study.devices) or 'none'}"
            )
        device = study.devices[0]
    stored = [reading for reading in study.readings if reading.device == device]
    if not stored:
        raise InputError(f"device must be one that has readings, {', '.join(study.devices)}; got {device!r:.60}")
    rows: list[list[Any]] = [list(READING_COLUMNS)]
    for item in stored:
        values = [item.values.get(name) for name in QUANTITIES]
        rows.append([item.code, item.score, item.operator, item.repeat, *values])
    return table_bytes(rows)

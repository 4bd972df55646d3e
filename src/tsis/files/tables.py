"""Tables of any program: delimiter, encoding, decimal mark and units are found, each cell is read by its heading."""

from __future__ import annotations

import csv
import io
import itertools
import math
import re
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any

from tsis.errors import FileInputError
from tsis.files.reading import one_line, printable_path, read_bytes

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path


LARGEST_CSV_BYTES, MOST_ROWS, LONGEST_CELL = 32 * 2**20, 1_000_000, 500
LATEST_HEADINGS = 60  # lines before which the headings stand: exports of machines begin with a preamble
# A spreadsheet takes text with such a start for a formula; an apostrophe before it prevents that.
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "＝", "＋", "－", "＠", "'")

DELIMITERS = (",", ";", "\t", "|")
NOTES = ("<", "#")  # such a line with one cell, as <END DATA>, is no row
STANDARD_GRAVITY = 9.80665  # m/s², of a force in grams
POUND_KG, INCH_MM = 0.45359237, 25.4  # exact, of 1959
# Units of one dimension in terms of one of them.
UNITS: dict[str, dict[str, float]] = {
    "force": {
        "N": 1.0,
        "newton": 1.0,
        "newtons": 1.0,
        "mN": 1e-3,
        "µN": 1e-6,
        "uN": 1e-6,
        "nN": 1e-9,
        "pN": 1e-12,
        "cN": 1e-2,
        "dN": 0.1,
        "daN": 10.0,
        "kN": 1e3,
        "g": 1e-3 * STANDARD_GRAVITY,
        "gf": 1e-3 * STANDARD_GRAVITY,
        "gram": 1e-3 * STANDARD_GRAVITY,
        "grams": 1e-3 * STANDARD_GRAVITY,
        "p": 1e-3 * STANDARD_GRAVITY,
        "kg": STANDARD_GRAVITY,
        "kgf": STANDARD_GRAVITY,
        "kp": STANDARD_GRAVITY,
        "lb": POUND_KG * STANDARD_GRAVITY,
        "lbf": POUND_KG * STANDARD_GRAVITY,
        "ozf": POUND_KG / 16 * STANDARD_GRAVITY,
        "oz": POUND_KG / 16 * STANDARD_GRAVITY,
    },
    "length": {
        "mm": 1.0,
        "m": 1e3,
        "cm": 10.0,
        "dm": 100.0,
        "µm": 1e-3,
        "um": 1e-3,
        "micron": 1e-3,
        "microns": 1e-3,
        "nm": 1e-6,
        "in": INCH_MM,
        "inch": INCH_MM,
        "millimetre": 1.0,
        "millimetres": 1.0,
        "millimeters": 1.0,
    },
    "area": {"mm2": 1.0, "cm2": 100.0, "m2": 1e6, "µm2": 1e-6, "um2": 1e-6},
    "modulus": {"kPa": 1.0, "Pa": 1e-3, "hPa": 0.1, "MPa": 1e3, "GPa": 1e6, "N/mm2": 1e3, "psi": 6.894757293168},
    "time": {
        "s": 1.0,
        "sec": 1.0,
        "second": 1.0,
        "seconds": 1.0,
        "ms": 1e-3,
        "msec": 1e-3,
        "µs": 1e-6,
        "us": 1e-6,
        "min": 60.0,
        "minutes": 60.0,
        "h": 3600.0,
    },
    "angle": {"deg": 1.0, "°": 1.0, "degrees": 1.0, "rad": 180.0 / math.pi},
    "fraction": {"1": 1.0, "%": 0.01},
}
MEGA_OR_MILLI = ("MN", "Mn", "mPa", "mpa", "MM2")  # units whose capitals leave two meanings
# Other words for the first words of a heading, by the one that tsis uses.
SYNONYMS = {
    "force": (
        *("load", "normal force", "contact force", "compressive load", "standard force", "fn", "fz", "f"),
        *("axial force", "axial load", "load on sample", "force a", "weight", "last", "gewicht", "poids"),
        *("kraft", "standardkraft", "prüfkraft", "force normale"),
        *("force z", "z force", "force normal"),
    ),
    **{axis: (f"position {axis}", f"{axis} position", f"pos {axis}", f"{axis} pos") for axis in ("x", "y")},
    "radius": ("contact radius",),
    "area": ("contact area",),
    "depth": ("indentation", "indentation depth", "dent", "contact depth", "penetration depth", "pd"),
    "time": (
        "t",
        "elapsed time",
        "elapsed",
        "running time",
        "time on sample",
        "timestamp",
        "zeit",
        "prüfzeit",
        "temps",
    ),
    "young": ("youngs modulus", "young modulus", "young's modulus", "modulus", "elastic modulus", "e"),
    "travel": (
        *("displacement", "indentation", "indentation depth", "penetration", "penetration depth", "depth", "weg"),
        *("position", "z", "position z", "z position", "pos z", "z pos"),
    ),
    "displacement": (
        *("travel", "position", "extension", "compressive extension", "distance", "stroke", "crosshead", "z"),
        *("axial displacement", "displacement into surface"),
        *("weg", "standardweg", "traverse", "déplacement"),
    ),
}
KINDS = {  # what begins so is no table: what it is, and the cure
    b"PK\x03\x04": ("a workbook or an archive", "save its sheet as CSV"),
    b"\xd0\xcf\x11\xe0": ("a workbook of Excel", "save its sheet as CSV"),
    b"\x89HDF": ("an HDF5 file", "write its columns as CSV"),
    b"\x93NUMPY": ("an array of NumPy", "write it by numpy.savetxt with a line of headings"),
    b"MATLAB 5.0": ("a MAT file", "write it by writetable"),
    b"TDSm": ("a TDMS file of LabVIEW", "write its channels as CSV"),
    b"PAR1": ("a Parquet file", "write it as CSV"),
    b"IGOR": ("a text of Igor", "save its waves as delimited text"),
    b"\\*F": ("a file of NanoScope", "export force and separation as ASCII, with their units"),
    b"[DataSet]": ("a NID file of Nanosurf", "export force and position as CSV"),
    b'{"': ("JSON", "write a table with a row for each point"),
}
DEVIATION = ("std", "stdev", "stddev", "standard deviation", "sigma")
INDEX_HEADINGS = frozenset(
    ("", "#", "index", "idx", "no", "no.", "nr", "nr.", "number", "row", "line", "unnamed: 0", "s/n")
)
ENDS = ("sd", "low", "high")  # may follow the unit in a name, as in depth_mm_sd


class OtherTableError(FileInputError):
    """A text that has none of the columns that are asked for: another table, or none."""


class CsvRow:
    """A row: text by heading; errors name ``where``, the file and line; numbers are in the unit of the asked name."""

    def __init__(self, where: str, cells: Mapping[str, str], form: TableForm | None = None) -> None:
        self.where, self._cells, self._form = where, cells, form or TableForm()

    def text(self, name: str) -> str:
        """Text of a cell without the apostrophe that guards it from spreadsheets."""
        text = self._cells.get(name, "").strip()
        guarded = text.startswith("'") and text[1:].lstrip().startswith(FORMULA_STARTS)
        return text[1:] if guarded else text

    def number(self, name: str) -> float | None:
        """A finite number in the unit of ``name``; None where the cell is empty."""
        text = self._cells.get(name, "").strip()
        if not text:
            return None
        value = parse_number(text, decimal_comma=self._form.decimal_comma)
        if not math.isfinite(value):
            mark = "comma" if self._form.decimal_comma else "point"
            raise self.refused(name, f"a finite number with a decimal {mark}, or empty", text)
        return value * self._form.factors.get(name, 1.0)

    def refused(self, name: str, requested: str, got: str) -> FileInputError:
        """The error for an invalid cell."""
        return FileInputError(f"{name} must be {requested}; got {got!r:.60} ({self.where})")

    def __contains__(self, name: object) -> bool:
        return name in self._cells


@dataclass(frozen=True, slots=True, kw_only=True)
class TableForm:
    """How a table is written.

    Attributes
    ----------
    delimiter
        Between cells; a space stands for any white space.
    decimal_comma
        Whether 1,5 is one and a half.
    columns
        Name that was asked for, by the place of its column.
    factors
        What a cell is multiplied by for the unit of its name.
    """

    delimiter: str = ","
    decimal_comma: bool = False
    columns: Mapping[int, str] = field(default_factory=dict)
    factors: Mapping[str, float] = field(default_factory=dict)


def parse_number(text: str, *, decimal_comma: bool = False) -> float:
    """The number in a cell, NaN where it holds none.

    Examples
    --------
    >>> parse_number("1.234,5", decimal_comma=True), parse_number("-2e-3")
    (1234.5, -0.002)
    """
    plain = text.strip().replace("\N{MINUS SIGN}", "-")
    thousands = "." if decimal_comma else ","
    if thousands in plain:
        if not re.fullmatch(rf"[+-]?[1-9]\d{{0,2}}(\{thousands}\d{{3}})+([.,]\d*)?", plain):
            return math.nan
        plain = plain.replace(thousands, "")
    plain = plain.replace(",", ".") if decimal_comma else plain
    try:
        return float(plain) if plain.isascii() and "_" not in plain else math.nan
    except ValueError:
        return math.nan


def table_text(content: bytes, name: str) -> str:
    """The text of a table in UTF-8 or UTF-16, with or without byte order mark, or in the letters of old Windows.

    Examples
    --------
    >>> table_text("force / µN".encode("utf-16"), "a.csv")
    'force / µN'
    """
    for start, (what, cure) in KINDS.items():
        if content.startswith(start):
            raise FileInputError(f"{name} must be a table of text; it is {what}: {cure}")
    zeros = content[:200].count(0)
    try:
        if content.startswith((b"\xff\xfe", b"\xfe\xff")):
            text = content.decode("utf-16")
        elif zeros and 2.5 * zeros > len(content[:200]):
            text = content.decode("utf-16-be" if content[:1] == b"\0" else "utf-16-le")
        else:
            text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = content.decode("cp1252", errors="replace")
        if re.search(r"[\x00-\x08\x0e-\x1f\x7f�]", text):
            line = content[: error.start].count(b"\n") + 1
            raise FileInputError(f"{name} must be a table in UTF-8; line {line} holds other bytes") from error
    if "\0" in text:
        raise FileInputError(f"{name} must be a table of text; it holds zero bytes: save the table as CSV")
    return text


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """The words of a heading, normal spelling, and its unit; an empty unit is none."""

    words: str
    unit: str


@cache
def parse_heading(text: str) -> Heading:
    """Words and unit of a heading: the unit in brackets, after a slash or comma, or as the last part of the name.

    Examples
    --------
    >>> parse_heading("Force / mN"), parse_heading("depth_mm_sd")
    (Heading(words='force', unit='mN'), Heading(words='depth sd', unit='mm'))
    """
    plain = text.strip().strip("\"'").strip()
    bracketed = re.fullmatch(r"(.*?)(?:\s*\([^()]*\))?\s*[\[(<{]\s*([^\[\](){}<>]*?)\s*[\])>}]\s*(\w*)", plain)
    slashed = re.fullmatch(r"([^/]+?)\s*/\s*([^/]+(?:/mm[2²])?)", plain)
    spoken = re.fullmatch(r"(.+?)(?:\s*\([^()]*\))?(?:[\s_]+in[\s_]+|\s*,\s*)(\S+)", plain)
    if bracketed:
        return Heading(words=_words(f"{bracketed[1]} {bracketed[3]}"), unit=_unit(bracketed[2]))
    if slashed or spoken:
        part = slashed or spoken
        assert part is not None
        return Heading(words=_words(part[1]), unit=_unit(part[2]))
    parts = re.split(r"[\s_]+", plain)
    for place in range(len(parts) - 1, 0, -1):
        unit = _unit(parts[place])
        if _dimension(unit) or unit in MEGA_OR_MILLI:
            return Heading(words=_words(" ".join(parts[:place] + parts[place + 1 :])), unit=unit)
        if parts[place].lower() not in (*ENDS, *DEVIATION):
            break
    return Heading(words=_words(plain), unit="")


def _words(text: str) -> str:
    words = " ".join(re.split(r"[\s_\-]+", text.lower())).strip(" :,")
    for other in DEVIATION:
        words = re.sub(rf"\b{other}\b", "sd", words)
    return re.sub(r"^sd (?:of )?(.+)$", r"\1 sd", words)


def _unit(text: str) -> str:
    return text.strip().rstrip(".").replace("μ", "µ").replace("²", "2").replace("^2", "2").replace("**2", "2")


@cache
def _dimension(unit: str) -> tuple[str, float] | None:
    """Dimension of a unit and its size; None where it is unknown, or its case leaves two meanings."""
    known = [(dimension, units[unit]) for dimension, units in UNITS.items() if unit in units]
    if known:
        return known[0]
    if unit in MEGA_OR_MILLI:
        return None
    folded = [
        (dimension, size)
        for dimension, units in UNITS.items()
        for name, size in units.items()
        if name.lower() == unit.lower()
    ]
    return folded[0] if len({size for _, size in folded}) == 1 and len({name for name, _ in folded}) == 1 else None


def _spellings(words: str) -> set[str]:
    """A name's words, with the synonyms of its first ones."""
    first, *rest = words.split(" ")
    return {words, *(" ".join([other, *rest]) for other in SYNONYMS.get(first, ()))}


def read_csv_rows(
    path: Path, needed: Sequence[str], optional: Sequence[str] = (), *, ignore_others: bool = False
) -> Iterator[CsvRow]:
    """Rows of a file with the columns ``needed`` and ``optional`` in any order; see `parse_csv_rows`."""
    content = read_bytes(path, most=LARGEST_CSV_BYTES)
    return parse_csv_rows(content, printable_path(path), needed, optional, ignore_others=ignore_others)


def parse_csv_rows(
    content: bytes,
    name: str,
    needed: Sequence[str],
    optional: Sequence[str] = (),
    *,
    one_of: Sequence[str] = (),
    ignore_others: bool = False,
    most_rows: int = MOST_ROWS,
) -> Iterator[CsvRow]:
    r"""Rows of the content of such a file, e.g. of an upload; errors call it ``name``.

    Commas, semicolons, tabs, bars or white space separate cells; the decimal mark is a point or a comma; text is in
    UTF-8, UTF-16 or Windows-1252. A column has its name as asked for, or the words of that name with any unit of the
    same dimension in brackets, after a slash or an underscore, or in the line below; numbers are converted. Lines
    before the headings, and columns that only count, are ignored. At least one of the columns ``one_of`` must be there.

    `FileInputError` when the file is no such table, has other columns (unless ``ignore_others``), or leaves two
    meanings; the message names the line.

    Examples
    --------
    >>> table = "Nr.;Force / mN;Radius [µm]\n1;250,0;1500\n".encode("utf-16")
    >>> row = next(parse_csv_rows(table, "a.csv", ["force_n", "radius_mm"]))
    >>> row.number("force_n"), row.number("radius_mm")
    (0.25, 1.5)
    """
    text = table_text(content, name)
    form, first, width = _headings(text, name, needed, (*one_of, *optional), one_of, ignore_others=ignore_others)
    for number, cells in _cells_of(text, form.delimiter, name):
        if number <= first or not any(cell.strip() for cell in cells):
            continue
        if width > 1 and cells[0].startswith(NOTES) and not any(cell.strip() for cell in cells[1:]):
            continue
        where = f"{name}, line {number}"
        if number > most_rows + LATEST_HEADINGS or any(len(cell) > LONGEST_CELL for cell in cells):
            raise FileInputError(
                f"{name} must have at most {most_rows} rows with cells of at most {LONGEST_CELL} letters; line "
                f"{number} goes beyond"
            )
        if len(cells) < width or any(cell.strip() for cell in cells[width:]):
            raise FileInputError(f"a row must have {width} cells, as the headings; got {len(cells)} ({where})")
        yield CsvRow(where, {column: cells[place] for place, column in form.columns.items()}, form)


def _cells_of(text: str, delimiter: str, name: str) -> Iterator[tuple[int, list[str]]]:
    """Number of the last line and cells of each row."""
    if delimiter == " ":
        for number, line in enumerate(io.StringIO(text), start=1):
            yield number, line.split()
        return
    reader = csv.reader(io.StringIO(text, newline=""), strict=True, delimiter=delimiter)
    try:
        for cells in reader:
            yield reader.line_num, cells
    except csv.Error as error:
        raise FileInputError(
            f"{name} must be a table of comma-separated values; line {reader.line_num}: {one_line(error)}"
        ) from error


def _headings(
    text: str,
    name: str,
    needed: Sequence[str],
    optional: Sequence[str],
    one_of: Sequence[str],
    *,
    ignore_others: bool,
) -> tuple[TableForm, int, int]:
    """The form of the table, the line of its headings, and how many they are.

    The delimiter and the line are those that give most of the columns that are asked for, then most of their units; a
    sentence in the preamble may hold the same words.
    """
    asked, best, failure = (*needed, *optional), None, None
    for delimiter in (*DELIMITERS, " "):
        try:
            lines = list(itertools.islice(_cells_of(text, delimiter, name), LATEST_HEADINGS))
        except FileInputError as error:
            failure = failure or error
            continue
        for at, (number, cells) in enumerate(lines):
            if not any(cell.strip() for cell in cells) or len(cells) > 1000:
                continue
            columns = _columns(cells, asked)
            stated = sum(bool(parse_heading(cells[place]).unit) for place in columns)
            continued = len(next((row for _, row in lines[at + 1 :] if any(row)), [])) == len(cells)
            score = (len(set(columns.values())), stated, continued, -at, len(cells) if delimiter != " " else 0)
            if best is None or score > best[0]:
                best = score, delimiter, number, cells, lines[at + 1 :]
    if best is None:
        if failure is not None:
            raise failure
        raise OtherTableError(f"{name} must begin with the headings {', '.join(needed)}; it is empty")
    _, delimiter, number, cells, following = best
    where = f"{name}, line {number}"
    columns = _columns(cells, asked)
    lost = [column for column in needed if column not in columns.values()]
    if lost and failure is not None and (delimiter == " " or len(cells) == 1):  # by none of the others it is a table
        raise failure
    if lost:
        got = ", ".join(cell.strip() for cell in cells)
        wanted = parse_heading(lost[0])
        cure = f"; call the column {wanted.words}" + (f" ({_spelled(wanted.unit)})" if wanted.unit else "")
        if not any(re.search("[^\\W\\d_]", cell) for cell in cells):
            cure = "; write the headings in a line above"
        raise FileInputError(
            f"the headings must hold {', '.join(needed)}; missing: {', '.join(lost)}; got {got!r:.120}{cure} ({where})"
        )
    if one_of and not set(one_of) & set(columns.values()):
        got = ", ".join(cell.strip() for cell in cells)
        raise OtherTableError(
            f"{name} must have a header with {', '.join(one_of[:-1])} or {one_of[-1]}; got {got!r:.120} ({where})"
        )
    _require_single(cells, columns, asked, where, ignore_others=ignore_others)
    units = [""] * len(cells)
    below = next(((line, row) for line, row in following if any(cell.strip() for cell in row)), None)
    if below is not None and _is_unit_row(below[1], columns):
        number, units = below[0], [_unit(cell.strip().strip("[]()")) for cell in below[1]]
    factors = {column: _factor(cells[place].strip(), units[place], column, where) for place, column in columns.items()}
    width = max((place for place, cell in enumerate(cells) if cell.strip()), default=0) + 1
    decimal_comma = _has_decimal_comma(text, delimiter, name, number, columns, width)
    form = TableForm(delimiter=delimiter, decimal_comma=decimal_comma, columns=columns, factors=factors)
    return form, number, width


def _columns(cells: Sequence[str], asked: Sequence[str]) -> dict[int, str]:
    """The asked name of each column: names as they are first, then by their words."""
    columns = {place: cell.strip() for place, cell in enumerate(cells) if cell.strip() in asked}
    spelled: dict[str, str] = {}
    for name in asked:
        if name not in columns.values():
            for words in _spellings(parse_heading(name).words):
                spelled.setdefault(words, name)
    for name in asked:  # its own words come before another's synonym
        if name not in columns.values():
            spelled[parse_heading(name).words] = name
    for place, cell in enumerate(cells):
        own = spelled.get(parse_heading(cell[:LONGEST_CELL]).words) if cell.strip() else None
        if own is not None and place not in columns:
            columns[place] = own
    return {place: name for place, name in columns.items() if not _outdone(place, cells, columns)}


def _outdone(place: int, cells: Sequence[str], columns: Mapping[int, str]) -> bool:
    """Whether another column of that name has a unit of its dimension, and this one has none, as Depth (V)."""
    name = columns[place]
    wanted = _dimension(parse_heading(name).unit)

    def fits(cell: str) -> bool:
        unit = _dimension(parse_heading(cell[:LONGEST_CELL]).unit)
        return unit is not None and wanted is not None and unit[0] == wanted[0]

    rivals = [other for other in columns if columns[other] == name and other != place]
    return not fits(cells[place]) and any(fits(cells[other]) for other in rivals)


def _require_single(
    cells: Sequence[str], columns: Mapping[int, str], asked: Sequence[str], where: str, *, ignore_others: bool
) -> None:
    names = list(columns.values())
    twice = next((name for name in names if names.count(name) > 1), None)
    others = [
        cell.strip()
        for place, cell in enumerate(cells)
        if place not in columns and cell.strip().lower() not in INDEX_HEADINGS
    ]
    if twice is not None:
        same = " and ".join(repr(cells[place].strip())[:40] for place, name in columns.items() if name == twice)
        detail = f"one of them twice, {twice} as {same}"
    elif others and not ignore_others:
        detail = repr(others[0])[:60]
    else:
        return
    raise FileInputError(f"the headings must be {', '.join(asked)}, each once; got {detail} ({where})")


def _is_unit_row(cells: Sequence[str], columns: Mapping[int, str]) -> bool:
    units = [cells[place].strip().strip("[]()") for place in columns if place < len(cells)]
    return (
        any(units)
        and all(not unit or _dimension(_unit(unit)) for unit in units)
        and not all(math.isfinite(parse_number(unit)) for unit in units if unit)
    )


def _factor(heading: str, below: str, name: str, where: str) -> float:
    """What converts a cell to the unit of the asked name."""
    wanted = parse_heading(name).unit
    if heading == name and not below:
        return 1.0
    stated = parse_heading(heading).unit
    if stated and below and _dimension(below) not in (None, _dimension(stated)):
        raise FileInputError(
            f"the heading {heading!r:.60} must have one unit; it states {stated!r:.20}, and the line below "
            f"{below!r:.20} ({where})"
        )
    given, dimension = stated or below, _dimension(wanted)
    if dimension is None:
        if given in ("", wanted):
            return 1.0
        size = None if wanted else _dimension(given)
        if size is not None and size[0] == "fraction":
            return size[1]
        requirement = f"have the unit {wanted}" if wanted else "have no unit"
        raise FileInputError(f"{name} must {requirement}; got {heading!r:.60} ({where})")
    size = _dimension(given)
    if size is None or size[0] != dimension[0]:
        got = f"the unit {given!r:.20}" if given else "none"
        raise FileInputError(
            f"the heading {heading!r:.60} must name its unit, as {parse_heading(name).words} ({_spelled(wanted)}), one "
            f"of {', '.join(list(UNITS[dimension[0]])[:12])}; got {got} ({where})"
        )
    return 1.0 if given == wanted else size[1] / dimension[1]


def _spelled(unit: str) -> str:
    """The unit of a name as people write it: N for n."""
    return next((known for units in UNITS.values() for known in units if known.lower() == unit.lower()), unit)


def _has_decimal_comma(
    text: str, delimiter: str, name: str, first: int, columns: Mapping[int, str], width: int
) -> bool:
    """Whether numbers have a decimal comma; refused where commas and points leave two meanings."""
    if "," not in text:
        return False
    seen: dict[str, str] = {}  # a cell of each kind
    for number, cells in _cells_of(text, delimiter, name):
        if number <= first or len(cells) < width:
            continue
        for place in columns:
            cell = cells[place].strip()
            if ("," in cell or "." in cell) and (kind := _kind_of_number(cell)):
                seen.setdefault(kind, cell)
    rivals = [kinds for kinds in _RIVALS if set(kinds) <= set(seen)]
    explained = {"1,5", "thousands then 1,5", "thousands then 1.5"} & set(seen)
    if "1,000" in seen and not explained and delimiter != ";":  # where cells are apart by ; the comma is decimal
        rivals.append(("1,000", "1,000"))
    if rivals:
        a, b = (seen[kind] for kind in rivals[0])
        raise FileInputError(
            f"numbers must show one decimal mark in all of {name}, a point or a comma; got "
            f"{a!r:.30}{'' if a == b else f' and {b!r:.30}'} (write numbers without marks of thousands)"
        )
    return "1,5" in seen or "thousands then 1,5" in seen or ("1,000" in seen and "thousands then 1.5" not in seen)


# Kinds of numbers that a table must not have together.
_RIVALS = (
    ("1,5", "1.5"),
    ("1,5", "1.000"),
    ("1.5", "1,000"),
    ("1,000", "1.000"),
    ("thousands then 1,5", "1.5"),
    ("thousands then 1,5", "thousands then 1.5"),
    ("thousands then 1.5", "1,5"),
)


def _kind_of_number(cell: str) -> str:
    """How a number with a mark reads, by an example; empty where it is none."""
    as_comma, as_point = (math.isfinite(parse_number(cell, decimal_comma=mark)) for mark in (True, False))
    if "," in cell and "." in cell:
        return "thousands then 1,5" if as_comma else "thousands then 1.5" if as_point else ""
    mark = "," if "," in cell else "."
    if as_comma and as_point:
        return f"1{mark}000"
    return f"1{mark}5" if as_comma or as_point else ""


def cell(value: Any) -> str:
    """The text of a cell, guarded so that no spreadsheet takes it for a formula.

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
    return f"'{text}" if text.startswith(FORMULA_STARTS) or text.lstrip().startswith(FORMULA_STARTS) else text


def table_bytes(rows: Sequence[Sequence[Any]]) -> bytes:
    """Rows, headings first, in the form of RFC 4180."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\r\n")
    writer.writerows([cell(item) for item in row] for row in rows)
    return out.getvalue().encode()

"""Files of force curves: tables of any program with units, texts of Optics11 and JPK, and JPK through afmformats.

Mark-10 and Mecmesin export tables whose columns name force, travel and time with their units; lines before the headings
are left out. A Chiaro file states the tip's radius and the maker's modulus; its indenter's position is that of the
piezo less the bending of the cantilever. A text that JPK's program exported has a block for each segment, whose head
names columns, units and the spring constant.
"""

from __future__ import annotations

import io
import re
import warnings
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import FileInputError, InputError, import_extra
from tsis.files.reading import as_path, file_error, one_line, printable_name, printable_path, read_bytes
from tsis.files.tables import parse_csv_rows, parse_number, table_text
from tsis.hardness.force_curves import LEAST_POINTS, ForceCurve

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence

LARGEST_BYTES = 256 * 2**20
MOST_CURVES = 10_000
MOST_SEGMENTS, MUCH = 20, 0.05  # times that go back more often, and in this part of the rows, are not segments
AFM_ENDINGS = (".jpk-force", ".jpk-force-map", ".jpk-qi-data", ".h5", ".ibw", ".tab")
DEPTHS = ("depth_mm", "displacement_mm")
CURVE_HEADINGS = ("curve", "specimen", "sample", "replicate", "repeat")  # of a column that tells curves apart
HEAD = 50_000  # letters that may hold the headings
_CHIARO = re.compile(r"^(?P<name>[^\t\n]+?)\t(?P<value>[-+\d.]+)\s*$", re.MULTILINE)


def read_curves(path: str | os.PathLike[str]) -> tuple[ForceCurve, ...]:
    """Curves of a file: one of a Chiaro text, all of a table, a JPK file or a map, those of a ZIP archive.

    A table holds one curve, or one for each value of a column ``curve``, ``specimen``, ``sample``, ``replicate`` or
    ``repeat``.

    Parameters
    ----------
    path
        A table with a force and a depth, displacement, travel, position or indentation, each with its unit, and
        perhaps a time; or a file of another kind, told by its content or ending.

    Raises
    ------
    FileInputError
        When the file is missing, damaged, or has no such curve.
    MissingExtraError
        When it needs afmformats, which the extra ``curves`` brings.
    """
    file = as_path(path)
    content = read_bytes(file, most=LARGEST_BYTES)
    name = printable_name(file)
    if file.name.lower().endswith(AFM_ENDINGS):
        return tuple(_afm_curves(file))
    if content.startswith(b"PK\x03\x04"):
        return tuple(_zipped(file, content))
    return _text_curves(content, name, printable_path(file))


def _zipped(file: Path, content: bytes) -> Iterator[ForceCurve]:
    """Curves of the texts in a ZIP archive."""
    texts = []
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [item for item in archive.infolist() if not item.is_dir()]
            _require_few(file, members)
            for item in members:
                with archive.open(item) as opened:  # a false size in the archive must not fill the memory
                    texts.append((printable_name(Path(item.filename)), opened.read(LARGEST_BYTES + 1)))
    except (FileInputError, MemoryError):
        raise
    except Exception as error:  # zipfile has a dozen errors for a damaged archive, ValueError and zlib.error among them
        raise file_error(file, f"must be a whole ZIP archive; {one_line(error)}") from error
    for name, text in texts:
        yield from _text_curves(text, name, f"{name} in {printable_path(file)}")


def _require_few(file: Path, members: Sequence[zipfile.ZipInfo]) -> None:
    if {"[Content_Types].xml", "mimetype"} & {item.filename for item in members}:
        raise file_error(file, "must hold texts of curves; it is a workbook: save its sheet as CSV")
    if not 0 < len(members) <= MOST_CURVES or sum(item.file_size for item in members) > LARGEST_BYTES:
        raise file_error(file, f"must hold 1 to {MOST_CURVES} curves of at most {LARGEST_BYTES} bytes together")


def _text_curves(content: bytes, name: str, where: str) -> tuple[ForceCurve, ...]:
    text = table_text(content, where)
    if "Tip radius (um)" in text[:5000] and "Piezo (nm)" in text[:5000]:
        return (_chiaro_curve(text, name, where),)
    if re.search(r"^# columns: .*vDeflection", text, re.MULTILINE):
        return (_jpk_text_curve(text, name, where),)
    if re.search(r"defl_(?:nm|v)_|t-b\s*\(v\)", text[:5000].lower()):
        raise FileInputError(
            f"{where} must hold a force; it holds the deflection of a cantilever: export force and separation, or "
            "multiply it by spring constant and sensitivity, and name the columns force (nN) and depth (nm)"
        )
    rows = list(parse_csv_rows(content, where, ("force_n",), ("time_s",), one_of=DEPTHS, ignore_others=True))
    if not rows:
        raise FileInputError(f"{where} must hold a curve below its headings; it has no row")
    keys = [key for key in ("force_n", "time_s", *DEPTHS) if key in rows[0]]
    columns = {key: np.array([_cell(row, key) for row in rows]) for key in keys}
    depth = next(key for key in DEPTHS if key in columns)
    curves = []
    for label, own in _parts(content, text, where):
        of_curve = {key: values[own] for key, values in columns.items()}
        names = (f"{where}, {label}", f"{name}, {label}") if label else (where, name)
        curves.append(_curve(*names, of_curve[depth], of_curve["force_n"], of_curve.get("time_s"), None, {}))
    return tuple(curves)


def _parts(content: bytes, text: str, where: str) -> list[tuple[str, Any]]:
    """Label and rows of each curve by the column that tells them apart; without such a column all rows of one.

    A column with that heading whose every value does not have the rows of a curve counts points, or tells segments.
    """
    for heading in CURVE_HEADINGS:
        if heading not in text[:HEAD].lower():
            continue
        own: dict[str, list[int]] = {}
        try:
            for number, row in enumerate(
                parse_csv_rows(content, where, ("force_n", heading), DEPTHS, ignore_others=True)
            ):
                own.setdefault(row.text(heading), []).append(number)
        except FileInputError:  # no such column, or one with a unit
            continue
        if 1 < len(own) <= MOST_CURVES and min(map(len, own.values())) >= LEAST_POINTS and all(own):
            return [(f"{heading} {one_line(value)[:40]}", rows) for value, rows in own.items()]
    return [("", slice(None))]


CHIARO_COLUMNS = ("Time (s)", "Load (uN)", "Cantilever (nm)", "Piezo (nm)")


def _chiaro_curve(text: str, name: str, where: str) -> ForceCurve:
    """A Chiaro text: the position is the piezo's less the cantilever's bending, not its column of indentation."""
    head, _, table = text.partition("\nTime (s)\t")
    headings, _, numbers = table.partition("\n")
    places = [
        f"Time (s)\t{headings}".strip().split("\t").index(each)
        for each in CHIARO_COLUMNS
        if each in f"Time (s)\t{headings}"
    ]
    stated = {match["name"].strip(): parse_number(match["value"]) for match in _CHIARO.finditer(head)}
    try:
        time, load, bent, piezo = np.loadtxt(io.StringIO(numbers.replace(",", ".")), usecols=places, ndmin=2).T
        radius = 1e-3 * stated["Tip radius (um)"]
    except (ValueError, KeyError, IndexError) as error:
        raise FileInputError(
            f"{where} must be a text of Chiaro with {', '.join(CHIARO_COLUMNS)} and the tip's radius; {one_line(error)}"
        ) from error
    recorded: dict[str, float | str] = {}
    for label, key, unit in (("maker_young_kpa", "E[v=0.500] (Pa)", 1e-3), ("spring_n_per_m", "k (N/m)", 1.0)):
        if key in stated:
            recorded[label] = unit * stated[key]
    return _curve(where, name, 1e-6 * (piezo - bent), 1e-6 * load, time, radius, recorded)


JPK_HEIGHTS = (
    *("smoothedMeasuredHeight", "measuredHeight", "smoothedStrainGaugeHeight", "strainGaugeHeight"),
    *("smoothedCapacitiveSensorHeight", "capacitiveSensorHeight", "height"),
)


def _jpk_text_curve(text: str, name: str, where: str) -> ForceCurve:
    """All segments of a text of JPK in their order: the tip is at the height plus the bending of the cantilever."""
    rows: list[list[float]] = []
    head: dict[str, str] = {}
    spring = np.inf
    try:
        for line in text.splitlines():
            if line.startswith("#"):
                key, _, value = line.strip("# ").partition(":")
                head[key.strip()] = value.strip()
            elif line.strip():
                columns = dict(
                    zip(head["columns"].split(), zip(line.split(), head["units"].split(), strict=True), strict=True)
                )
                spring = float(head.get("springConstant", np.inf))
                height = next(columns[each] for each in JPK_HEIGHTS if each in columns)
                time = columns.get("seriesTime", columns.get("time", ("nan", "s")))
                if (columns["vDeflection"][1], height[1]) != ("N", "m"):
                    raise FileInputError(
                        f"{where} must hold vDeflection in N and heights in m; got {columns['vDeflection'][1]!r:.20} "
                        f"and {height[1]!r:.20}: export it calibrated"
                    )
                rows.append([float(part) for part, _ in (height, columns["vDeflection"], time)])
    except (KeyError, ValueError, StopIteration) as error:
        raise FileInputError(
            f"{where} must be a text of JPK with vDeflection and a height, columns and units above; {one_line(error)}"
        ) from error
    height_m, force, time_s = np.array(rows).T if rows else np.empty((3, 0))
    times = None if not np.all(np.isfinite(time_s)) else time_s
    return _curve(where, name, -1e3 * (height_m + force / spring), force, times, None, {"spring_n_per_m": spring})


def _cell(row: Any, key: str) -> float:
    value = row.number(key)
    if value is None:
        raise row.refused(key, "a number in every row", "")
    return float(value)


def _curve(
    where: str, name: str, position: Any, force: Any, time: Any, radius_mm: float | None, recorded: dict[str, Any]
) -> ForceCurve:
    order = _order(time)
    if order is not None:
        position, force, time = (np.asarray(values)[order] for values in (position, force, time))
        recorded = {**recorded, "order": "rows sorted by time"}
    try:
        return ForceCurve(
            position_mm=position, force_n=force, time_s=time, name=name, radius_mm=radius_mm, recorded=recorded
        )
    except InputError as error:
        raise FileInputError(f"{where}: {error}") from error


def _order(time: Any) -> Any:
    """What puts rows into the order of time; None where they are, and where each of a few segments begins anew at 0."""
    times = np.asarray([] if time is None else time, dtype=float)
    if times.size < 2 or not np.isfinite(times).all() or len(np.unique(times)) < times.size:
        return None
    backward = int((np.diff(times) < 0).sum())
    return np.argsort(times) if backward > max(MOST_SEGMENTS, MUCH * times.size) else None


def _afm_curves(file: Path) -> Iterator[ForceCurve]:
    """Curves of a file that afmformats reads: tip positions are heights plus the bending of the cantilever."""
    afmformats = import_extra("afmformats", feature="reading this file of an atomic force microscope", extra="curves")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            data = list(afmformats.load_data(file))
            for number, item in enumerate(data[:MOST_CURVES], start=1):
                height = next(name for name in ("height (measured)", "height (piezo)", "tip position") if name in item)
                force = np.array(item["force"], dtype=float)
                spring = float(item.metadata.get("spring constant", np.inf))
                bent = 0.0 if height == "tip position" else force / spring
                # Heights fall towards the sample, and the bending takes the tip back from it.
                position = -(np.array(item[height], dtype=float) + bent)
                name = printable_name(file) + (f" {number}" if len(data) > 1 else "")
                time = np.array(item["time"], dtype=float) if "time" in item else None
                yield _curve(printable_path(file), name, 1e3 * position, force, time, None, {"spring_n_per_m": spring})
    except (FileInputError, MemoryError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a damaged file; errors of afmformats are no `Exception`
        raise file_error(
            file, f"must be a force curve that afmformats reads, or be exported as CSV; {one_line(error)}"
        ) from error

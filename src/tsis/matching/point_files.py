"""Read and write point sets: CSV, NPY and PLY files, and contours of images."""

from __future__ import annotations

import io
import itertools
import math
import re
from array import array
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
import skimage

from tsis.errors import FileInputError
from tsis.files.archive import npy_layout
from tsis.files.reading import as_path, file_size, printable_path, read_bytes, text_lines
from tsis.files.tables import parse_number, table_text
from tsis.matching.methods import MOST_POINTS

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from tsis.matching.methods import Floats

LONGEST_HEADER = 65_536
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
LARGEST_BYTES = 160 * 2**20
LARGEST_TABLE = 32 * 2**20  # of the most points with many digits, in UTF-16
AXES = ("x", "y", "z")
UNIT = re.compile(r"\s*(\[[^\]]*\]|\([^)]*\)|[_/ ]\s*(nm|um|µm|mm|cm|m|px|pixels?))$")  # at the end of a column's name
NO_COORDINATES = frozenset(("", "#", "id", "index", "frame", "no", "no.", "number", "nr", "point", "row", "label"))
LEAST_RUN = 4  # rows that a running number needs
NPY_MAGIC = b"\x93NUMPY"
IMAGE_MAGIC = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"BM", b"II*\0", b"MM\0*")
CONTOUR_POINTS, LEAST_CONTOUR = 100, 0.25
CONTOUR_SMOOTHING = 1.0  # standard deviation of the blur, in pixels


def read_points(path: str | os.PathLike[str]) -> Floats:
    """Read the points of a file; the format is detected by content, not by name.

    Raises `FileInputError` when the file is missing, invalid, of another kind, too large, or contains a value that is
    not a finite number; the message names the line or row.

    Parameters
    ----------
    path
        CSV, a point per line, with two or three columns, or any columns under a first line that names x and y (and z)
        in any order, with or without units, as ``x [mm]``; a column named id, index or frame, or an unnamed first or
        last one that numbers the rows from 0 or 1, is no coordinate. Commas, semicolons, tabs or spaces separate
        columns; between semicolons or tabs the decimal mark may be a comma. Text is in UTF-8, UTF-16 or Windows-1252;
        lines that begin with # are ignored, and so are XYZ's first lines, the number of points and a remark. NPY, an
        array of shape (n, 2) or (n, 3). PLY, text or binary, with vertices of x and y (and z); vertices of equal z are
        points of the plane. An image (PNG, JPEG, BMP or TIFF): `CONTOUR_POINTS` points evenly along the contours at
        Otsu's threshold that are at least `LEAST_CONTOUR` as long as the longest, in pixels with y upwards.

    Returns
    -------
    numpy.ndarray
        Shape (n, 2) or (n, 3), read-only.
    """
    path = as_path(path)
    size = file_size(path)
    if size > LARGEST_BYTES:
        raise FileInputError(
            f"{printable_path(path)} must be at most {LARGEST_BYTES // 2**20} MiB; got {size} bytes (thin "
            f"the points out)"
        )
    content = read_bytes(path)
    try:
        points = image_contours(path) if content.startswith(IMAGE_MAGIC) else _parsed(content)
    except FileInputError as error:
        raise FileInputError(f"{printable_path(path)}: {error}") from error
    points.flags.writeable = False
    return points


def read_pair(source: str | os.PathLike[str], target: str | os.PathLike[str]) -> tuple[Floats, Floats]:
    """Points of two files to match; where one has two coordinates, an equal z of all points of the other is left out.

    Raises `FileInputError` as `read_points`, and where one file holds points of the plane and the other of space.
    """
    files = as_path(source), as_path(target)
    first, second = read_points(files[0]), read_points(files[1])
    if first.shape[1] != second.shape[1]:
        first, second = (each[:, :2] if np.all(each[:, 2:] == each[0, 2:]) else each for each in (first, second))
    if first.shape[1] != second.shape[1]:
        raise FileInputError(
            f"both files must contain points of the plane or both of space; got {first.shape[1]} coordinates in "
            f"{printable_path(files[0])} and {second.shape[1]} in {printable_path(files[1])}"
        )
    return first, second


def csv_text(points: ArrayLike, **columns: ArrayLike) -> str:
    r"""Format points and further columns as CSV, which `read_points` reads back exactly.

    Parameters
    ----------
    points
        Shape (n, 2) or (n, 3).
    columns
        Further columns by name, shape (n,).

    Examples
    --------
    >>> csv_text([[0.5, 1.0]], match=[3])
    'x,y,match\n0.5,1.0,3\n'
    """
    coordinates = np.asarray(points, dtype=float)
    heads = [*AXES[: coordinates.shape[1]], *columns]
    values = [*coordinates.T.tolist(), *(np.asarray(column).tolist() for column in columns.values())]
    rows = (",".join(map(repr, row)) for row in zip(*values, strict=True))
    return "\n".join([",".join(heads), *rows]) + "\n"


def _parsed(content: bytes) -> Floats:
    if content.startswith(NPY_MAGIC):
        return _without_running_number(_finite(_npy(content), "row", 0))
    if content[:3] == b"ply" and content[3:4] in (b"\r", b"\n"):
        points = _finite(parse_ply(content, most=MOST_POINTS), "vertex", 0)
        flat = points.shape[1] == 3 and bool(np.all(points[:, 2] == points[0, 2]))
        return np.array(points[:, :2]) if flat else points
    return _csv(content)


def image_contours(path: str | os.PathLike[str]) -> Floats:
    """Points evenly along the contours of an image file, shape (n, 2), in pixels with y upwards; see `read_points`."""
    from tsis.instrument.image_files import read_image

    grey = np.asarray(read_image(path).grey, dtype=float)
    if grey.min() == grey.max():
        raise FileInputError(f"an image must show a contour; got {grey.shape[0]} x {grey.shape[1]} equal pixels")
    smooth = scipy.ndimage.gaussian_filter(grey, CONTOUR_SMOOTHING, mode="nearest")
    lines = skimage.measure.find_contours(smooth, float(skimage.filters.threshold_otsu(smooth)))  # type: ignore[no-untyped-call]
    lengths = [float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()) for line in lines]
    long = [number for number, length in enumerate(lengths) if length >= LEAST_CONTOUR * max(lengths)]
    total = sum(lengths[number] for number in long)
    parts = []
    for number in long:
        line, count = lines[number], max(round(CONTOUR_POINTS * lengths[number] / total), 3)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        at = np.linspace(0.0, along[-1], count, endpoint=not np.array_equal(line[0], line[-1]))
        rows, columns = (np.interp(at, along, line[:, axis]) for axis in range(2))
        parts.append(np.column_stack([columns, grey.shape[0] - 1 - rows]))
    return np.concatenate(parts)


def _csv(content: bytes) -> Floats:
    lines = [
        (number, line)
        for number, line in text_lines(_utf8(content), most=MOST_POINTS)
        if line.strip() and line.lstrip()[:1] != "#"
    ]
    if lines and lines[0][1].strip().isdigit() and int(lines[0][1]) in (len(lines) - 1, len(lines) - 2):
        del lines[: len(lines) - int(lines[0][1])]  # XYZ: the number of points, and perhaps a remark
    if not lines:
        raise FileInputError("it must hold points; got none")
    first = lines[0][1]
    separator = next((mark for mark in ";\t," if mark in first), None)
    heads = [head.strip().strip('"').lower() for head in first.split(separator)]
    named = any(heads) and not any(_is_number(head) or head[:1].isdigit() for head in heads)
    chosen = _columns(heads, named=named)
    rows = [(number, line.split(separator)) for number, line in (lines[1:] if named else lines)]
    _countable(len(rows), MOST_POINTS)
    between = separator in (";", "\t")  # else a comma separates
    decimal_comma = between and any("," in cells[place] for _, cells in rows for place in chosen if place < len(cells))
    values = array("d")
    for number, cells in rows:
        values.extend(_row(number, cells, chosen, len(heads), decimal_comma=decimal_comma))
    points = np.array(values).reshape(-1, len(chosen))
    return points if named else _without_running_number(points)


def _utf8(content: bytes) -> bytes:
    """A text in UTF-8; `FileInputError` where the bytes are no table of text.

    Bytes that are larger than any table are not decoded: their lines are refused one by one.
    """
    if len(content) > LARGEST_TABLE:
        return content
    try:
        text = table_text(content, "it")
    except FileInputError as error:
        raise FileInputError("it must be CSV, NPY or PLY, or an image; got bytes that are none of these") from error
    if text.lstrip()[:1] in ("[", "{", "<"):
        raise FileInputError(f"it must be CSV, NPY or PLY, or an image; got a text that begins {text.lstrip()[:20]!r}")
    return text.encode()


def _columns(heads: list[str], *, named: bool) -> list[int]:
    """Indices of the coordinate columns; without names all, one of which may be a running number."""
    if not named:
        if len(heads) not in (2, 3, 4):
            raise FileInputError(
                f"it must have 2 or 3 columns; got {len(heads)} (or name x, y and z among them in the first line)"
            )
        return list(range(len(heads)))
    names = [UNIT.sub("", head).strip() for head in heads]
    for axis in AXES:
        if names.count(axis) > 1:
            raise FileInputError(f"its first line must name {axis} once; got {names.count(axis)} columns of that name")
    if "x" in names and "y" in names:
        return [names.index(axis) for axis in AXES if axis in names]
    left = [number for number, name in enumerate(names) if name not in NO_COORDINATES]
    if len(left) not in (2, 3):
        raise FileInputError(
            f"it must have 2 or 3 columns; got {len(left)} that are no index (or name x, y and z among them)"
        )
    return left


def _without_running_number(points: Floats) -> Floats:
    """Points, shape (n, 2) or (n, 3), of unnamed columns, of which the first or the last may number the rows."""
    width = points.shape[1]
    if width > 2 and len(points) >= LEAST_RUN:
        for place in (0, width - 1):
            if np.all(np.diff(points[:, place]) == 1.0) and points[0, place] in (0.0, 1.0):
                return np.delete(points, place, axis=1)
    if width > 3:
        raise FileInputError(f"it must have 2 or 3 columns; got {width} (or name x, y and z among them)")
    return points


def _row(number: int, cells: list[str], chosen: list[int], width: int, *, decimal_comma: bool) -> list[float]:
    if len(cells) != width:
        raise FileInputError(f"line {number} must have {width} columns as the first one; got {len(cells)}")
    values = []
    for column in chosen:
        value = _number(cells[column], decimal_comma=decimal_comma)
        if value is None or not math.isfinite(value):
            raise FileInputError(f"line {number} must hold finite numbers; got {cells[column].strip()!r:.40}")
        values.append(value)
    return values


def _is_number(cell: str) -> bool:
    return any(_number(cell, decimal_comma=mark) is not None for mark in (False, True))


def _number(cell: str, *, decimal_comma: bool) -> float | None:
    if decimal_comma:
        value = parse_number(cell, decimal_comma=True)
        return None if math.isnan(value) else value
    try:
        return float(cell)
    except ValueError:
        return None


def _npy(content: bytes) -> Floats:
    layout = npy_layout(content)
    shape, itemsize = layout.shape, layout.dtype.itemsize
    if layout.dtype.kind not in "fiu":
        raise FileInputError(f"the array must hold real numbers; got {layout.dtype!s:.40}")
    if len(shape) != 2 or shape[1] not in (2, 3):
        raise FileInputError(f"the array must have the shape (n, 2) or (n, 3); got {shape!s:.60}")
    _countable(shape[0])
    left = len(content) - layout.start
    if left != math.prod(shape) * itemsize:
        raise FileInputError(f"{shape[0]} points take {math.prod(shape) * itemsize} bytes; got {left}")
    return np.array(layout.values(content), dtype=float)


@dataclass(frozen=True, slots=True, kw_only=True)
class Vertices:
    """Vertices as declared in a PLY header."""

    order: str  # NumPy's code of the byte order; empty for text
    count: int  # number of vertices
    types: dict[str, str]  # NumPy's type of each property, by name, in order


def parse_ply(content: bytes, *, most: int) -> Floats:
    r"""Coordinates of the vertices of a file's content, shape (n, 2) or (n, 3); at most ``most`` of them.

    Raises `FileInputError` when the header or the data are invalid, or the vertices are not the first element.

    Examples
    --------
    >>> header = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n"
    >>> parse_ply(header + b"1.5 2\n", most=10).tolist()
    [[1.5, 2.0]]
    """
    head, mark, body = content[:LONGEST_HEADER].partition(b"end_header")
    if not mark:
        raise FileInputError(f"the PLY header must end within {LONGEST_HEADER} bytes; got none that does")
    start = len(head) + len(mark)
    start += 2 if body[:2] == b"\r\n" else 1
    vertices = _vertices(head.decode("ascii", errors="replace").splitlines())
    axes = [axis for axis in ("x", "y", "z") if axis in vertices.types]
    if axes[:2] != ["x", "y"]:
        raise FileInputError(f"PLY vertices must have x and y; got {', '.join(vertices.types)[:80]!r}")
    _countable(vertices.count, most)
    return _text(content[start:], vertices, axes) if not vertices.order else _binary(content[start:], vertices, axes)


def _vertices(lines: list[str]) -> Vertices:
    order, count, types, element = None, None, {}, 0
    for line in lines[1:]:
        text = line.split()
        try:
            if text[:1] == ["format"]:
                order = FORMATS[text[1]]
            elif text[:1] == ["element"]:
                element += 1
                if element == 1 and text[1] == "vertex":
                    count = int(text[2])
            elif text[:1] == ["property"] and element == 1:
                if text[2] in types:
                    raise FileInputError(f"PLY vertices must have each property once; got {text[2]!r:.40} twice")
                types[text[2]] = TYPES[text[1]]
        except (KeyError, IndexError, ValueError) as error:
            if isinstance(error, FileInputError):
                raise
            raise FileInputError(f"a PLY header line must have a known form; got {line.strip()!r:.60}") from error
    if order is None or count is None:
        raise FileInputError("a PLY header must give a format, and vertices as the first element")
    return Vertices(order=order, count=count, types=types)


def _text(body: bytes, vertices: Vertices, axes: Sequence[str]) -> Floats:
    positions = [list(vertices.types).index(axis) for axis in axes]
    points = array("d")
    for number, row in enumerate(itertools.islice(io.BytesIO(body), vertices.count)):
        cells = row.split()
        try:
            points.extend([float(cells[position]) for position in positions])
        except (IndexError, ValueError) as error:
            text = row.decode("ascii", errors="replace").strip()
            raise FileInputError(f"vertex {number} must hold numbers for each property; got {text!r:.60}") from error
    held = len(points) // len(axes)
    if held < vertices.count:
        raise FileInputError(f"it must hold the {vertices.count} vertices of its header; got {held}")
    return np.array(points).reshape(-1, len(axes))


def _binary(body: bytes, vertices: Vertices, axes: Sequence[str]) -> Floats:
    layout = np.dtype([(name, vertices.order + kind) for name, kind in vertices.types.items()])
    needed = vertices.count * layout.itemsize
    if len(body) < needed:
        raise FileInputError(f"the {vertices.count} vertices of its header take {needed} bytes; got {len(body)}")
    rows = np.frombuffer(body, dtype=layout, count=vertices.count)
    return np.column_stack([rows[axis].astype(float) for axis in axes])


def _finite(points: Floats, what: str, first: int) -> Floats:
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise FileInputError(f"{what} {bad[0] + first} must be finite; got {points[bad[0]].tolist()}")
    return points


def _countable(count: int, most: int = MOST_POINTS) -> None:
    if count < 1:
        raise FileInputError(f"it must hold at least 1 point; got {count}")
    if count > most:
        raise FileInputError(f"it must hold at most {most} points; got {count} (thin them out)")

"""A scan on disk: a folder with ``poses.csv`` beside its presses, or one table of presses by an indenter.

``poses.csv`` has a row a press: the file that it measured, and its place. The file is a frame, or a table of the mean
pressure of each ring or sector, or a table of travel and force. One table of travel and force serves many presses.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.calibration.frames import PICTURES, read_press_image
from tsis.errors import FileInputError, InputError, NotCalibratedError
from tsis.files.reading import as_path, file_error, own_file
from tsis.files.tables import read_csv_rows, table_bytes
from tsis.mapping.scan import Scan, ScanPress

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.calibration.frames import UsableCalibration
    from tsis.files.tables import CsvRow
    from tsis.mapping.scan import Indenter
    from tsis.model.calibration import Calibration


POSES_FILE = "poses.csv"
KINDS = ("press", "reference")
POSE_COLUMNS = ("angle_deg", "place_sd_mm", "force_n", "force_sd", "noise_kpa", "kind", "probe", "name")
NUMBERS = ("angle_deg", "place_sd_mm", "force_n", "force_sd", "noise_kpa")
TRAVEL_FORCE = ("travel_mm", "force_n")
MOST_PRESSES = 1000
SAME_PLACE_MM, WIDEST_MM = 0.25, 1.0  # rows of a table this near are at one place; of the rows of one numbered press
IN, OUT = 0.7, 0.3  # of the range of travel: past the one after the other a press ends, and the next begins
FREE_POINTS, FREE_SHARE, FREE_CHANGE = 20, 0.1, 0.05  # points of a curve whose first tenth may show the force's zero


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredScan:
    """A scan as it was read.

    Attributes
    ----------
    scan
        The presses with a place; those without are named in its ``left_out``.
    probe
        Name of the probe that the folder states; empty where it states none.
    """

    scan: Scan
    probe: str = ""


def read_scan(
    path: str | os.PathLike[str],
    *,
    mm_per_pixel: tuple[float, float] | None = None,
    indenter: Indenter | None = None,
) -> StoredScan:
    """Read a scan from a folder with ``poses.csv``, or from one table of presses by an indenter.

    Parameters
    ----------
    path
        The folder, whose ``poses.csv`` has the columns file, x_mm and y_mm, and if known angle_deg, place_sd_mm,
        force_n, force_sd, noise_kpa, kind (press or reference), probe and name. Or a table with the columns press,
        x_mm, y_mm, travel_mm and force_n, and if known place_sd_mm; without press, rows at one place are one press as
        long as the indenter goes in once.
    mm_per_pixel
        Size of a pixel of the frames along x and y in mm.
    indenter
        What pressed, for travel and force.

    Raises
    ------
    FileInputError
        When the folder, a table or a press cannot be read, or several probes pressed.
    InputError
        When a value lies outside its range, or fewer than two presses have a place.
    """
    source = as_path(path)
    if source.is_file():
        return _of_table(source, indenter)
    poses = source / POSES_FILE
    if not source.is_dir() or not poses.is_file():
        raise file_error(source, f"must be a folder with {POSES_FILE}, or a table of travel and force")
    rows = list(read_csv_rows(poses, ("file", "x_mm", "y_mm"), POSE_COLUMNS))
    if len(rows) > MOST_PRESSES:
        raise file_error(poses, f"must list at most {MOST_PRESSES} presses; got {len(rows)}")
    probes = sorted({row.text("probe") for row in rows} - {""})
    if len(probes) > 1:
        raise file_error(poses, f"must be of one probe; got {' and '.join(probes)}: map each probe's presses by itself")
    presses, left_out = [], []
    for row in rows:
        name = row.text("name") or row.text("file")
        if row.number("x_mm") is None or row.number("y_mm") is None:
            left_out.append(f"{name} has no place.")
            continue
        presses.append(_press(source, row, name, mm_per_pixel))
    _require_files_of_their_own(rows)
    try:
        scan = Scan(presses=tuple(presses), indenter=indenter, name=source.name, left_out=tuple(left_out))
    except InputError as error:
        raise FileInputError(f"{error} ({POSES_FILE} of {source.name!r})") from error
    return StoredScan(scan=scan, probe=probes[0] if probes else "")


def _require_files_of_their_own(rows: Sequence[CsvRow]) -> None:
    """`FileInputError` where one file is to be the press at several places."""
    first: dict[str, CsvRow] = {}
    for row in rows:
        if _without_place(row):
            continue
        other = first.setdefault(row.text("file"), row)
        if any(row.number(axis) != other.number(axis) for axis in ("x_mm", "y_mm")):
            line = other.where.rpartition(", ")[2]
            raise row.refused(
                "file", f"a press of its own: {line} has the same file at another place", row.text("file")
            )


def _press(folder: Path, row: CsvRow, name: str, mm_per_pixel: tuple[float, float] | None) -> ScanPress:
    try:
        file = own_file(folder, row.text("file"))
    except FileInputError as error:
        raise FileInputError(f"{error} ({row.where})") from error
    kind = row.text("kind") or KINDS[0]
    if kind not in KINDS:
        raise row.refused("kind", " or ".join(KINDS), kind)
    given: dict[str, Any] = {key: value for key in NUMBERS if (value := row.number(key)) is not None}
    if file.suffix.lower() in PICTURES:
        given["frame"] = read_press_image(file, mm_per_pixel=mm_per_pixel)
    else:
        given |= _measured(file)
    try:
        return ScanPress(
            place_mm=(float(row.number("x_mm") or 0.0), float(row.number("y_mm") or 0.0)),
            reference=kind == KINDS[1],
            name=name,
            **given,
        )
    except InputError as error:
        raise FileInputError(f"{error} ({row.where})") from error


def _measured(file: Path) -> dict[str, Any]:
    """Pressures of rings or sectors, or travel and force, as the headings of the table say."""
    columns = ("ring", "sector", "pressure_kpa", "travel_mm", "force_n")
    rows = list(read_csv_rows(file, (), columns))
    cells = {name: [row.number(name) for row in rows] for name in columns}
    if rows and None not in (*cells["travel_mm"], *cells["force_n"]):
        return {"travel_force": loading_part(*(np.array(cells[name], dtype=float) for name in TRAVEL_FORCE))}
    if not rows or None in (*cells["ring"], *cells["pressure_kpa"]):
        raise file_error(file, "must have the columns travel_mm and force_n, or ring, sector and pressure_kpa")
    order = {
        (ring, 1.0 if sector is None else sector): value
        for ring, sector, value in zip(cells["ring"], cells["sector"], cells["pressure_kpa"], strict=True)
    }
    rings, sectors = (len({key[axis] for key in order}) for axis in (0, 1))
    whole = len(order) == len(rows) == rings * sectors
    if not whole or sorted(order) != [(1.0 + ring, 1.0 + sector) for ring in range(rings) for sector in range(sectors)]:
        raise file_error(file, "must have each ring from 1 on, and each sector from 1 on, once")
    values = np.array([order[key] for key in sorted(order)], dtype=float).reshape(rings, sectors)
    return {"pressure_kpa": values[:, 0] if sectors == 1 else values}


def _of_table(table: Path, indenter: Indenter | None) -> StoredScan:
    """Presses of a robot's force sensor: a row for each pair of travel and force.

    Rows of one press share its number. Without a column of numbers, rows at one place are a press as long as the
    indenter goes in once.
    """
    rows = list(read_csv_rows(table, ("x_mm", "y_mm", *TRAVEL_FORCE), ("press", "place_sd_mm"), ignore_others=True))
    numbered = bool(rows) and "press" in rows[0]
    groups, left_out = _numbered(rows) if numbered else _at_places(rows)
    if len(groups) > MOST_PRESSES:
        raise file_error(
            table, f"must hold at most {MOST_PRESSES} presses; got {len(groups)}: number them in a column press"
        )
    presses = []
    for name, group in groups:
        pairs = loading_part(*(np.array([_number(row, column) for row in group]) for column in TRAVEL_FORCE))
        x_mm, y_mm = np.median(_places(group), axis=0).tolist()
        try:
            presses.append(
                ScanPress(
                    place_mm=(x_mm, y_mm),
                    place_sd_mm=group[0].number("place_sd_mm") or 0.0,
                    travel_force=pairs,
                    name=name,
                )
            )
        except InputError as error:
            raise FileInputError(f"{error} (press {name} from {group[0].where} on)") from error
    if len(presses) < 2 and numbered:
        raise file_error(
            table,
            f"must hold several presses; its column press numbers {len(presses)}: number each press, or leave the "
            "column out, and the rows at one place are one press",
        )
    try:
        scan = Scan(presses=tuple(presses), indenter=indenter, name=table.stem, left_out=tuple(left_out))
    except InputError as error:
        raise FileInputError(f"{error} ({table.name})") from error
    return StoredScan(scan=scan)


def _number(row: CsvRow, column: str) -> float:
    value = row.number(column)
    if value is None:
        raise row.refused(column, "a number in each row of a press", "an empty cell")
    return value


def _place(row: CsvRow) -> tuple[float, float]:
    return _number(row, "x_mm"), _number(row, "y_mm")


def _without_place(row: CsvRow) -> bool:
    return row.number("x_mm") is None or row.number("y_mm") is None


def _places(group: Sequence[CsvRow]) -> NDArray[np.float64]:
    """Places of the rows that have one, shape (n, 2)."""
    return np.array([_place(row) for row in group if not _without_place(row)])


def _numbered(rows: Sequence[CsvRow]) -> tuple[list[tuple[str, list[CsvRow]]], list[str]]:
    """The rows of each number, and a sentence for each press without a place.

    `FileInputError` for a number at several places: programs count anew on each line of a scan.
    """
    grouped: dict[str, list[CsvRow]] = {}
    for row in rows:
        grouped.setdefault(row.text("press"), []).append(row)
    groups, left_out = [], []
    for name, group in grouped.items():
        if all(_without_place(row) for row in group):
            left_out.append(f"press {name} has no place.")
            continue
        span = np.ptp(_places(group), axis=0)
        if span.max() > WIDEST_MM:
            raise FileInputError(
                f"press must be a number that no other press of the table has; the rows of press {name} lie up to "
                f"{span.max():.3g} mm apart: number all presses through, or leave the column out ({group[0].where})"
            )
        groups.append((name, group))
    return groups, left_out


def _at_places(rows: Sequence[CsvRow]) -> tuple[list[tuple[str, list[CsvRow]]], list[str]]:
    """The rows of each press, told by their places and by travel that begins anew; and what is left out."""
    places: list[list[CsvRow]] = []
    starts = np.empty((len(rows), 2))
    latest, lost = 0, 0
    for row in rows:
        if _without_place(row):
            lost += 1
            continue
        place = np.array(_place(row))
        if not places or np.abs(starts[latest] - place).max() > SAME_PLACE_MM:
            apart = np.abs(starts[: len(places)] - place).max(axis=1) if places else np.array([])
            latest = int(apart.argmin()) if len(places) and apart.min() <= SAME_PLACE_MM else len(places)
            if latest == len(places):
                starts[latest] = place
                places.append([])
        places[latest].append(row)
    alone = sum(len(group) == 1 for group in places)
    told = ((lost, "Rows without a place"), (alone, "Rows that are alone at their place"))
    left_out = [f"{what}: {count}." for count, what in told if count]
    groups = []
    for group in places:
        travel, force = (np.array([_number(row, column) for row in group]) for column in TRAVEL_FORCE)
        ends = [*_visits(travel, force), len(group)]
        for number, (begin, end) in enumerate(pairwise(ends), start=1):
            x_mm, y_mm = _place(group[begin])
            name = f"{x_mm:g}, {y_mm:g}" + (f" ({number})" if number > 1 else "")
            if end - begin > 1:
                groups.append((name, group[begin:end]))
    return groups, left_out


def _visits(travel_mm: NDArray[np.float64], force_n: NDArray[np.float64]) -> list[int]:
    """Where each press at one place begins: its first row, then each row in which the indenter turns back in."""
    reach = float(np.ptp(travel_mm))
    if reach == 0:
        return [0]
    deepest = travel_mm[int(np.argmax(np.abs(force_n - force_n[0])))]
    share = (travel_mm - travel_mm.min()) / reach
    share = share if deepest >= travel_mm[0] else 1 - share
    begins, pressed, turn = [0], False, -1
    for row, now in enumerate(share.tolist()):
        if pressed and now <= OUT:
            pressed, turn = False, row
        elif not pressed and turn >= 0 and now < share[turn]:
            turn = row
        elif not pressed and now >= IN:
            pressed = True
            if turn >= 0:
                begins.append(turn)
    return begins


def loading_part(travel_mm: NDArray[np.float64], force_n: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part of a press on the way in, as pairs of travel and force, shape (n, 2), with ascending travel.

    Rows after the deepest one, and rows in which the indenter rests or goes back, are left out. A program may count
    compression as negative force, and travel from above downwards: the signs are those of a press into the tissue. A
    force that stands still over the first tenth of the travel is the zero, and is taken off.
    """
    change = force_n - force_n[0]
    force = -force_n if -change.min() > 2 * change.max() else force_n
    deepest = int(np.argmax(force))
    travel = -travel_mm if travel_mm[deepest] < travel_mm[0] else travel_mm
    before = np.maximum.accumulate(np.concatenate([[-np.inf], travel[:-1]]))
    going_in = (travel > before) & (np.arange(len(travel)) <= int(np.argmax(travel)))
    pairs = np.column_stack([travel, force])[going_in]
    free = pairs[pairs[:, 0] <= pairs[0, 0] + FREE_SHARE * (pairs[-1, 0] - pairs[0, 0]), 1]
    first, second = np.median(free[: (len(free) + 1) // 2]), np.median(free[len(free) // 2 :])
    if len(pairs) >= FREE_POINTS and abs(second - first) < FREE_CHANGE * np.ptp(pairs[:, 1]):
        pairs[:, 1] -= np.median(free)
    return pairs


def scan_files(scan: Scan, *, probe: str = "") -> dict[str, bytes]:
    """The files of a folder that `read_scan` reads, of presses with pressures or with travel and force.

    Raises `InputError` for a scan of frames, whose files are kept as they are.
    """
    if scan.kind == "frame":
        raise InputError("scan must hold pressures, or travel and force; frames stay in their own files")
    files: dict[str, bytes] = {}
    poses: list[Sequence[Any]] = [("file", "x_mm", "y_mm", *POSE_COLUMNS)]
    for number, press in enumerate(scan.presses, start=1):
        file = f"press-{number:03d}.csv"
        files[file] = table_bytes(_rows(press))
        kind = KINDS[1] if press.reference else KINDS[0]
        numbers = (getattr(press, name) for name in NUMBERS)
        poses.append((file, *press.place_mm, *numbers, kind, probe, press.name or file))
    return {**files, POSES_FILE: table_bytes(poses)}


def _rows(press: ScanPress) -> list[Sequence[Any]]:
    if press.travel_force is not None:
        return [("travel_mm", "force_n"), *press.travel_force.tolist()]
    values = np.asarray(press.pressure_kpa)
    values = values.reshape(len(values), -1)
    cells = [
        (ring, sector, value)
        for ring, row in enumerate(values.tolist(), start=1)
        for sector, value in enumerate(row, start=1)
    ]
    return [("ring", "sector", "pressure_kpa"), *cells]


def calibrated(scan: Scan, usable: UsableCalibration | None) -> tuple[Scan, Calibration | None]:
    """The scan with the frames that a calibration corrected, and its response; other scans stay as they are.

    Raises `NotCalibratedError` for frames without a calibration.
    """
    if scan.kind != "frame":
        return scan, None
    if usable is None:
        raise NotCalibratedError("frames must come with the calibration of the probe that pressed; got none")
    raw = [replace(press.frame, force_n=press.measured_force_n) for press in scan.presses if press.frame]
    frames, response = usable.pressed(raw, on_tissue=True)  # which reads the forces that nobody stated
    pairs = zip(scan.presses, frames, strict=True)
    return replace(scan, presses=tuple(replace(press, frame=frame) for press, frame in pairs)), response


def described(scan: Scan) -> Mapping[str, Any]:
    """Names and places of the presses, for a result."""
    return {
        "name": scan.name,
        "kind": scan.kind,
        "presses": [{"name": press.name, "place_mm": list(press.place_mm)} for press in scan.presses],
    }

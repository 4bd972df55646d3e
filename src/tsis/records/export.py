"""Atomic exports of a target as tables and pictures."""

from __future__ import annotations

import hashlib
import json
import math
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.files.atomic import atomic_file, atomic_folder
from tsis.files.canonical_json import json_bytes
from tsis.files.images import QUICK_PNG, encode_picture
from tsis.files.json_values import free_to_json
from tsis.files.reading import as_path, file_error
from tsis.files.tables import table_bytes
from tsis.model.estimate import INTERVAL_LEVEL, NO_UNIT, label_of, unit_of

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from tsis.model.estimate import Estimate
    from tsis.records.values import StoredEstimate, StoredPress, Target, TargetRecord


@contextmanager
def export_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """As `tsis.files.atomic.atomic_file`; `FileInputError` when the name is taken, or it cannot be written."""
    target = as_path(path)
    with _refusing(target), atomic_file(target) as draft:
        yield draft


@contextmanager
def export_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """As `tsis.files.atomic.atomic_folder`; `FileInputError` when the name is taken, or it cannot be written."""
    target = as_path(path)
    with _refusing(target), atomic_folder(target) as draft:
        yield draft


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    try:
        yield
    except FileExistsError as error:
        raise file_error(path, "must be a new name; there is such a file or folder (choose another)") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise file_error(path, f"must be a place that can be written; got: {reason}") from error


def frame_png(record: TargetRecord, press: StoredPress) -> bytes:
    """The frame of a press as a grey PNG file of 8 or 16 bits; `RecordsError` when it does not match its press."""
    return encode_picture(record.levels(press), level=QUICK_PNG)


PRESS_HEADINGS = (
    "press",
    "role",
    "taken",
    "force (N)",
    "pixel size x (mm)",
    "pixel size y (mm)",
    "axis x (px)",
    "axis y (px)",
    "rows (px)",
    "columns (px)",
    "full scale (grey level)",
    "probe",
    "flags",
    "name",
    "note",
    "frame file",
    "frame (SHA-256)",
    "calibration (SHA-256)",
    "settings (JSON)",
    "id",
    "version",
)
ESTIMATE_HEADINGS = (
    "estimate",
    "in force",
    "kind",
    "made",
    "parameter",
    "unit",
    "mean (in unit)",
    "sd (in unit)",
    f"{INTERVAL_LEVEL:.0%} interval from (in unit)",
    f"{INTERVAL_LEVEL:.0%} interval to (in unit)",
    "prior sd (in unit)",
    "Cramer-Rao sd (in unit)",
    "narrowing (posterior sd / prior sd)",
    "identified",
    "trusted",
    "presence (probability)",
    "flags",
    "notes",
    "prior",
    "probe",
    "presses",
    "calibration (SHA-256)",
    "supersedes",
    "id",
)

MAP_HEADINGS = (
    *("map", "in force", "made", "trusted", "lump", "probability of the lump", "parameter", "unit"),
    *ESTIMATE_HEADINGS[6:10],
    *("contrast above", "flags", "notes", "probe", "presses", "calibration (SHA-256)", "supersedes", "id"),
)


def target_rows(target: Target) -> list[list[Any]]:
    """Headings and the row of the target."""
    row: dict[str, Any] = {"target": target.number, "kind": target.kind, "name": target.name, "note": target.note}
    row |= {"made": target.made.isoformat(), "id": target.id, "version": target.version}
    for name, value in target.truth.items():
        unit = unit_of(name)
        row[f"true {label_of(name)}" + ("" if unit == NO_UNIT else f" ({unit})")] = value
    return [list(row), list(row.values())]


def press_rows(record: TargetRecord, frame_files: Sequence[str]) -> list[Sequence[Any]]:
    """Headings and a row for each press."""
    rows: list[Sequence[Any]] = [PRESS_HEADINGS]
    for number, (press, file) in enumerate(zip(record.presses, frame_files, strict=True), start=1):
        pixel = (None, None) if press.mm_per_pixel is None else press.mm_per_pixel
        numbers = [number, press.role, press.taken.isoformat(), _float(press.force_n), *map(_float, pixel)]
        numbers += [*map(_float, press.axis_px), press.rows, press.columns, _float(press.full_scale)]
        texts = [press.probe, " ".join(press.flags), press.name, press.note, file, press.frame, press.calibration]
        settings = json.dumps(free_to_json(press.settings, "settings"), sort_keys=True, allow_nan=False)
        rows.append([*numbers, *texts, settings, press.id, press.version])
    return rows


def estimate_rows(record: TargetRecord) -> list[Sequence[Any]]:
    """Headings and a row for each parameter of each estimate."""
    rows: list[Sequence[Any]] = [ESTIMATE_HEADINGS]
    for number, stored in enumerate(record.estimates, start=1):
        rows += _parameter_rows(number, stored, in_force=stored in record.active_estimates)
    return rows


def _parameter_rows(number: int, stored: StoredEstimate, *, in_force: bool) -> Iterator[list[Any]]:
    estimate = stored.estimate
    numbers = _numbers(estimate)
    for name in estimate.names:
        yield [
            number,
            in_force,
            stored.kind,
            stored.made.isoformat(),
            name,
            unit_of(name),
            *numbers[name],
            estimate.identified(name),
            estimate.trusted,
            _float(estimate.printed_presence),
            " ".join(estimate.flags),
            " ".join(estimate.printed_notes),
            estimate.prior,
            stored.probe,
            " ".join(stored.presses),
            stored.calibration,
            stored.supersedes,
            stored.id,
        ]


def map_rows(record: TargetRecord) -> list[Sequence[Any]]:
    """Headings and a row for each parameter of each lump of each map; one row for a map that shows no lump."""
    rows: list[Sequence[Any]] = [MAP_HEADINGS]
    for number, stored in enumerate(record.maps, start=1):
        found = stored.estimate
        head = [number, stored is record.map, stored.made.isoformat(), found.trusted]
        told = [" ".join(texts) for texts in (found.flags, found.notes)]
        tail = [*told, stored.probe, " ".join(stored.presses), stored.calibration, stored.supersedes, stored.id]
        lumps = [
            [lump.name, float(lump.probability), name, unit_of(name), *numbers[:4], lump.contrast_above]
            for lump in (found.lumps if found.trusted else ())
            for name, numbers in _numbers(lump.estimate).items()
        ]
        rows += [[*head, *cells, *tail] for cells in lumps or [[None] * 9]]
    return rows


def _numbers(estimate: Estimate) -> dict[str, list[Any]]:
    """Mean, sd, interval, prior sd, Cramer-Rao sd and narrowing by parameter; the prior alone if not trusted."""
    if not estimate.trusted:
        return {name: [None] * 4 + [_float(prior), None, None] for name, prior in estimate.prior_sd.items()}
    mean, sd, narrowing, interval = estimate.mean, estimate.sd, estimate.narrowing, estimate.interval(INTERVAL_LEVEL)
    rows: dict[str, list[Any]] = {}
    for name, prior in estimate.prior_sd.items():
        bound = estimate.cramer_rao_sd.get(name)
        least = "infinite" if bound == math.inf else _float(bound)
        rows[name] = [mean.get(name), sd.get(name), *interval[name], _float(prior), least, narrowing[name]]
    return rows


def _float(value: float | None) -> float | None:
    """A Python number, which prints without its type."""
    return None if value is None else float(value)


FORMAT, VERSION = "tsis-csv", 1
MAPS = "maps.csv        one row a map, lump and parameter, in the order of making; a bundle has the volumes\n"

README = f"""Target {{number}}, written by tsis {__version__}

{RESEARCH_USE_ONLY}

target.csv      what was pressed; of a phantom its true values
presses.csv     one row a press, in the order in which they were taken
estimates.csv   one row an estimate and parameter, in the order of making; "in force" is the last one of each kind
{{maps}}\
frames/         the grey levels as the camera gave them, PNG of 8 or 16 bits; presses.csv names the file of each press
manifest.json   SHA-256 and size in bytes of every file

Comma-separated values after RFC 4180: UTF-8, lines end in CR LF, cells are quoted where they must be, decimals have a
point. Headings hold the unit; in estimates.csv the column "unit" says it row by row. An empty cell says that nobody
measured it, or that the number is withheld. Times are ISO 8601 with their offset from UTC.

Text that a spreadsheet could take for a formula, because it begins with = + - @ or a tab, has an apostrophe in front,
and so has text that begins with an apostrophe: take one away to have what was entered. Numbers are never changed.

Where "trusted" is no, the model did not hold, and there is no result: the cells are empty. Where "identified" is no,
the data add hardly anything to the prior, and the cells of mean and sd are empty: use the interval.
"""


def csv_files(record: TargetRecord) -> dict[str, bytes]:
    """The files of the export by name, all in memory; `RecordsError` when a frame does not match its press."""
    return dict(_parts(record))


def write_csv(record: TargetRecord, folder: str | os.PathLike[str]) -> None:
    """Write the files into a new folder, frame by frame and atomically.

    Raises
    ------
    FileInputError
        When the folder exists or cannot be written.
    RecordsError
        When a frame does not match its press.
    """
    with export_folder(folder) as draft:
        (draft / "frames").mkdir()
        for name, content in _parts(record):
            (draft / name).write_bytes(content)


def _parts(record: TargetRecord) -> Iterator[tuple[str, bytes]]:
    entries: dict[str, dict[str, Any]] = {}
    for name, content in _content(record):
        entries[name] = {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
        yield name, content
    head = {"format": FORMAT, "version": VERSION, "notice": RESEARCH_USE_ONLY, "tsis": __version__}
    yield "manifest.json", json_bytes(head | {"files": entries})


def _content(record: TargetRecord) -> Iterator[tuple[str, bytes]]:
    names = frame_names(record)
    yield "target.csv", table_bytes(target_rows(record.target))
    yield "presses.csv", table_bytes(press_rows(record, names))
    yield "estimates.csv", table_bytes(estimate_rows(record))
    if record.maps:
        yield "maps.csv", table_bytes(map_rows(record))
    yield "README.txt", README.format(number=record.target.number, maps=MAPS if record.maps else "").encode()
    for press, name in zip(record.presses, names, strict=True):
        yield name, frame_png(record, press)


def frame_names(record: TargetRecord) -> list[str]:
    """File names of the frames."""
    return [f"frames/{number:05d}-{press.role}.png" for number, press in enumerate(record.presses, start=1)]

"""CSV tables: true values of targets, and readings of other devices."""

from __future__ import annotations

import hashlib
import math
from typing import TYPE_CHECKING, Any

from tsis.__about__ import __version__
from tsis.catalog import load_phantom
from tsis.errors import FileInputError, InputError, import_extra
from tsis.files import (
    LARGEST_CSV_BYTES,
    CsvRow,
    as_path,
    file_error,
    parse_csv_rows,
    printable_name,
    read_bytes,
    read_csv_rows,
    table_bytes,
)
from tsis.model import Inclusion, Phantom, require_number
from tsis.study._folder import enter_readings, user
from tsis.study._values import QUANTITIES, DeviceReading, TargetTruth, require_short_name

if TYPE_CHECKING:
    import os

    from tsis.study._folder import Study


COLUMNS = ("label", "diameter_mm", "depth_mm", "young_kpa")
MORE_COLUMNS = ("offset_mm", "tissue_kpa", "thickness_mm", "poisson")


def read_truth_table(path: str | os.PathLike[str]) -> tuple[TargetTruth, ...]:
    """Read targets from a file with the columns `COLUMNS`, and optionally `MORE_COLUMNS`.

    Parameters
    ----------
    path
        Comma-separated values in UTF-8. A row whose diameter, depth and modulus are empty is a target without an
        inclusion; other empty cells are as in the phantom ``detection-blank`` of the catalog.

    Raises
    ------
    FileInputError
        When a row is no target; the message gives its line.
    """
    file = as_path(path)
    by_label: dict[str, TargetTruth] = {}
    for row in read_csv_rows(file, COLUMNS, MORE_COLUMNS):
        target = _target(row)
        if target.label in by_label:
            raise row.refused("label", "different in every row", target.label)
        by_label[target.label] = target
    if not by_label:
        raise file_error(file, "must hold at least one target; it has headings alone")
    return tuple(by_label.values())


def _target(row: CsvRow) -> TargetTruth:
    usual = load_phantom("detection-blank")
    numbers = {name: row.number(name) for name in (*COLUMNS[1:], *MORE_COLUMNS)}
    given = [name for name in COLUMNS[1:] if numbers[name] is not None]
    if given and len(given) < len(COLUMNS) - 1:
        lost = next(name for name in COLUMNS[1:] if name not in given)
        raise row.refused(lost, f"given where {given[0]} is, or all three empty", "")
    values = dict(zip(MORE_COLUMNS, (0.0, usual.young_kpa, usual.thickness_mm, usual.poisson), strict=True))
    values |= {name: value for name, value in numbers.items() if value is not None}
    offset, tissue, thickness, poisson = (values[name] for name in MORE_COLUMNS)
    try:
        lump = None
        if given:
            diameter, depth, young = (values[name] for name in COLUMNS[1:])
            lump = Inclusion(
                diameter_mm=diameter, depth_mm=depth, young_kpa=young, poisson=poisson, offset_mm=(offset, 0.0)
            )
        phantom = Phantom(young_kpa=tissue, thickness_mm=thickness, poisson=poisson, inclusion=lump)
        return TargetTruth(label=row.text("label"), phantom=phantom)
    except InputError as error:
        raise FileInputError(f"{error} ({row.where})") from error


READING_COLUMNS = ("code", "score", "operator", "repeat", *QUANTITIES)
UNCERTAINTY_COLUMNS = tuple(f"{name}{ending}" for name in QUANTITIES for ending in ("_sd", "_low", "_high"))
NO_RESPONSE = "the device gave no result"


def import_readings(
    study: Study,
    path: str | os.PathLike[str],
    *,
    device: str,
    threshold: float | None = None,
    actor: str = "",
) -> Study:
    """Enter the readings of a device from a file with the columns `READING_COLUMNS`, all or none.

    `UNCERTAINTY_COLUMNS` may follow: the standard deviation of a quantity, and both ends of its 90 % interval.

    Parameters
    ----------
    study
        The study, blind.
    path
        Comma-separated values in UTF-8. An empty score is an undecided reading; sizes, depths and moduli may be empty.
    device
        Name of the device.
    threshold
        Least score of a target that is called one with an inclusion; that of the study by default. The first import
        of a device fixes it.
    actor
        Who enters them.

    Raises
    ------
    InputError
        When a row is invalid; the message gives its line, and nothing is entered.
    RecordsError
        When the study is unblinded.
    """
    file = as_path(path)
    return import_table(
        study,
        read_bytes(file, most=LARGEST_CSV_BYTES),
        printable_name(file),
        device=device,
        threshold=threshold,
        actor=actor,
    )


def import_table(
    study: Study, content: bytes, name: str, *, device: str, threshold: float | None = None, actor: str = ""
) -> Study:
    """Enter the content of an uploaded file; as `import_readings`."""
    require_short_name("device", device)
    if device == study.plan.device:
        raise InputError(f"device must not be {device!r:.60}, which tsis study run reads with (choose another name)")
    limit = _threshold(study, device, threshold)
    readings: dict[tuple[str, str, str, int], DeviceReading] = {}
    entered, codes = {reading.key for reading in study.readings}, frozenset(study.plan.codes)
    for row in parse_csv_rows(content, name, READING_COLUMNS, UNCERTAINTY_COLUMNS):
        reading = _reading(row, codes, device)
        if reading.key in readings or reading.key in entered:
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
            sd={name: sd for name in QUANTITIES if (sd := row.number(f"{name}_sd")) is not None},
            interval_90={name: ends for name in QUANTITIES if (ends := _interval(row, name)) is not None},
        )
    except InputError as error:
        raise FileInputError(f"{error} ({row.where})") from error


def _interval(row: CsvRow, quantity: str) -> tuple[float, float] | None:
    low, high = row.number(f"{quantity}_low"), row.number(f"{quantity}_high")
    if low is None and high is None:
        return None
    if low is None or high is None or not 0 <= low <= high:
        limits = f"{row.text(f'{quantity}_low')} and {row.text(f'{quantity}_high')}"
        raise row.refused(f"{quantity}_low and {quantity}_high", "given together, from 0 upwards", limits)
    return low, high


def export_readings(study: Study, device: str | None = None) -> bytes:
    """Readings of a device, by default the only one, in the format of `import_readings`, without the truth.

    `UNCERTAINTY_COLUMNS` follow where a reading has a standard deviation or an interval.

    Raises
    ------
    InputError
        When that device has no readings, or several devices exist and none is named.
    """
    if device is None:
        if len(study.devices) != 1:
            raise InputError(
                f"device must be named where there is not exactly one; this study has readings of "
                f"{', '.join(study.devices) or 'none'}"
            )
        device = study.devices[0]
    readings = [reading for reading in study.readings if reading.device == device]
    if not readings:
        raise InputError(f"device must be one that has readings, {', '.join(study.devices)}; got {device!r:.60}")
    more = UNCERTAINTY_COLUMNS if any(item.sd or item.interval_90 for item in readings) else ()
    rows: list[list[Any]] = [[*READING_COLUMNS, *more]]
    for item in readings:
        numbers = {name: value for name, value in quantity_columns(item).items() if not math.isnan(value)}
        rows.append([item.code, item.score, item.operator, item.repeat, *map(numbers.get, (*QUANTITIES, *more))])
    return table_bytes(rows)


def readings_table(study: Study) -> Any:
    """All readings of a study as a ``pandas.DataFrame``, a row each, without the truth.

    The columns are code, device, operator, repeat, score, rank, undecided, reason and flags; and for each quantity of
    `QUANTITIES` the value, its standard deviation ``..._sd`` and the 90 % interval ``..._low`` and ``..._high``. What a
    device does not give is NaN. Raises `MissingExtraError` without the extra ``analysis``.
    """
    pandas = import_extra("pandas", feature="a table of readings", extra="analysis")
    return pandas.DataFrame([_reading_row(reading) for reading in study.readings], columns=list(TABLE_COLUMNS))


def _reading_row(reading: DeviceReading) -> dict[str, Any]:
    return {
        **{name: getattr(reading, name) for name in ("code", "device", "operator", "repeat", "undecided", "reason")},
        **{name: _number_or_nan(getattr(reading, name)) for name in ("score", "rank")},
        "flags": ", ".join(reading.flags),
        **quantity_columns(reading),
    }


def quantity_columns(reading: DeviceReading | None) -> dict[str, float]:
    """Value, standard deviation and 90 % interval of each quantity, NaN where a reading has none."""
    columns: dict[str, float] = {}
    for name in QUANTITIES:
        low, high = (None, None) if reading is None else reading.interval_90.get(name, (None, None))
        parts = {
            "": None if reading is None else reading.values.get(name),
            "_sd": None if reading is None else reading.sd.get(name),
            "_low": low,
            "_high": high,
        }
        columns |= {f"{name}{ending}": _number_or_nan(value) for ending, value in parts.items()}
    return columns


def _number_or_nan(value: float | None) -> float:
    return math.nan if value is None else value


TABLE_COLUMNS = (
    *("code", "device", "operator", "repeat", "score", "rank", "undecided", "reason", "flags"),
    *quantity_columns(None),
)

"""Readings of other devices as a table, in and out."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

from tsis.__about__ import __version__
from tsis.instrument.file_bytes import as_path, printable_name, read_bytes
from tsis.model.check import require_number
from tsis.model.errors import FileInputError, InputError
from tsis.records.export.csv_files import table_bytes
from tsis.study.csv_rows import LARGEST_BYTES, parse_csv_rows
from tsis.study.folder import enter_readings, user
from tsis.study.reading import QUANTITIES, DeviceReading, require_short_name

if TYPE_CHECKING:
    import os

    from tsis.study.csv_rows import CsvRow
    from tsis.study.folder import Study

READING_COLUMNS = ("code", "score", "operator", "repeat", *QUANTITIES)
NO_ANSWER = "the device gave no answer"


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
    place = as_path(path)
    return import_table(
        study,
        read_bytes(place, most=LARGEST_BYTES),
        printable_name(place),
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
    known, codes = {reading.key for reading in study.readings}, frozenset(study.plan.codes)
    for row in parse_csv_rows(content, name, READING_COLUMNS):
        reading = _reading(row, codes, device)
        if reading.key in readings or reading.key in known:
            raise FileInputError(
                f"code, operator and repeat must be together but once for a device; {reading.code}, "
                f"{reading.operator!r:.60} and {reading.repeat} are there already ({row.where})"
            )
        readings[reading.key] = reading
    if not readings:
        raise FileInputError(f"{name} must hold at least one reading; it has headings alone")
    told: dict[str, Any] = {
        "device": device,
        "threshold": limit,
        "file": name,
        "sha256": hashlib.sha256(content).hexdigest(),
        "readings": len(readings),
        "tsis": __version__,
    }
    return enter_readings(study, list(readings.values()), actor=actor or user(), imported=told)


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
            reason=NO_ANSWER if score is None else "",
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
    held = [reading for reading in study.readings if reading.device == device]
    if not held:
        raise InputError(f"device must be one that has readings, {', '.join(study.devices)}; got {device!r:.60}")
    rows: list[list[Any]] = [list(READING_COLUMNS)]
    for each in held:
        values = [each.values.get(name) for name in QUANTITIES]
        rows.append([each.code, each.score, each.operator, each.repeat, *values])
    return table_bytes(rows)


__all__ = ["READING_COLUMNS", "export_readings", "import_readings", "import_table"]

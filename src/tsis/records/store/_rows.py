"""Values of records as rows of the tables, and back."""

from __future__ import annotations

from contextlib import contextmanager
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from tsis.calibration.file import calibration_sha256
from tsis.errors import InputError, RecordsError
from tsis.files import canonical, from_json_value, parse_canonical, to_json_value
from tsis.records._estimate_json import estimate_from_json, estimate_to_json
from tsis.records._values import StoredPress, Target

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from tsis.calibration.file import ProbeCalibration
    from tsis.records._values import StoredEstimate


Row = dict[str, Any]


def moment(when: datetime) -> str:
    """A time as the tables store it: UTC, of equal length, so that text sorts by time."""
    return when.astimezone(UTC).isoformat(timespec="microseconds")


def target_row(target: Target) -> Row:
    """Row of a target."""
    document = to_json_value(target)
    return document | {"truth": canonical(document["truth"]), "made": moment(target.made)}


def target_of_row(row: Mapping[str, Any]) -> Target:
    """The target of a row; `RecordsError` when the row is invalid."""
    with _as_stored("target", row):
        document = dict(row) | {"truth": parse_canonical(row["truth"], "truth")}
        return from_json_value(Target, document, "target", complete=True)


def press_row(press: StoredPress) -> Row:
    """Row of a press; the row of the frame has the size of the frame."""
    document = to_json_value(press)
    scale, axis = document.pop("mm_per_pixel") or (None, None), document.pop("axis_px")
    force = document["force_n"]
    for name in ("rows", "columns"):
        del document[name]
    return document | {
        "taken": moment(press.taken),
        "mm_per_pixel_x": scale[0],
        "mm_per_pixel_y": scale[1],
        "axis_px_x": axis[0] + 0.0,  # -0.0 becomes 0.0, as SQLite makes it
        "axis_px_y": axis[1] + 0.0,
        "force_n": None if force is None else force + 0.0,
        "settings": canonical(document["settings"]),
        "flags": canonical(document["flags"]),
    }


def press_of_row(row: Mapping[str, Any]) -> StoredPress:
    """The press of a row joined with the size of its frame; `RecordsError` when the row is invalid."""
    with _as_stored("press", row):
        document = dict(row)
        scale = [document.pop("mm_per_pixel_x"), document.pop("mm_per_pixel_y")]
        document["mm_per_pixel"] = None if None in scale else scale
        document["axis_px"] = [document.pop("axis_px_x"), document.pop("axis_px_y")]
        document["settings"] = parse_canonical(row["settings"], "settings")
        document["flags"] = parse_canonical(row["flags"], "flags")
        return from_json_value(StoredPress, document, "press", complete=True)


def estimate_row(stored: StoredEstimate, samples: str) -> Row:
    """Row of an estimate; ``samples`` names the file of its samples."""
    row = estimate_to_json(stored)
    document = row.pop("estimate")
    nested = {name: canonical(row[name]) for name in ("presses", "options", "environment")}
    return row | nested | {"made": moment(stored.made), "document": canonical(document), "samples": samples}


def estimate_of_row(row: Mapping[str, Any], samples: Mapping[str, NDArray[np.float64]]) -> StoredEstimate:
    """The estimate of a row with its samples, name -> shape (n,); `RecordsError` when the row is invalid."""
    with _as_stored("estimate", row):
        document = {name: value for name, value in row.items() if name not in ("document", "samples")}
        nested = {name: parse_canonical(row[name], name) for name in ("presses", "options", "environment")}
        nested["estimate"] = parse_canonical(row["document"], "document")
        return estimate_from_json(document | nested, samples)


def calibration_row(calibration: ProbeCalibration, file: str) -> Row:
    """Row of a calibration; ``file`` names its stored file."""
    row = {"id": calibration_sha256(calibration), "file": file, "name": calibration.name, "probe": calibration.probe}
    return row | {"made": "" if calibration.made is None else moment(calibration.made)}


@contextmanager
def _as_stored(what: str, row: Mapping[str, Any]) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise RecordsError(
            f"{what} {str(row.get('id', ''))!r:.40} must be as it was stored; {error} (tsis records verify)"
        ) from error

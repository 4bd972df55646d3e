"""Values of records as rows of the tables, and back."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, TypeVar

from tsis.calibration.file import calibration_sha256
from tsis.errors import InputError, RecordsError
from tsis.files import canonical, parsed
from tsis.records._plain import (
    estimate_of_plain,
    estimate_to_plain,
    press_of_plain,
    press_to_plain,
    target_of_plain,
    target_to_plain,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from tsis.calibration.file import ProbeCalibration
    from tsis.records._values import StoredEstimate, StoredPress, Target


Row = dict[str, Any]
Believed = TypeVar("Believed")


def moment(when: datetime) -> str:
    """A time as every table holds it: UTC, of equal length, so that their order is that of the text."""
    return when.astimezone(UTC).isoformat(timespec="microseconds")


def target_row(target: Target) -> Row:
    """Row of a target."""
    document = target_to_plain(target)
    return document | {"truth": canonical(document["truth"]), "made": moment(target.made)}


def target_of_row(row: Mapping[str, Any]) -> Target:
    """The target of a row; `RecordsError` when it holds what is none."""
    return _validated(lambda: target_of_plain(dict(row) | {"truth": parsed(row["truth"], "truth")}), "target", row)


def press_row(press: StoredPress) -> Row:
    """Row of a press; the size of its frame stands in that of the frame."""
    document = press_to_plain(press)
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
        "flags": canonical(document["flags"]) if document["flags"] else None,
        "note": document["note"] or None,
    }


def press_of_row(row: Mapping[str, Any]) -> StoredPress:
    """The press of a row joined with the size of its frame; `RecordsError` when it holds what is none."""

    def press() -> StoredPress:
        document = dict(row)
        scale = [document.pop("mm_per_pixel_x"), document.pop("mm_per_pixel_y")]
        document["mm_per_pixel"] = None if None in scale else scale
        document["axis_px"] = [document.pop("axis_px_x"), document.pop("axis_px_y")]
        document["settings"] = parsed(row["settings"], "settings")
        document["flags"] = parsed(row["flags"] or "[]", "flags")
        document["note"] = row["note"] or ""
        return press_of_plain(document)

    return _validated(press, "press", row)


def estimate_row(stored: StoredEstimate, samples: str) -> Row:
    """Row of an estimate whose samples are the stored file of that name."""
    reference = estimate_to_plain(stored)
    document = reference.pop("estimate")
    nested = {name: canonical(reference[name]) for name in ("presses", "options", "environment")}
    return reference | nested | {"made": moment(stored.made), "document": canonical(document), "samples": samples}


def estimate_of_row(row: Mapping[str, Any], samples: Mapping[str, NDArray[np.float64]]) -> StoredEstimate:
    """The estimate of a row with its samples, name -> shape (n,); `RecordsError` when it holds what is none."""

    def estimate() -> StoredEstimate:
        document = {name: value for name, value in row.items() if name not in ("document", "samples")}
        nested = {name: parsed(row[name], name) for name in ("presses", "options", "environment")}
        return estimate_of_plain(document | nested | {"estimate": parsed(row["document"], "document")}, samples)

    return _validated(estimate, "estimate", row)


def calibration_row(calibration: ProbeCalibration, file: str) -> Row:
    """Row of a calibration that is the stored file of that name."""
    created = "" if calibration.made is None else moment(calibration.made)
    return {
        "id": calibration_sha256(calibration),
        "file": file,
        "name": calibration.name,
        "probe": calibration.probe,
        "made": created,
    }


def _validated(build: Callable[[], Believed], what: str, row: Mapping[str, Any]) -> Believed:
    try:
        return build()
    except InputError as error:
        raise RecordsError(
            f"{what} {str(row.get('id', ''))!r:.40} must be as it was stored; {error} (tsis records verify)"
        ) from error

"""The calibration file: JSON with a version and the hash of its content, from a session or written by hand."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.calibration.file._value import ProbeCalibration
from tsis.errors import CalibrationError, FileInputError, InputError
from tsis.files.atomic import write_durably
from tsis.files.canonical_json import content_sha256, json_bytes
from tsis.files.json_values import from_json_value, require_bounded_arrays, to_json_value, without_packed_arrays
from tsis.files.reading import as_path, parse_object, printable_path, read_object

if TYPE_CHECKING:
    import os
    from pathlib import Path


CALIBRATION_FORMAT, CALIBRATION_VERSION = "tsis-calibration", 1
LARGEST_BYTES = 128 * 2**20  # maps of a camera of 8 million pixels


def calibration_sha256(calibration: ProbeCalibration) -> str:
    """SHA-256 of the content, by which results cite the calibration."""
    sha256 = document_sha256(to_json_value(calibration, pack=False))
    assert sha256 is not None  # values contain neither NaN nor endless nesting
    return sha256


def calibration_bytes(calibration: ProbeCalibration) -> bytes:
    """Content of the calibration file; `InputError` when it exceeds `LARGEST_BYTES`."""
    content = to_json_value(calibration)
    require_bounded_arrays(content, "calibration")
    document = {
        "format": CALIBRATION_FORMAT,
        "version": CALIBRATION_VERSION,
        "notice": RESEARCH_USE_ONLY,
        "tsis": __version__,
        "sha256": calibration_sha256(calibration),
        "calibration": content,
    }
    encoded = json_bytes(document)
    if len(encoded) > LARGEST_BYTES:
        raise InputError(
            f"calibration must take at most {LARGEST_BYTES} bytes, so that it can be read back; got {len(encoded)}"
        )
    return encoded


def write_calibration(calibration: ProbeCalibration, path: str | os.PathLike[str]) -> str:
    """Write a new file atomically and return its identity.

    Raises `FileInputError` when the file exists already or cannot be written; `InputError` as `calibration_bytes`.
    """
    target = as_path(path)
    content = calibration_bytes(calibration)
    try:
        if target.exists():
            raise FileInputError(
                f"{printable_path(target)} must be a new file; it exists already (choose another name)"
            )
        target.parent.mkdir(parents=True, exist_ok=True)
        write_durably(target, content)
    except OSError as error:
        reason = error.strerror or error
        raise FileInputError(f"{printable_path(target)} must be a file that can be written; got: {reason}") from error
    return calibration_sha256(calibration)


def read_calibration(path: str | os.PathLike[str]) -> ProbeCalibration:
    """Read a calibration file; `ProbeCalibration.require_usable` checks its use.

    Raises `FileInputError` when it is missing, of another format or version, or a value is out of range;
    `CalibrationError` when its hash does not match: it was changed or damaged.
    """
    source = as_path(path)
    return _parsed(read_object(source, most=LARGEST_BYTES), printable_path(source))


def parse_calibration(content: bytes, name: str) -> ProbeCalibration:
    """Parse the content of a calibration file; ``name`` identifies it in errors.

    Raises `FileInputError` or `CalibrationError` as `read_calibration`.
    """
    if len(content) > LARGEST_BYTES:
        raise FileInputError(f"{name} must be at most {LARGEST_BYTES} bytes; got {len(content)}")
    return _parsed(parse_object(content, name), name)


def _parsed(document: dict[str, Any], name: str) -> ProbeCalibration:
    if document.get("format") != CALIBRATION_FORMAT:
        raise FileInputError(f"{name} must be a file of {CALIBRATION_FORMAT}; got {document.get('format')!r:.60}")
    if document.get("version") != CALIBRATION_VERSION:
        raise FileInputError(
            f"{name} must be of version {CALIBRATION_VERSION}; got {document.get('version')!r:.20} (calibrate again)"
        )
    content = document.get("calibration")
    expected = document_sha256(content)
    if expected is None or document.get("sha256") != expected:
        raise CalibrationError(
            f"{name} must be as it was written; its content does not match its hash, so it was changed or "
            "damaged (take the original, or calibrate again)"
        )
    try:
        require_bounded_arrays(content, "calibration")
        return from_json_value(ProbeCalibration, content, "calibration")
    except InputError as error:
        raise FileInputError(f"{name}: {error}") from error
    except CalibrationError as error:
        raise CalibrationError(f"{name}: {error}") from error


def document_sha256(content: Any) -> str | None:
    """SHA-256 of a calibration's JSON values; None for NaN or endless nesting."""
    try:
        return content_sha256(_as_floats(without_packed_arrays(content)))
    except (ValueError, OverflowError, RecursionError):
        return None


def _as_floats(content: Any) -> Any:
    """Integers as floats: 60 and 60.0 have one hash."""
    if isinstance(content, dict):
        return {name: _as_floats(item) for name, item in content.items()}
    if isinstance(content, list):
        return [_as_floats(item) for item in content]
    return float(content) if type(content) is int else content


LARGEST_VALUES_BYTES = 2**20
BY_HAND = ("response", "scale")  # parts that can be entered by hand
FROM_FRAMES = ("reference", "force_line", "tissue", "specification", "made", "expires")


def read_handwritten_calibration(path: Path, days: float) -> ProbeCalibration:
    """Read values that were entered by hand, and date them from now.

    Raises `FileInputError` when the file is invalid, or contains parts that only a session's frames provide.

    Parameters
    ----------
    path
        JSON file with name, probe, and a response or a scale.
    days
        Validity of the calibration, days.
    """
    content = read_object(path, most=LARGEST_VALUES_BYTES)
    if measured := [name for name in FROM_FRAMES if content.get(name) is not None]:
        raise FileInputError(
            f"{printable_path(path)} must hold values written by hand (name, probe, camera, settings, response, "
            f"scale); got {', '.join(measured)}, which a session's frames give and whose date cannot be renewed "
            "(tsis calibrate)"
        )
    now = datetime.now(UTC).replace(microsecond=0)
    dated: dict[str, Any] = {**content, "made": now.isoformat(), "expires": (now + timedelta(days=days)).isoformat()}
    try:
        calibration = from_json_value(ProbeCalibration, dated, "calibration")
    except InputError as error:
        raise FileInputError(f"{printable_path(path)}: {error}") from error
    if all(getattr(calibration, part) is None for part in BY_HAND):
        raise FileInputError(f"{printable_path(path)} must hold at least one of {', '.join(BY_HAND)}; got none")
    return calibration

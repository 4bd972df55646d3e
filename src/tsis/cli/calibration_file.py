"""Calibrations as JSON files that people can read."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

from tsis.model import Calibration
from tsis.model.errors import FileInputError, InputError

if TYPE_CHECKING:
    from pathlib import Path

FORMAT, VERSION = "tsis-calibration", 1
LARGEST_BYTES = 1_000_000


def calibration_document(calibration: Calibration) -> dict[str, Any]:
    """Content of a calibration file."""
    return {"format": FORMAT, "version": VERSION, **asdict(calibration)}


def read_calibration(path: Path) -> Calibration:
    """Read a calibration file.

    Raises
    ------
    FileInputError
        When it is missing, not such a file, or holds a value out of range.
    """
    content = _read_object(path)
    if content.pop("format", None) != FORMAT or content.pop("version", None) != VERSION:
        raise FileInputError(f"{path} must be a calibration file ({FORMAT}, version {VERSION}); got another format")
    known = {field.name for field in fields(Calibration)}
    if unknown := sorted(set(content) - known):
        raise FileInputError(f"{path} must hold only known values; got {', '.join(unknown)}")
    try:
        return Calibration(**content)
    except InputError as error:
        raise FileInputError(f"{path}: {error}") from error
    except TypeError as error:
        missing = sorted({"gain_grey_per_kpa", "saturation_kpa"} - set(content))
        raise FileInputError(f"{path} must hold {' and '.join(missing)}; got {sorted(content)}") from error


def _read_object(path: Path) -> dict[str, Any]:
    if not path.is_file() or path.stat().st_size > LARGEST_BYTES:
        raise FileInputError(f"{path} must be an existing file of at most {LARGEST_BYTES} bytes")
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise FileInputError(f"{path} must be a readable JSON file; got: {error}") from error
    if not isinstance(content, dict):
        raise FileInputError(f"{path} must hold a JSON object; got {type(content).__name__}")
    return content

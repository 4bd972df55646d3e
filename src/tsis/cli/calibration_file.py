"""Calibrations as JSON files that people can read."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

from tsis.instrument import read_bytes, shown
from tsis.model import Calibration, LightMap
from tsis.model.errors import FileInputError, InputError

if TYPE_CHECKING:
    from pathlib import Path

FORMAT, VERSION = "tsis-calibration", 1


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
        raise FileInputError(f"{shown(path)} must be a file of {FORMAT}, version {VERSION}; got another format")
    known = {field.name for field in fields(Calibration)}
    if unknown := sorted(set(content) - known):
        raise FileInputError(f"{shown(path)} must hold only known values; got {unknown!r:.200}")
    try:
        if isinstance(content.get("light"), dict):
            content["light"] = _light(content["light"])
        return Calibration(**content)
    except InputError as error:
        raise FileInputError(f"{shown(path)}: {error}") from error
    except TypeError as error:
        missing = sorted({"gain_grey_per_kpa", "saturation_kpa"} - set(content))
        raise FileInputError(f"{shown(path)} must hold {' and '.join(missing)}; got {sorted(content)}") from error


def _light(content: dict[str, Any]) -> LightMap:
    names = [field.name for field in fields(LightMap)]
    optional = {"depletion", "bend_per_mm2"}
    if wrong := sorted((set(content) ^ set(names)) - (optional - set(content))):
        raise InputError(f"light must hold just {', '.join(names)}; wrong: {wrong!r:.200}")
    return LightMap(**content)


def _read_object(path: Path) -> dict[str, Any]:
    data = read_bytes(path)
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise FileInputError(f"{shown(path)} must be a readable JSON file; got: {error}") from error
    if not isinstance(content, dict):
        raise FileInputError(f"{shown(path)} must hold a JSON object; got {type(content).__name__}")
    return content

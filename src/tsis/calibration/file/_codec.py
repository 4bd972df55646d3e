"""Frozen values as plain ones for JSON, and back, by the types that their fields declare.

Numbers, text and small arrays stay readable; large maps become compressed text. Both ways are exact.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import math
import types
import typing
import zlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from datetime import datetime
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from tsis.errors import CalibrationError, InputError

READABLE = 64  # numbers in an array that is written out
LARGEST_ARRAY = 16_000_000
MOST_UNPACKED = 256 * 2**20  # bytes of all maps together: those of a camera of 10 million pixels
PIECE = 4096  # packed bytes, of which none becomes more than 1032
_MAP_KEYS = {"shape", "kind", "sha256", "zlib"}
_KINDS: dict[str, np.dtype[Any]] = {"single": np.dtype("<f4"), "double": np.dtype("<f8"), "bool": np.dtype("?")}


def to_plain(value: Any, *, pack: bool = True) -> Any:
    """What JSON can hold of a value; infinities become words.

    Parameters
    ----------
    value
        A frozen value, a number, text, an array, or mappings and tuples of them.
    pack
        Whether large maps are held; else their hash stands for them, which is all that tells one from another.

    Examples
    --------
    >>> to_plain((1.5, float("inf"), np.eye(2)))
    [1.5, 'infinity', [[1.0, 0.0], [0.0, 1.0]]]
    """
    if value is None or isinstance(value, (str, bool)):
        return value
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, np.ndarray):
        return _array_to_plain(value, pack=pack)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return _number_to_plain(float(value))
    if isinstance(value, Mapping):
        return {str(name): to_plain(item, pack=pack) for name, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [to_plain(item, pack=pack) for item in value]
    assert is_dataclass(value), value
    return {field.name: to_plain(getattr(value, field.name), pack=pack) for field in fields(value)}


def without_maps(reference: Any) -> Any:
    """The same with every packed map's content left out: its hash tells it."""
    if isinstance(reference, dict):
        by_name = {name: without_maps(item) for name, item in reference.items()}
        return {name: by_name[name] for name in by_name if name != "zlib"} if set(by_name) == _MAP_KEYS else by_name
    return [without_maps(item) for item in reference] if isinstance(reference, list) else reference


def require_bounded_maps(reference: Any, where: str) -> None:
    """Refuse maps that together unpack to more than any calibration needs, before one of them is unpacked.

    How far they pack tells nothing: a dark camera sees zeros almost everywhere.

    Raises
    ------
    InputError
        When they say more than 256 MiB, or one has no sensible size.
    """
    declared, left = 0, [reference]
    while left:
        item = left.pop()
        if isinstance(item, dict) and set(item) == _MAP_KEYS:
            size = _declared_bytes(item["shape"], item["kind"])
            _require(size > 0, where, f"of maps of at most {LARGEST_ARRAY} numbers, a sensible size", item["shape"])
            declared += size
        elif isinstance(item, (dict, list)):
            left.extend(item.values() if isinstance(item, dict) else item)
    if declared > MOST_UNPACKED:
        raise InputError(f"{where} must hold maps that unpack to at most {MOST_UNPACKED} bytes; got {declared}")


def from_plain(requested: Any, reference: Any, where: str) -> Any:
    """The value of the declared type ``requested`` that `to_plain` made ``reference`` of; ``where`` names it in errors.

    Raises
    ------
    InputError
        When it is no such value; whatever the value itself refuses is refused here too.
    """
    origin = get_origin(requested)
    if origin in (types.UnionType, typing.Union):
        if reference is None and type(None) in get_args(requested):
            return None
        (only,) = (item for item in get_args(requested) if item is not type(None))
        return from_plain(only, reference, where)
    if origin is np.ndarray:
        return _array_from_plain(reference, where)
    if origin is tuple:
        return _tuple_from_plain(get_args(requested), reference, where)
    if origin is not None and issubclass(origin, Mapping):
        _require(isinstance(reference, dict), where, "a mapping", reference)
        return {name: from_plain(get_args(requested)[1], item, f"{where}.{name}") for name, item in reference.items()}
    if requested is float:
        return _number_from_plain(reference, where)
    if requested is datetime:
        return _time_from_plain(reference, where)
    if requested in (int, str, bool):
        _require(type(reference) is requested, where, f"of type {requested.__name__}", reference)
        return reference
    return _dataclass_from_plain(requested, reference, where)


def _dataclass_from_plain(requested: Any, reference: Any, where: str) -> Any:
    _require(isinstance(reference, dict), where, "an object with named values", reference)
    hints = _declared(requested)
    if unknown := sorted(set(reference) - set(hints)):
        raise InputError(f"{where} must hold only known values; got {unknown!r:.200}")
    values = {name: from_plain(hints[name], item, f"{where}.{name}") for name, item in reference.items()}
    try:
        return requested(**values)
    except TypeError as error:
        raise InputError(f"{where} must hold all of {', '.join(hints)}; got {sorted(reference)!r:.200}") from error


def _declared(requested: Any) -> dict[str, Any]:
    """Types of a class's fields; names that are imported for type checkers alone are arrays and mappings here."""
    hints = get_type_hints(requested, localns={"NDArray": NDArray, "Mapping": Mapping})
    return {field.name: hints[field.name] for field in fields(requested)}


def _number_to_plain(value: float) -> float | str:
    if math.isfinite(value):
        return value
    if math.isnan(value):
        raise InputError("a calibration must hold numbers; got NaN")
    return "infinity" if value > 0 else "-infinity"


def _number_from_plain(reference: Any, where: str) -> float:
    text = {"infinity": math.inf, "-infinity": -math.inf}
    if isinstance(reference, str) and reference in text:
        return text[reference]
    _require(isinstance(reference, (int, float)) and not isinstance(reference, bool), where, "a number", reference)
    try:
        return float(reference)
    except OverflowError as error:
        raise InputError(f"{where} must be a number; got one of {len(str(reference))} digits") from error


def _time_from_plain(reference: Any, where: str) -> datetime:
    _require(isinstance(reference, str), where, "a date and time", reference)
    try:
        return datetime.fromisoformat(reference)
    except ValueError as error:
        raise InputError(
            f"{where} must be a date and time as 2026-11-22T10:00:00+00:00; got {reference!r:.60}"
        ) from error


def _tuple_from_plain(kinds: tuple[Any, ...], reference: Any, where: str) -> tuple[Any, ...]:
    _require(isinstance(reference, list), where, "a list", reference)
    item = kinds[:1] * len(reference) if len(kinds) == 2 and kinds[1] is Ellipsis else kinds
    _require(len(item) == len(reference), where, f"a list of {len(item)}", reference)
    return tuple(from_plain(kind, reference[at], f"{where}[{at}]") for at, kind in enumerate(item))


def _array_to_plain(values: np.ndarray[Any, Any], *, pack: bool) -> Any:
    if values.size <= READABLE:
        return to_plain(values.tolist())
    kind = "bool" if values.dtype == bool else "single" if np.array_equal(values.astype("<f4"), values) else "double"
    content = np.ascontiguousarray(values, dtype=_KINDS[kind]).tobytes()
    reference = {"shape": list(values.shape), "kind": kind, "sha256": hashlib.sha256(content).hexdigest()}
    return reference | {"zlib": base64.b64encode(zlib.compress(content, 6)).decode()} if pack else reference


def _array_from_plain(reference: Any, where: str) -> np.ndarray[Any, Any]:
    if isinstance(reference, list):
        try:
            values = np.array(reference)
        except (ValueError, OverflowError, RecursionError) as error:
            raise InputError(f"{where} must be an array of numbers; its rows differ in length") from error
        _require(values.dtype.kind in "biuf", where, "an array of numbers", reference)
        return values
    _require(isinstance(reference, dict) and set(reference) == _MAP_KEYS, where, "an array", reference)
    shape, kind = reference["shape"], reference["kind"]
    size = _declared_bytes(shape, kind)
    _require(size > 0, where, "a map of sensible size", shape)
    content = _unpacked(reference["zlib"], size, where)
    if hashlib.sha256(content).hexdigest() != reference["sha256"]:
        raise CalibrationError(f"{where} must be as it was written; it does not match its hash, so it was changed")
    values = np.frombuffer(content, dtype=_KINDS[kind]).reshape(shape)
    return values.astype(bool if kind == "bool" else float)


def _declared_bytes(shape: Any, kind: Any) -> int:
    """Size of a map in bytes; 0 when nothing sensible is declared."""
    sound = isinstance(shape, list) and all(type(side) is int and 0 < side <= LARGEST_ARRAY for side in shape[:4])
    if not sound or not 0 < len(shape) <= 4 or not isinstance(kind, str) or kind not in _KINDS:
        return 0
    return math.prod(shape) * _KINDS[kind].itemsize if math.prod(shape) <= LARGEST_ARRAY else 0


def _unpacked(packed: Any, size: int, where: str) -> bytearray:
    """Exactly ``size`` bytes, in pieces: more is never unpacked, and nothing is held twice."""
    unpacker, content, position = zlib.decompressobj(), bytearray(size), 0
    try:
        data = memoryview(base64.b64decode(packed, validate=True))
        for start in range(0, len(data), PIECE):
            piece = unpacker.decompress(data[start : start + PIECE])
            content[position : position + len(piece)] = piece[: size - position]
            position += len(piece)
            if position > size or unpacker.eof:
                break
    except (TypeError, ValueError, binascii.Error, zlib.error) as error:
        raise InputError(f"{where} must be a whole map; it is damaged: {error!s:.80}") from error
    if position != size or not unpacker.eof:
        raise InputError(f"{where} must be a whole map of {size} bytes; got another number")
    return content


def _require(sound: bool, where: str, what: str, got: Any) -> None:
    if not sound:
        raise InputError(f"{where} must be {what}; got {got!r:.80}")

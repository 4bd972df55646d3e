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
        return {str(name): to_plain(each, pack=pack) for name, each in value.items()}
    if isinstance(value, (tuple, list)):
        return [to_plain(each, pack=pack) for each in value]
    assert is_dataclass(value), value
    return {field.name: to_plain(getattr(value, field.name), pack=pack) for field in fields(value)}


def without_maps(plain: Any) -> Any:
    """The same with every packed map's content left out: its hash tells it."""
    if isinstance(plain, dict):
        held = {name: without_maps(each) for name, each in plain.items()}
        return {name: held[name] for name in held if name != "zlib"} if set(held) == _MAP_KEYS else held
    return [without_maps(each) for each in plain] if isinstance(plain, list) else plain


def require_bounded_maps(plain: Any, where: str) -> None:
    """Refuse maps that together unpack to more than any calibration needs, before one of them is unpacked.

    How far they pack tells nothing: a dark camera sees zeros almost everywhere.

    Raises
    ------
    InputError
        When they say more than 256 MiB, or one has no sensible size.
    """
    declared, left = 0, [plain]
    while left:
        each = left.pop()
        if isinstance(each, dict) and set(each) == _MAP_KEYS:
            size = _declared_bytes(each["shape"], each["kind"])
            _require(size > 0, where, f"of maps of at most {LARGEST_ARRAY} numbers, a sensible size", each["shape"])
            declared += size
        elif isinstance(each, (dict, list)):
            left.extend(each.values() if isinstance(each, dict) else each)
    if declared > MOST_UNPACKED:
        raise InputError(f"{where} must hold maps that unpack to at most {MOST_UNPACKED} bytes; got {declared}")


def from_plain(wanted: Any, plain: Any, where: str) -> Any:
    """The value of the declared type ``wanted`` that `to_plain` made ``plain`` of; ``where`` names it in errors.

    Raises
    ------
    InputError
        When it is no such value; whatever the value itself refuses is refused here too.
    """
    origin = get_origin(wanted)
    if origin in (types.UnionType, typing.Union):
        if plain is None and type(None) in get_args(wanted):
            return None
        (only,) = (each for each in get_args(wanted) if each is not type(None))
        return from_plain(only, plain, where)
    if origin is np.ndarray:
        return _array_from_plain(plain, where)
    if origin is tuple:
        return _tuple_from_plain(get_args(wanted), plain, where)
    if origin is not None and issubclass(origin, Mapping):
        _require(isinstance(plain, dict), where, "a mapping", plain)
        return {name: from_plain(get_args(wanted)[1], each, f"{where}.{name}") for name, each in plain.items()}
    if wanted is float:
        return _number_from_plain(plain, where)
    if wanted is datetime:
        return _time_from_plain(plain, where)
    if wanted in (int, str, bool):
        _require(type(plain) is wanted, where, f"of type {wanted.__name__}", plain)
        return plain
    return _dataclass_from_plain(wanted, plain, where)


def _dataclass_from_plain(wanted: Any, plain: Any, where: str) -> Any:
    _require(isinstance(plain, dict), where, "an object with named values", plain)
    hints = _declared(wanted)
    if unknown := sorted(set(plain) - set(hints)):
        raise InputError(f"{where} must hold only known values; got {unknown!r:.200}")
    values = {name: from_plain(hints[name], each, f"{where}.{name}") for name, each in plain.items()}
    try:
        return wanted(**values)
    except TypeError as error:
        raise InputError(f"{where} must hold all of {', '.join(hints)}; got {sorted(plain)!r:.200}") from error


def _declared(wanted: Any) -> dict[str, Any]:
    """Types of a class's fields; names that are imported for type checkers alone are arrays and mappings here."""
    hints = get_type_hints(wanted, localns={"NDArray": NDArray, "Mapping": Mapping})
    return {field.name: hints[field.name] for field in fields(wanted)}


def _number_to_plain(value: float) -> float | str:
    if math.isfinite(value):
        return value
    if math.isnan(value):
        raise InputError("a calibration must hold numbers; got NaN")
    return "infinity" if value > 0 else "-infinity"


def _number_from_plain(plain: Any, where: str) -> float:
    words = {"infinity": math.inf, "-infinity": -math.inf}
    if isinstance(plain, str) and plain in words:
        return words[plain]
    _require(isinstance(plain, (int, float)) and not isinstance(plain, bool), where, "a number", plain)
    try:
        return float(plain)
    except OverflowError as error:
        raise InputError(f"{where} must be a number; got one of {len(str(plain))} digits") from error


def _time_from_plain(plain: Any, where: str) -> datetime:
    _require(isinstance(plain, str), where, "a date and time", plain)
    try:
        return datetime.fromisoformat(plain)
    except ValueError as error:
        raise InputError(f"{where} must be a date and time as 2026-11-22T10:00:00+00:00; got {plain!r:.60}") from error


def _tuple_from_plain(kinds: tuple[Any, ...], plain: Any, where: str) -> tuple[Any, ...]:
    _require(isinstance(plain, list), where, "a list", plain)
    each = kinds[:1] * len(plain) if len(kinds) == 2 and kinds[1] is Ellipsis else kinds
    _require(len(each) == len(plain), where, f"a list of {len(each)}", plain)
    return tuple(from_plain(kind, plain[at], f"{where}[{at}]") for at, kind in enumerate(each))


def _array_to_plain(values: np.ndarray[Any, Any], *, pack: bool) -> Any:
    if values.size <= READABLE:
        return to_plain(values.tolist())
    kind = "bool" if values.dtype == bool else "single" if np.array_equal(values.astype("<f4"), values) else "double"
    content = np.ascontiguousarray(values, dtype=_KINDS[kind]).tobytes()
    plain = {"shape": list(values.shape), "kind": kind, "sha256": hashlib.sha256(content).hexdigest()}
    return plain | {"zlib": base64.b64encode(zlib.compress(content, 6)).decode()} if pack else plain


def _array_from_plain(plain: Any, where: str) -> np.ndarray[Any, Any]:
    if isinstance(plain, list):
        try:
            values = np.array(plain)
        except (ValueError, OverflowError, RecursionError) as error:
            raise InputError(f"{where} must be an array of numbers; its rows differ in length") from error
        _require(values.dtype.kind in "biuf", where, "an array of numbers", plain)
        return values
    _require(isinstance(plain, dict) and set(plain) == _MAP_KEYS, where, "an array", plain)
    shape, kind = plain["shape"], plain["kind"]
    size = _declared_bytes(shape, kind)
    _require(size > 0, where, "a map of sensible size", shape)
    content = _unpacked(plain["zlib"], size, where)
    if hashlib.sha256(content).hexdigest() != plain["sha256"]:
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
    unpacker, content, place = zlib.decompressobj(), bytearray(size), 0
    try:
        data = memoryview(base64.b64decode(packed, validate=True))
        for start in range(0, len(data), PIECE):
            piece = unpacker.decompress(data[start : start + PIECE])
            content[place : place + len(piece)] = piece[: size - place]
            place += len(piece)
            if place > size or unpacker.eof:
                break
    except (TypeError, ValueError, binascii.Error, zlib.error) as error:
        raise InputError(f"{where} must be a whole map; it is damaged: {error!s:.80}") from error
    if place != size or not unpacker.eof:
        raise InputError(f"{where} must be a whole map of {size} bytes; got another number")
    return content


def _require(sound: bool, where: str, what: str, got: Any) -> None:
    if not sound:
        raise InputError(f"{where} must be {what}; got {got!r:.80}")

"""Arrays in JSON: small ones as lists of numbers, large ones as compressed text with their hash."""

from __future__ import annotations

import base64
import binascii
import hashlib
import math
import zlib
from typing import Any

import numpy as np

from tsis.errors import CalibrationError, InputError

READABLE = 64  # numbers in an array that is written as a list
LARGEST_ARRAY = 16_000_000
MOST_UNPACKED = 256 * 2**20  # bytes of all packed arrays together, enough for a camera of 10 million pixels
PIECE = 4096  # packed bytes; each unpacks to at most 1032
_PACKED_KEYS = {"shape", "kind", "sha256", "zlib"}
_KINDS: dict[str, np.dtype[Any]] = {"single": np.dtype("<f4"), "double": np.dtype("<f8"), "bool": np.dtype("?")}


def array_to_json(values: np.ndarray[Any, Any], *, pack: bool) -> Any:
    """JSON values of a large array; without ``pack`` only its shape, type and hash."""
    kind = "bool" if values.dtype == bool else "single" if np.array_equal(values.astype("<f4"), values) else "double"
    content = np.ascontiguousarray(values, dtype=_KINDS[kind]).tobytes()
    document = {"shape": list(values.shape), "kind": kind, "sha256": hashlib.sha256(content).hexdigest()}
    return document | {"zlib": base64.b64encode(zlib.compress(content, 6)).decode()} if pack else document


def array_from_json(document: Any, where: str) -> np.ndarray[Any, Any]:
    """The array of a list of numbers or of compressed text; ``where`` names it in errors.

    Raises
    ------
    InputError
        When ``document`` is no array, or its content does not fit its declared shape.
    CalibrationError
        When its content does not match its hash.
    """
    if isinstance(document, np.ndarray):  # samples come from a separate file
        return document
    if isinstance(document, list):
        try:
            values = np.array(document)
        except (ValueError, OverflowError, RecursionError) as error:
            raise InputError(f"{where} must be an array of numbers; its rows differ in length") from error
        _require(values.dtype.kind in "biuf", where, "an array of numbers", document)
        return values
    _require(isinstance(document, dict) and set(document) == _PACKED_KEYS, where, "an array", document)
    shape, kind = document["shape"], document["kind"]
    size = _declared_bytes(shape, kind)
    _require(size > 0, where, "a map of sensible size", shape)
    content = _unpacked(document["zlib"], size, where)
    if hashlib.sha256(content).hexdigest() != document["sha256"]:
        raise CalibrationError(f"{where} must be as it was written; it does not match its hash, so it was changed")
    values = np.frombuffer(content, dtype=_KINDS[kind]).reshape(shape)
    return values.astype(bool if kind == "bool" else float)


def without_packed_arrays(document: Any) -> Any:
    """The document without the content of packed arrays; their hashes identify them."""
    if isinstance(document, dict):
        named = {name: without_packed_arrays(item) for name, item in document.items()}
        return {name: named[name] for name in named if name != "zlib"} if set(named) == _PACKED_KEYS else named
    return [without_packed_arrays(item) for item in document] if isinstance(document, list) else document


def require_bounded_arrays(document: Any, where: str) -> None:
    """Check the total declared size of packed arrays before unpacking.

    The packed size gives no bound: zeros, as of a dark camera, compress a thousandfold.

    Raises
    ------
    InputError
        When they declare more than 256 MiB together, or the declared size of an array is invalid.
    """
    declared, left = 0, [document]
    while left:
        item = left.pop()
        if isinstance(item, dict) and set(item) == _PACKED_KEYS:
            size = _declared_bytes(item["shape"], item["kind"])
            _require(size > 0, where, f"of maps of at most {LARGEST_ARRAY} numbers, a sensible size", item["shape"])
            declared += size
        elif isinstance(item, (dict, list)):
            left.extend(item.values() if isinstance(item, dict) else item)
    if declared > MOST_UNPACKED:
        raise InputError(f"{where} must hold maps that unpack to at most {MOST_UNPACKED} bytes; got {declared}")


def _declared_bytes(shape: Any, kind: Any) -> int:
    """Size of a packed array in bytes; 0 when its declaration is invalid."""
    sound = isinstance(shape, list) and all(type(side) is int and 0 < side <= LARGEST_ARRAY for side in shape[:4])
    if not sound or not 0 < len(shape) <= 4 or not isinstance(kind, str) or kind not in _KINDS:
        return 0
    return math.prod(shape) * _KINDS[kind].itemsize if math.prod(shape) <= LARGEST_ARRAY else 0


def _unpacked(packed: Any, size: int, where: str) -> bytearray:
    """Exactly ``size`` bytes, unpacked in pieces to bound the memory."""
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

"""JSON of frozen dataclasses by pydantic: the declared type of a field decides how it is written and read.

Numbers, text and small arrays stay readable; large arrays become compressed text with their hash. Both directions are
strict and exact. See docs/decisions/0012-json-codec.md.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import math
import re
import sys
import types
import typing
import zlib
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from datetime import datetime
from enum import Enum
from functools import cache, partial
from pathlib import PurePath
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from tsis.errors import CalibrationError, InputError, TsisError

if TYPE_CHECKING:
    from collections.abc import Collection, Hashable

    from pydantic import SerializationInfo, TypeAdapter, ValidationError


NUMBER = "$number"  # {"$number": "infinity"}: a number that JSON lacks
INFINITIES = {"infinity": math.inf, "-infinity": -math.inf}
SPECIAL_NUMBERS = INFINITIES | {"nan": math.nan}
DEEPEST, WIDEST_INTEGER = 32, 2**63
_SURROGATE = re.compile(r"[\ud800-\udfff]")
Value = TypeVar("Value")


def to_json_value(value: Any, *, pack: bool = True, without: Collection[str] = ()) -> dict[str, Any]:
    """JSON values of a frozen dataclass value.

    Parameters
    ----------
    value
        A dataclass of numbers, text, times, arrays, other dataclasses, and mappings and tuples of them. A field of
        the type ``Mapping[str, Any]`` is written by `free_to_json`.
    pack
        Whether to write the content of large arrays, or only their hash.
    without
        Fields to omit.

    Raises
    ------
    InputError
        When a number is NaN, an array is not finite, or a free value has no JSON form.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Line:
    ...     slope: float
    ...     range_n: tuple[float, float]
    >>> to_json_value(Line(2, (0.5, math.inf)))
    {'slope': 2.0, 'range_n': [0.5, 'infinity']}
    """
    adapter = _adapter(cast("Any", type(value)), complete=False)
    document: dict[str, Any] = _written(
        value, partial(adapter.dump_python, exclude=set(without), context={"pack": pack})
    )
    return document


def from_json_value(kind: type[Value], document: Any, where: str, *, complete: bool = False) -> Value:
    """The value that `to_json_value` wrote.

    Parameters
    ----------
    kind
        A frozen dataclass, or a type that its fields may have.
    document
        Parsed JSON.
    where
        Name of the value in errors.
    complete
        Whether fields with a default are required too.

    Raises
    ------
    InputError
        When ``document`` does not fit ``kind``. Errors of the class itself pass through.
    """
    from pydantic import ValidationError

    try:
        value: Value = _adapter(cast("Any", kind), complete=complete).validate_python(document)
    except ValidationError as error:
        raise _refusal(error, where) from error
    return value


class _RequirementError(ValueError):
    """A requirement that follows the path of a value in the message, and the class of the error."""

    def __init__(self, requirement: str, kind: type[TsisError] = InputError) -> None:
        super().__init__(requirement)
        self.kind = kind


def _refusal(error: ValidationError, where: str) -> TsisError:
    """The error for the first fault."""
    faults = error.errors(include_url=False)
    first = faults[0]
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, TsisError):
        return cause
    path = where + "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in first["loc"])[:120]
    if isinstance(cause, _RequirementError):
        return cause.kind(f"{path}{cause}")
    if first["type"] not in ("missing", "extra_forbidden"):
        return InputError(f"{path} must be an object with named values; got {_shown(first['input'])}")
    names = sorted(str(item["loc"][-1]) for item in faults if item["type"] == first["type"])
    parent = path.removesuffix(f".{first['loc'][-1]}")
    if first["type"] == "missing":
        return InputError(f"{parent} must hold all of its values; missing {names!r:.200}")
    return InputError(f"{parent} must hold only known values; got {names!r:.200}")


def _shown(got: Any) -> str:
    return f"a number of {got.bit_length()} bits" if type(got) is int and got.bit_length() > 128 else f"{got!r:.80}"


@cache
def _adapter(kind: Hashable, *, complete: bool) -> TypeAdapter[Any]:
    from pydantic import TypeAdapter

    return TypeAdapter(_json_type(kind, "value", complete=complete))


def _json_type(kind: Any, name: str, *, complete: bool) -> Any:
    """The type by which pydantic reads and writes a declared type; ``name`` is that of the field.

    Each part is an own annotated type, because pydantic's strict ones take no list for a tuple and no text with a lone
    surrogate, as in names of files, and build dataclasses without their constructor, which checks them.
    """
    from typing import NotRequired

    from pydantic import AfterValidator, BeforeValidator, ConfigDict, PlainSerializer, PlainValidator, WrapSerializer
    from typing_extensions import TypedDict

    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (types.UnionType, typing.Union):
        (present,) = (item for item in arguments if item is not types.NoneType)
        return _json_type(present, name, complete=complete) | None
    if origin is np.ndarray:
        write_array = partial(_array_to_json, name)
        return Annotated[Any, PlainValidator(_array_from_json), PlainSerializer(write_array)]
    if kind in _PLAIN:
        read, write = _PLAIN[kind]
        return Annotated[Any, PlainValidator(read), PlainSerializer(partial(write, name))]
    if origin is tuple:
        inner: Any = tuple(
            item if item is Ellipsis else _json_type(item, name, complete=complete) for item in arguments
        )
        length = None if Ellipsis in inner else len(inner)
        return Annotated[tuple[inner], BeforeValidator(partial(_require_list, length)), WrapSerializer(_write_as_list)]
    if origin is not None:
        if arguments[1] is Any:
            return Annotated[
                Any, PlainValidator(_free_from_json), PlainSerializer(lambda value: free_to_json(value, name))
            ]
        values: Any = _json_type(arguments[1], name, complete=complete)
        return Annotated[dict[str, values], BeforeValidator(_require_mapping), WrapSerializer(_write_as_object)]
    hints = {part: _json_type(hint, part, complete=complete) for part, hint in _declared_types(kind).items()}
    if not complete:
        required = {field.name for field in fields(kind) if field.default is field.default_factory is MISSING}
        hints = {part: hint if part in required else NotRequired[hint] for part, hint in hints.items()}
    named: Any = cast("Any", TypedDict)(kind.__name__, hints)
    named.__pydantic_config__ = ConfigDict(extra="forbid")
    return Annotated[
        named, AfterValidator(lambda read: kind(**read)), WrapSerializer(partial(_write_fields, (*hints,)))
    ]


def _declared_types(kind: Any) -> dict[str, Any]:
    """Types of the fields of a class."""
    # Some modules import these two names for type checkers alone.
    hints = get_type_hints(kind, localns={"NDArray": NDArray, "Mapping": Mapping})
    return {field.name: hints[field.name] for field in fields(kind)}


def _write_fields(names: tuple[str, ...], value: Any, write: Callable[[Any], Any]) -> Any:
    return _written({name: getattr(value, name) for name in names}, write)


def _write_as_list(value: Any, write: Callable[[Any], Any]) -> list[Any]:
    return list(_written(tuple(value), write))


def _write_as_object(value: Mapping[Any, Any], write: Callable[[Any], Any]) -> Any:
    return _written({str(name): item for name, item in value.items()}, write)


def _written(value: Any, write: Callable[[Any], Any]) -> Any:
    """What pydantic writes, or the error of a part itself: pydantic would pass on its text alone."""
    from pydantic_core import PydanticSerializationError

    try:
        return write(value)
    except PydanticSerializationError as error:
        raise error.__cause__ or error from None


def _exactly(kind: type[Any], what: str, document: Any) -> Any:
    if type(document) is not kind or (kind is int and not -WIDEST_INTEGER <= document < WIDEST_INTEGER):
        raise _RequirementError(f" must be {what}; got {_shown(document)}")
    return document


def _number_from_json(document: Any) -> float:
    if isinstance(document, str) and document in INFINITIES:
        return INFINITIES[document]
    if isinstance(document, bool) or not isinstance(document, (int, float)):
        raise _RequirementError(f" must be a number; got {_shown(document)}")
    if not -sys.float_info.max <= document <= sys.float_info.max:  # NaN neither
        raise _RequirementError(f" must be a finite number; got {_shown(document)}")
    return float(document)


def _number_to_json(name: str, value: Any) -> float | str:
    number = float(value)
    if math.isnan(number):
        raise InputError(f"{name} must be a number; got NaN")
    if math.isinf(number):
        return "infinity" if number > 0 else "-infinity"
    return number


def _time_from_json(document: Any) -> datetime:
    try:
        return datetime.fromisoformat(document)
    except (TypeError, ValueError) as error:
        raise _RequirementError(
            f" must be a date and time as 2026-11-22T10:00:00+00:00; got {_shown(document)}"
        ) from error


# How a plain type is read and, by the name of its field and the value, written.
_PLAIN: Mapping[Any, tuple[Callable[[Any], Any], Callable[[str, Any], Any]]] = {
    int: (partial(_exactly, int, "a whole number of at most 64 bits"), lambda _, value: int(value)),
    str: (partial(_exactly, str, "text"), lambda _, value: value),
    bool: (partial(_exactly, bool, "true or false"), lambda _, value: value),
    float: (_number_from_json, _number_to_json),
    datetime: (_time_from_json, lambda _, value: value.isoformat()),
}


def _require_list(length: int | None, document: Any) -> Any:
    if not isinstance(document, list) or (length is not None and len(document) != length):
        raise _RequirementError(f" must be a list{'' if length is None else f' of {length}'}; got {_shown(document)}")
    return document


def _require_mapping(document: Any) -> Any:
    if not isinstance(document, dict):
        raise _RequirementError(f" must be a mapping; got {_shown(document)}")
    return document


READABLE = 64  # numbers in an array that is written as a list
LARGEST_ARRAY = 16_000_000
MOST_UNPACKED = 256 * 2**20  # bytes of all packed arrays together, enough for a camera of 10 million pixels
PIECE = 4096  # packed bytes; each unpacks to at most 1032
_PACKED_KEYS = {"shape", "kind", "sha256", "zlib"}
_KINDS: dict[str, np.dtype[Any]] = {"single": np.dtype("<f4"), "double": np.dtype("<f8"), "bool": np.dtype("?")}


def _array_to_json(name: str, values: NDArray[Any], info: SerializationInfo) -> Any:
    """A list of numbers, or compressed text with shape, type and hash; without the text where nothing is packed."""
    if not np.isfinite(values).all():
        raise InputError(f"{name} must be an array of finite numbers; got NaN or an infinite one")
    if values.size <= READABLE:
        return values.tolist()
    with np.errstate(over="ignore"):
        is_single = np.array_equal(values.astype("<f4"), values)
    kind = "bool" if values.dtype == bool else "single" if is_single else "double"
    content = np.ascontiguousarray(values, dtype=_KINDS[kind]).tobytes()
    document = {"shape": list(values.shape), "kind": kind, "sha256": hashlib.sha256(content).hexdigest()}
    packed = cast("Mapping[str, bool]", info.context)["pack"]
    return document | {"zlib": base64.b64encode(zlib.compress(content, 6)).decode()} if packed else document


def _array_from_json(document: Any) -> NDArray[Any]:
    if isinstance(document, np.ndarray):  # samples come from a separate file
        return document
    if isinstance(document, list):
        try:
            values = np.array(document)
        except (ValueError, OverflowError, RecursionError) as error:
            raise _RequirementError(" must be an array of numbers; its rows differ in length") from error
        _require(values.dtype.kind in "biuf", "an array of numbers", document)
    else:
        _require(isinstance(document, dict) and set(document) == _PACKED_KEYS, "an array", document)
        shape, kind = document["shape"], document["kind"]
        size = _declared_bytes(shape, kind)
        _require(size > 0, "a map of sensible size", shape)
        content = _unpacked(document["zlib"], size)
        if hashlib.sha256(content).hexdigest() != document["sha256"]:
            raise _RequirementError(
                " must be as it was written; it does not match its hash, so it was changed", CalibrationError
            )
        values = np.frombuffer(content, dtype=_KINDS[kind]).reshape(shape).astype(bool if kind == "bool" else float)
    _require(bool(np.isfinite(values).all()), "an array of finite numbers", "NaN or an infinite one")
    return values


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
            if not size:
                raise InputError(
                    f"{where} must be of maps of at most {LARGEST_ARRAY} numbers, a sensible size; "
                    f"got {item['shape']!r:.80}"
                )
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


def _unpacked(packed: Any, size: int) -> bytearray:
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
        raise _RequirementError(f" must be a whole map; it is damaged: {error!s:.80}") from error
    if position != size or not unpacker.eof:
        raise _RequirementError(f" must be a whole map of {size} bytes; got another number")
    return content


def _require(sound: bool, what: str, got: Any) -> None:
    if not sound:
        raise _RequirementError(f" must be {what}; got {got!r:.80}")


def _free_from_json(document: Any) -> Any:
    try:
        return free_from_json(_require_mapping(document), "")
    except InputError as error:
        raise _RequirementError(str(error)) from error


def free_to_json(value: Any, where: str, depth: int = DEEPEST) -> Any:
    """JSON values of a value of any structure; ``where`` names it in errors.

    Raises
    ------
    InputError
        When it is not a number, text, a time, a path, or lists, arrays and mappings of them, or is nested too deeply.

    Examples
    --------
    >>> free_to_json({"gain": np.float64(2.5), "roi": (0, 8), "until": math.inf}, "settings")
    {'gain': 2.5, 'roi': [0, 8], 'until': {'$number': 'infinity'}}
    """
    if depth < 0:
        raise InputError(f"{where} must be nested at most {DEEPEST} deep; got more")
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, str) and _SURROGATE.search(value):
        raise InputError(f"{where} must be text that UTF-8 can hold; got {value!r:.80}")
    if value is None or isinstance(value, (str, bool, np.bool_)):
        return bool(value) if isinstance(value, np.bool_) else value
    if isinstance(value, (int, np.integer)):
        if not -WIDEST_INTEGER <= value < WIDEST_INTEGER:
            raise InputError(f"{where} must be a whole number of at most 64 bits; got one of {int(value).bit_length()}")
        return int(value)
    if isinstance(value, (float, np.floating)):
        return _free_number(float(value))
    if isinstance(value, (datetime, PurePath)):
        return value.isoformat() if isinstance(value, datetime) else str(value)
    if isinstance(value, np.ndarray):
        return free_to_json(value.tolist(), where, depth)
    if is_dataclass(value) and not isinstance(value, type):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        return _mapping_to_json(value, where, depth)
    if isinstance(value, (tuple, list)):
        return [free_to_json(item, f"{where}[{at}]", depth - 1) for at, item in enumerate(value)]
    raise InputError(f"{where} must be a number, text, or lists and mappings of them; got a {type(value).__name__}")


def _mapping_to_json(value: Mapping[Any, Any], where: str, depth: int) -> dict[str, Any]:
    document = {str(name): free_to_json(item, f"{where}.{name}"[:120], depth - 1) for name, item in value.items()}
    if len(document) != len(value) or NUMBER in document:
        raise InputError(f"{where} must have names that differ, none of them {NUMBER!r}; got {sorted(document)!r:.200}")
    return document


def _free_number(value: float) -> float | dict[str, str]:
    if math.isfinite(value):
        return value
    return {NUMBER: "nan" if math.isnan(value) else "infinity" if value > 0 else "-infinity"}


def free_from_json(document: Any, where: str, depth: int = DEEPEST) -> Any:
    """The value that `free_to_json` wrote as ``document``; `InputError` when it cannot have written it."""
    if depth < 0:
        raise InputError(f"{where} must be nested at most {DEEPEST} deep; got more")
    if isinstance(document, dict):
        if NUMBER in document:
            name = document[NUMBER]
            if len(document) > 1 or not isinstance(name, str) or name not in SPECIAL_NUMBERS:
                raise InputError(f"{where} must hold a number as {sorted(SPECIAL_NUMBERS)}; got {document!r:.80}")
            return SPECIAL_NUMBERS[name]
        return {name: free_from_json(item, f"{where}.{name}"[:120], depth - 1) for name, item in document.items()}
    if isinstance(document, list):
        return [free_from_json(item, f"{where}[{at}]"[:120], depth - 1) for at, item in enumerate(document)]
    if isinstance(document, float) and not math.isfinite(document):
        raise InputError(f"{where} must be a number that a file can hold; got {document}")
    return document

"""Fields of a plain value, each checked for its type before a frozen value is made of them."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from datetime import datetime
from enum import Enum
from functools import cache
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable


Found = TypeVar("Found")
LARGEST_INTEGER = 2**53
LARGEST = sys.float_info.max


def require_fields(requested: Any, document: Any, where: str, *, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """``document`` when it holds exactly the fields of the class ``requested`` except those in ``without``.

    Raises
    ------
    InputError
        When it holds fewer or more, or is no mapping.
    """
    names = _names(requested, without)
    if not isinstance(document, dict):
        raise _refusal(where, "an object with named values", document)
    if set(document) != names:
        missing, unknown = sorted(names - set(document)), sorted(set(document) - names)
        raise InputError(
            f"{where} must hold all of its values and no others; missing {missing}, unknown {unknown!r:.80}"
        )
    return document


@cache
def _names(requested: Any, without: tuple[str, ...]) -> frozenset[str]:
    return frozenset(field.name for field in fields(requested)) - set(without)


def text(document: Mapping[str, Any], name: str, where: str) -> str:
    """Text."""
    if not isinstance(document[name], str):
        raise _refusal(f"{where}.{name}", "text", document[name])
    return str(document[name])


def texts(document: Mapping[str, Any], name: str, where: str) -> tuple[str, ...]:
    """A list of text."""
    result = document[name]
    if not isinstance(result, list) or not all(isinstance(item, str) for item in result):
        raise _refusal(f"{where}.{name}", "a list of text", result)
    return tuple(result)


def truth_value(document: Mapping[str, Any], name: str, where: str) -> bool:
    """True or false."""
    if not isinstance(document[name], bool):
        raise _refusal(f"{where}.{name}", "true or false", document[name])
    return bool(document[name])


def whole(document: Mapping[str, Any], name: str, where: str) -> int:
    """A whole number."""
    result = document[name]
    if type(result) is not int or not -LARGEST_INTEGER <= result <= LARGEST_INTEGER:
        raise _refusal(f"{where}.{name}", "a whole number of sensible size", result)
    return int(result)


def at_least_one(document: Mapping[str, Any], name: str, where: str) -> int:
    """A whole number from 1."""
    result = whole(document, name, where)
    if result < 1:
        raise _refusal(f"{where}.{name}", "at least 1", result)
    return result


def number(document: Mapping[str, Any], name: str, where: str) -> float:
    """A finite number."""
    return _number(document[name], f"{where}.{name}")


def pair(document: Mapping[str, Any], name: str, where: str) -> tuple[float, float]:
    """Two finite numbers."""
    result = document[name]
    if not isinstance(result, list) or len(result) != 2:
        raise _refusal(f"{where}.{name}", "two numbers", result)
    return _number(result[0], f"{where}.{name}"), _number(result[1], f"{where}.{name}")


def numbers(document: Mapping[str, Any], name: str, where: str) -> dict[str, float]:
    """Finite numbers by name."""
    return mapping(document, name, where, _number)


def mapping(document: Mapping[str, Any], name: str, where: str, item: Callable[[Any, str], Found]) -> dict[str, Found]:
    """Values by name, every one made by ``item`` of the plain value and what errors call it."""
    result = document[name]
    if not isinstance(result, dict):
        raise _refusal(f"{where}.{name}", "a mapping", result)
    return {key: item(value, f"{where}.{name}.{key}"[:120]) for key, value in result.items()}


def spread(document: Any, where: str) -> float:
    """A number, or the word that stands for an infinite one."""
    return math.inf if document == "infinity" else _number(document, where)


def moment(document: Mapping[str, Any], name: str, where: str) -> datetime:
    """A time; whether it has a zone is asked of the value."""
    result = text(document, name, where)
    try:
        return datetime.fromisoformat(result)
    except ValueError as error:
        raise _refusal(f"{where}.{name}", "a date and time as 2026-11-22T10:00:00+00:00", result) from error


def absent(
    read: Callable[[Mapping[str, Any], str, str], Found], document: Mapping[str, Any], name: str, where: str
) -> Found | None:
    """What ``read`` finds, or None where nothing is known."""
    return None if document[name] is None else read(document, name, where)


def _number(result: Any, where: str) -> float:
    if isinstance(result, bool) or not isinstance(result, (int, float)):
        raise _refusal(where, "a number", result)
    if not -LARGEST <= result <= LARGEST:  # NaN is not either
        raise _refusal(where, "a finite number", result)
    return float(result)


def _refusal(where: str, what: str, got: Any) -> InputError:
    shown = f"a number of {got.bit_length()} bits" if type(got) is int and got.bit_length() > 128 else f"{got!r:.80}"
    return InputError(f"{where} must be {what}; got {shown}")


NUMBER = "$number"  # {"$number": "infinity"}: what JSON has no number for
WORDS = {"infinity": math.inf, "-infinity": -math.inf, "nan": math.nan}
_HALF_LETTER = re.compile(r"[\ud800-\udfff]")
DEEPEST, WIDEST_INTEGER = 32, 2**63


def free_to_plain(value: Any, where: str, depth: int = DEEPEST) -> Any:
    """What JSON can hold of a value of any shape; ``where`` names it in errors.

    Raises
    ------
    InputError
        When it is neither a number, text, a time, a path, nor lists, arrays and mappings of them, or nested too deep.

    Examples
    --------
    >>> free_to_plain({"gain": np.float64(2.5), "roi": (0, 8), "until": math.inf}, "settings")
    {'gain': 2.5, 'roi': [0, 8], 'until': {'$number': 'infinity'}}
    """
    if depth < 0:
        raise InputError(f"{where} must be nested at most {DEEPEST} deep; got more")
    if isinstance(value, Enum):
        value = value.value
    if isinstance(value, str) and _HALF_LETTER.search(value):
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
        return free_to_plain(value.tolist(), where, depth)
    if is_dataclass(value) and not isinstance(value, type):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        return _mapping_to_plain(value, where, depth)
    if isinstance(value, (tuple, list)):
        return [free_to_plain(item, f"{where}[{at}]", depth - 1) for at, item in enumerate(value)]
    raise InputError(f"{where} must be a number, text, or lists and mappings of them; got a {type(value).__name__}")


def _mapping_to_plain(value: Mapping[Any, Any], where: str, depth: int) -> dict[str, Any]:
    document = {str(name): free_to_plain(item, f"{where}.{name}"[:120], depth - 1) for name, item in value.items()}
    if len(document) != len(value) or NUMBER in document:
        raise InputError(f"{where} must have names that differ, none of them {NUMBER!r}; got {sorted(document)!r:.200}")
    return document


def _free_number(value: float) -> float | dict[str, str]:
    if math.isfinite(value):
        return value
    return {NUMBER: "nan" if math.isnan(value) else "infinity" if value > 0 else "-infinity"}


def free_of_plain(document: Any, where: str, depth: int = DEEPEST) -> Any:
    """The value that `free_to_plain` made ``document`` of.

    Raises
    ------
    InputError
        When nothing can have become that.
    """
    if depth < 0:
        raise InputError(f"{where} must be nested at most {DEEPEST} deep; got more")
    if isinstance(document, dict):
        if NUMBER in document:
            term = document[NUMBER]
            if len(document) > 1 or not isinstance(term, str) or term not in WORDS:
                raise InputError(f"{where} must hold a number as {sorted(WORDS)}; got {document!r:.80}")
            return WORDS[term]
        return {name: free_of_plain(item, f"{where}.{name}"[:120], depth - 1) for name, item in document.items()}
    if isinstance(document, list):
        return [free_of_plain(item, f"{where}[{at}]"[:120], depth - 1) for at, item in enumerate(document)]
    if isinstance(document, float) and not math.isfinite(document):
        raise InputError(f"{where} must be a number that a file can hold; got {document}")
    return document

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


def require_fields(wanted: Any, plain: Any, where: str, *, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """``plain`` when it holds exactly the fields of the class ``wanted`` except those in ``without``.

    Raises
    ------
    InputError
        When it holds fewer or more, or is no mapping.
    """
    names = _names(wanted, without)
    if not isinstance(plain, dict):
        raise _refusal(where, "an object with named values", plain)
    if set(plain) != names:
        missing, unknown = sorted(names - set(plain)), sorted(set(plain) - names)
        raise InputError(
            f"{where} must hold all of its values and no others; missing {missing}, unknown {unknown!r:.80}"
        )
    return plain


@cache
def _names(wanted: Any, without: tuple[str, ...]) -> frozenset[str]:
    return frozenset(field.name for field in fields(wanted)) - set(without)


def text(plain: Mapping[str, Any], name: str, where: str) -> str:
    """Text."""
    if not isinstance(plain[name], str):
        raise _refusal(f"{where}.{name}", "text", plain[name])
    return str(plain[name])


def texts(plain: Mapping[str, Any], name: str, where: str) -> tuple[str, ...]:
    """A list of text."""
    found = plain[name]
    if not isinstance(found, list) or not all(isinstance(each, str) for each in found):
        raise _refusal(f"{where}.{name}", "a list of text", found)
    return tuple(found)


def truth_value(plain: Mapping[str, Any], name: str, where: str) -> bool:
    """True or false."""
    if not isinstance(plain[name], bool):
        raise _refusal(f"{where}.{name}", "true or false", plain[name])
    return bool(plain[name])


def whole(plain: Mapping[str, Any], name: str, where: str) -> int:
    """A whole number."""
    found = plain[name]
    if type(found) is not int or not -LARGEST_INTEGER <= found <= LARGEST_INTEGER:
        raise _refusal(f"{where}.{name}", "a whole number of sensible size", found)
    return int(found)


def at_least_one(plain: Mapping[str, Any], name: str, where: str) -> int:
    """A whole number from 1."""
    found = whole(plain, name, where)
    if found < 1:
        raise _refusal(f"{where}.{name}", "at least 1", found)
    return found


def number(plain: Mapping[str, Any], name: str, where: str) -> float:
    """A finite number."""
    return _number(plain[name], f"{where}.{name}")


def pair(plain: Mapping[str, Any], name: str, where: str) -> tuple[float, float]:
    """Two finite numbers."""
    found = plain[name]
    if not isinstance(found, list) or len(found) != 2:
        raise _refusal(f"{where}.{name}", "two numbers", found)
    return _number(found[0], f"{where}.{name}"), _number(found[1], f"{where}.{name}")


def numbers(plain: Mapping[str, Any], name: str, where: str) -> dict[str, float]:
    """Finite numbers by name."""
    return mapping(plain, name, where, _number)


def mapping(plain: Mapping[str, Any], name: str, where: str, each: Callable[[Any, str], Found]) -> dict[str, Found]:
    """Values by name, every one made by ``each`` of the plain value and what errors call it."""
    found = plain[name]
    if not isinstance(found, dict):
        raise _refusal(f"{where}.{name}", "a mapping", found)
    return {key: each(value, f"{where}.{name}.{key}"[:120]) for key, value in found.items()}


def spread(plain: Any, where: str) -> float:
    """A number, or the word that stands for an infinite one."""
    return math.inf if plain == "infinity" else _number(plain, where)


def moment(plain: Mapping[str, Any], name: str, where: str) -> datetime:
    """A time; whether it has a zone is asked of the value."""
    found = text(plain, name, where)
    try:
        return datetime.fromisoformat(found)
    except ValueError as error:
        raise _refusal(f"{where}.{name}", "a date and time as 2026-11-22T10:00:00+00:00", found) from error


def absent(
    read: Callable[[Mapping[str, Any], str, str], Found], plain: Mapping[str, Any], name: str, where: str
) -> Found | None:
    """What ``read`` finds, or None where nothing is known."""
    return None if plain[name] is None else read(plain, name, where)


def _number(found: Any, where: str) -> float:
    if isinstance(found, bool) or not isinstance(found, (int, float)):
        raise _refusal(where, "a number", found)
    if not -LARGEST <= found <= LARGEST:  # NaN is not either
        raise _refusal(where, "a finite number", found)
    return float(found)


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
        return [free_to_plain(each, f"{where}[{at}]", depth - 1) for at, each in enumerate(value)]
    raise InputError(f"{where} must be a number, text, or lists and mappings of them; got a {type(value).__name__}")


def _mapping_to_plain(value: Mapping[Any, Any], where: str, depth: int) -> dict[str, Any]:
    plain = {str(name): free_to_plain(each, f"{where}.{name}"[:120], depth - 1) for name, each in value.items()}
    if len(plain) != len(value) or NUMBER in plain:
        raise InputError(f"{where} must have names that differ, none of them {NUMBER!r}; got {sorted(plain)!r:.200}")
    return plain


def _free_number(value: float) -> float | dict[str, str]:
    if math.isfinite(value):
        return value
    return {NUMBER: "nan" if math.isnan(value) else "infinity" if value > 0 else "-infinity"}


def free_of_plain(plain: Any, where: str, depth: int = DEEPEST) -> Any:
    """The value that `free_to_plain` made ``plain`` of.

    Raises
    ------
    InputError
        When nothing can have become that.
    """
    if depth < 0:
        raise InputError(f"{where} must be nested at most {DEEPEST} deep; got more")
    if isinstance(plain, dict):
        if NUMBER in plain:
            word = plain[NUMBER]
            if len(plain) > 1 or not isinstance(word, str) or word not in WORDS:
                raise InputError(f"{where} must hold a number as {sorted(WORDS)}; got {plain!r:.80}")
            return WORDS[word]
        return {name: free_of_plain(each, f"{where}.{name}"[:120], depth - 1) for name, each in plain.items()}
    if isinstance(plain, list):
        return [free_of_plain(each, f"{where}[{at}]"[:120], depth - 1) for at, each in enumerate(plain)]
    if isinstance(plain, float) and not math.isfinite(plain):
        raise InputError(f"{where} must be a number that a file can hold; got {plain}")
    return plain

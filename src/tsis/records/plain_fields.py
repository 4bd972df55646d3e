"""Fields of a plain value, each checked for its type before a frozen value is made of them."""

from __future__ import annotations

import math
import sys
from dataclasses import fields
from datetime import datetime
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

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

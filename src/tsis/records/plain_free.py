"""Mappings of any shape, as settings and options, as plain values for JSON, and back.

Tuples, arrays, paths and NumPy's numbers in them become lists, text and Python's numbers; the rest comes
back as it was.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from datetime import datetime
from enum import Enum
from pathlib import PurePath
from typing import Any

import numpy as np

from tsis.model.errors import InputError

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

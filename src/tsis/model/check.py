"""Checks that values make of their fields: one clear sentence, or nothing."""

from __future__ import annotations

import difflib
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.model.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray


def number(name: str, value: object, low: float, high: float, *, hint: str = "") -> float:
    """Return ``value`` as a float when it is finite and lies in ``[low, high]``, else say why not."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(f"{name} must be a number; got {value!r}")
    result = float(value)
    if not math.isfinite(result) or not low <= result <= high:
        raise InputError(f"{name} must lie in [{low:g}, {high:g}]; got {result:g}" + (f" ({hint})" if hint else ""))
    return result


def array(name: str, value: Any, *, ndim: int, dtype: type = float) -> NDArray[Any]:
    """Return a read-only copy of ``value`` with ``ndim`` axes, not empty, all finite."""
    try:
        result: NDArray[Any] = np.array(value, dtype=dtype)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers with {ndim} axes; got {type(value).__name__}") from error
    if result.ndim != ndim:
        raise InputError(f"{name} must have {ndim} axes; got shape {result.shape}")
    if result.size == 0:
        raise InputError(f"{name} must not be empty; got shape {result.shape}")
    bad = int(np.count_nonzero(~np.isfinite(result)))
    if bad:
        raise InputError(f"{name} must be finite; got {bad} NaN or infinite values out of {result.size}")
    result.flags.writeable = False
    return result


def known(kind: str, name: str, names: Iterable[str]) -> str:
    """Return ``name`` when it is among ``names``, else suggest the nearest."""
    choices = sorted(names)
    if name in choices:
        return name
    nearest = difflib.get_close_matches(name, choices, n=1, cutoff=0.0)
    raise UnknownNameError(f"no {kind} is called {name!r}; did you mean {nearest[0]!r}? known: {', '.join(choices)}")

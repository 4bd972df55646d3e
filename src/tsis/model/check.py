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
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result) or not low <= result <= high:
        raise InputError(f"{name} must lie in [{low:g}, {high:g}]; got {result:g}" + (f" ({hint})" if hint else ""))
    return result


def kind(name: str, value: object, wanted: type) -> None:
    """Refuse a value that is not of the class ``wanted``."""
    if not isinstance(value, wanted):
        raise InputError(f"{name} must be a {wanted.__name__}; got {value!r:.80}")


def pair(name: str, value: Any) -> tuple[float, float]:
    """Return ``value`` as two finite numbers."""
    result = array(name, value, ndim=1)
    if result.shape != (2,):
        raise InputError(f"{name} must hold two numbers; got {value!r}")
    return float(result[0]), float(result[1])


def array(name: str, value: Any, *, ndim: int, dtype: type = float) -> NDArray[Any]:
    """Return a read-only copy of ``value`` with ``ndim`` axes, not empty, all finite."""
    try:
        # "same_kind" takes integers for floats, and neither text nor complex numbers.
        result: NDArray[Any] = np.array(value).astype(dtype, casting="same_kind")
    except (TypeError, ValueError, OverflowError) as error:
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


def known(what: str, name: str, names: Iterable[str]) -> str:
    """Return ``name`` when it is among ``names``, else suggest the nearest."""
    choices = sorted(names)
    if name in choices:
        return name
    nearest = difflib.get_close_matches(str(name), choices, n=1, cutoff=0.0)
    raise UnknownNameError(f"no {what} is called {name!r}; did you mean {nearest[0]!r}? known: {', '.join(choices)}")

"""Checks of values, with a clear message."""

from __future__ import annotations

import difflib
import math
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray


def require_number(name: str, value: object, low: float, high: float, *, hint: str = "") -> float:
    """Return ``value`` as a float when it is finite and lies in ``[low, high]``, else raise `InputError`."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(name=name, requirement="must be a number", value=f"{value!r:.80}")
    result = _as_float(value)
    if not math.isfinite(result) or not low <= result <= high:
        cure = _suspected(result, low, high, hint) if hint else ""
        raise _outside(name, result, low, high, hint=hint, cure=cure)
    return result


def _outside(name: str, value: float, low: float, high: float, *, hint: str, cure: str = "") -> InputError:
    requirement = f"must lie in [{low:g}, {high:g}]"
    return InputError(
        name=name, requirement=requirement, value=f"{value:g}", hint=hint, cure=cure, bounds=(float(low), float(high))
    )


_MISTAKEN = {"newtons": ("millinewtons", 1e-3), "millimetres": ("metres", 1e3), "kilopascals": ("pascals", 1e-3)}


def _suspected(value: float, low: float, high: float, hint: str) -> str:
    """Names the unit that was probably meant, where the value would lie within its range."""
    unit, factor = _MISTAKEN.get(hint.split()[0], ("", 0.0))
    meant = value * factor
    return f"that would be {meant:g} if it was given in {unit}" if unit and meant > 0 and low <= meant <= high else ""


def require_integer(name: str, value: object, low: int, high: int, *, hint: str = "") -> int:
    """Return ``value`` as an int when it is a whole number, e.g. 3 or 3.0 or 1e6, in ``[low, high]``."""
    # Infinity and NaN are not whole.
    has_fraction = isinstance(value, (float, np.floating)) and not float(value).is_integer()
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)) or has_fraction:
        raise InputError(name=name, requirement="must be a whole number", value=f"{value!r:.80}", hint=hint)
    result = int(value)  # a float would round large seeds
    if not low <= result <= high:
        raise _outside(name, _as_float(result), low, high, hint=hint)
    return result


def _as_float(value: float | np.integer[Any] | np.floating[Any]) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def require_type(name: str, value: object, requested: type) -> None:
    """Raise `InputError` unless ``value`` is of the class ``requested``."""
    if not isinstance(value, requested):
        raise InputError(name=name, requirement=f"must be a {requested.__name__}", value=f"{value!r:.80}")


def require_pair(name: str, value: Any) -> tuple[float, float]:
    """Return ``value`` as two finite numbers."""
    if type(value) is tuple and len(value) == 2 and all(type(item) is float and math.isfinite(item) for item in value):
        return value  # the fast path of stored presses
    result = require_array(name, value, ndim=1)
    if result.shape != (2,):
        raise InputError(name=name, requirement="must hold two numbers", value=f"{value!r:.80}")
    return float(result[0]), float(result[1])


def require_array(name: str, value: Any, *, ndim: int, dtype: type = float) -> NDArray[Any]:
    """Return a read-only copy of ``value`` with ``ndim`` axes, not empty, all finite."""
    if np.ma.is_masked(value):
        raise InputError(f"{name} must not hold masked values; leave them out before")
    try:
        # "same_kind" takes integers for floats, and neither text nor complex numbers.
        result: NDArray[Any] = np.array(value).astype(dtype, casting="same_kind", copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name} must be an array of numbers with {ndim} axes; got {type(value).__name__}") from error
    if result.ndim != ndim:
        raise InputError(f"{name} must have {ndim} axes; got shape {result.shape}")
    if result.size == 0:
        raise InputError(f"{name} must not be empty; got shape {result.shape}")
    whole_numbers = result.dtype.kind in "iu"  # always finite
    bad = 0 if whole_numbers else int(np.count_nonzero(~np.isfinite(result)))
    if bad:
        raise InputError(f"{name} must be finite; got {bad} NaN or infinite values out of {result.size}")
    result.flags.writeable = False
    return result


def freeze_arrays(value: object, *names: str, dtype: type | None = None) -> None:
    """Replace the named fields of a frozen value by read-only copies as arrays."""
    for name in names:
        array = np.array(getattr(value, name), dtype=dtype)
        array.flags.writeable = False
        object.__setattr__(value, name, array)


def freeze_mappings(value: object, *names: str) -> None:
    """Replace the named fields of a frozen value by read-only copies as mappings."""
    for name in names:
        object.__setattr__(value, name, MappingProxyType(dict(getattr(value, name))))


def require_one_of(what: str, name: str, names: Iterable[str]) -> str:
    """Return ``name`` when it is among ``names``, else suggest the nearest."""
    choices = sorted(names)
    if name in choices:
        return name
    nearest = difflib.get_close_matches(str(name)[:80], choices, n=1, cutoff=0.0)
    raise UnknownNameError(
        f"no {what} is called {name!r:.80}; did you mean {nearest[0]!r}? known: {', '.join(choices)}"
    )

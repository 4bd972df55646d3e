"""Compiling of the tracer's inner functions, with their types kept for the type checker."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

# Products may be fused and divisions shared; infinities and NaN stay what they are.
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "cache": True,
    "error_model": "numpy",
    "fastmath": {"contract", "arcp", "nsz"},
}
_SOURCES = sorted(Path(__file__).parent.glob("rays_*.py"))
_STAMP = hashlib.sha256(b"".join(source.read_bytes() for source in _SOURCES)).hexdigest()


def compiled(function: Function) -> Function:
    """Compile to machine code that runs beside other Python threads and is kept on disk."""
    return cast("Function", _stamped(numba.njit(**_OPTIONS)(function)))


def inlined(function: Function) -> Function:
    """Compile into every caller: else each call would copy all fields of the scene, which takes half of the time."""
    return cast("Function", _stamped(numba.njit(forceinline=True, **_OPTIONS)(function)))


def _stamped(dispatcher: Any) -> Any:
    # numba keeps machine code until the function's own file changes; what it calls lies in the other files.
    dispatcher._cache._cache_file._source_stamp = _STAMP
    return dispatcher

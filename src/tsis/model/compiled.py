"""Compiling of inner functions to machine code, with their types kept for the type checker."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

_EXACT: dict[str, Any] = {"nogil": True, "cache": True, "error_model": "numpy"}
# Products may be fused and divisions shared; infinities and NaN stay what they are.
_FUSED: dict[str, Any] = {**_EXACT, "fastmath": {"contract", "arcp", "nsz"}}


def compiled(function: Function) -> Function:
    """Compile to machine code that runs beside other Python threads and is kept on disk; rounds as Python does."""
    return cast("Function", _stamped(numba.njit(**_EXACT)(function), function))


def fused(function: Function) -> Function:
    """The same, rounding less often and faster: for loops whose own error is far larger than rounding."""
    return cast("Function", _stamped(numba.njit(**_FUSED)(function), function))


def inlined(function: Function) -> Function:
    """`fused` into every caller: else each call would copy all fields of the scene, which takes half of the time."""
    return cast("Function", _stamped(numba.njit(forceinline=True, **_FUSED)(function), function))


def _stamped(dispatcher: Any, function: Callable[..., Any]) -> Any:
    # numba keeps machine code until the function's own file changes; what it calls lies in the other files.
    cache = getattr(dispatcher, "_cache", None)  # none where NUMBA_DISABLE_JIT leaves functions as they are
    if cache is not None:
        cache._cache_file._source_stamp = _stamp(Path(function.__code__.co_filename).parent)
    return dispatcher


@lru_cache
def _stamp(room: Path) -> str:
    """Hash of all sources that a function in this folder is made of, these options among them."""
    sources = sorted({Path(__file__), *room.rglob("*.py")})
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()

"""Compiling of the tracer's inner functions, with their types kept for the type checker."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile to machine code that runs beside other Python threads and is kept on disk."""
    return cast("Function", numba.njit(nogil=True, cache=True, error_model="numpy")(function))

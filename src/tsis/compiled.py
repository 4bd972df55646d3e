"""Inner functions as machine code, with their types kept for the type checker, and linear algebra on one thread."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
from threadpoolctl import ThreadpoolController

if TYPE_CHECKING:
    from contextlib import AbstractContextManager


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
        cache._cache_file._source_stamp = _stamp(_package(Path(function.__code__.co_filename).parent))
    return dispatcher


def _package(folder: Path) -> Path:
    """Find the package of the project, as ``tsis/optics``, that the folder belongs to; else the folder itself."""
    while (folder.parent / "__init__.py").exists() and (folder.parent.parent / "__init__.py").exists():
        folder = folder.parent
    return folder


@lru_cache
def _stamp(package: Path) -> str:
    """Hash of all sources that a function in this package is made of, these options among them."""
    sources = sorted({Path(__file__), *package.rglob("*.py")})
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()


def one_blas_thread() -> AbstractContextManager[object]:
    """Limit BLAS to one thread for the length of a ``with``."""
    return cast("AbstractContextManager[object]", _controller().limit(limits=1, user_api="blas"))


@cache
def _controller() -> ThreadpoolController:
    """Find the libraries once: looking through all that the process has loaded takes 15 ms."""
    import scipy.linalg  # noqa: F401 (brings a BLAS of its own, which must be loaded to be found)

    return ThreadpoolController()

"""Compiled inner functions, and linear algebra on one thread."""

from __future__ import annotations

import hashlib
import logging
import threading
from collections.abc import Callable
from functools import cache, cached_property, lru_cache, update_wrapper
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

from threadpoolctl import ThreadpoolController

if TYPE_CHECKING:
    from contextlib import AbstractContextManager


Function = TypeVar("Function", bound=Callable[..., Any])
logger = logging.getLogger("tsis")


_EXACT: dict[str, Any] = {"nogil": True, "cache": True, "error_model": "numpy"}
# Multiplications and additions may be fused and reciprocals reused; infinities and NaN remain exact.
_FUSED: dict[str, Any] = {**_EXACT, "fastmath": {"contract", "arcp", "nsz"}}
_making = threading.RLock()


def compiled(function: Function) -> Function:
    """Compile to machine code without the interpreter lock, cached on disk; it rounds as Python does."""
    return cast("Function", _Compiled(function, _EXACT))


def fused(function: Function) -> Function:
    """Compile with fused, faster arithmetic, for loops whose error is far larger than rounding."""
    return cast("Function", _Compiled(function, _FUSED))


def inlined(function: Function) -> Function:
    """Compile `fused` and inline into callers: a call would copy all fields of the scene, half of the time."""
    return cast("Function", _Compiled(function, {"forceinline": True, **_FUSED}))


class _Compiled:
    """A function that numba, which takes a fifth of a second to load, compiles when it is first called."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func, self._options = function, options
        self._made: Any = None

    def __call__(self, *given: Any, **named: Any) -> Any:
        return self.dispatcher(*given, **named)

    @cached_property
    def dispatcher(self) -> Any:
        """What numba makes of the function."""
        with _making:  # another thread must not call what lacks its callees
            return self._dispatcher()

    def _dispatcher(self) -> Any:
        """The same; in the function's module, the functions that it calls become what numba makes of them."""
        if self._made is None:  # a function may call itself
            self._made = _stamped(_numba().njit(**self._options)(self.py_func), self.py_func)
            names = self.py_func.__globals__
            for name in self.py_func.__code__.co_names:
                if isinstance(names.get(name), _Compiled):
                    names[name] = names[name]._dispatcher()
        return self._made


@cache
def _numba() -> Any:
    """The compiler, which logs once that functions are compiled: it takes seconds, and code from the cache none."""
    import numba
    from numba.core import event

    class Announcement(event.Listener):
        def on_start(self, _event: event.Event) -> None:
            event.unregister("numba:compile", self)  # type: ignore[no-untyped-call]
            logger.info("compiling the numerical loops, once on this machine")

        def on_end(self, _event: event.Event) -> None:
            """End of a compilation, of which nothing is said."""

    event.register("numba:compile", Announcement())  # type: ignore[no-untyped-call]
    return numba


def _stamped(dispatcher: Any, function: Callable[..., Any]) -> Any:
    # numba caches machine code until the function's own file changes; its callees lie in other files.
    cache = getattr(dispatcher, "_cache", None)  # None under NUMBA_DISABLE_JIT
    if cache is not None:
        cache._cache_file._source_stamp = _stamp(_package(Path(function.__code__.co_filename).parent))
    return dispatcher


def _package(folder: Path) -> Path:
    """Find the folder's package below ``tsis``, as ``tsis/optics``; else the folder itself."""
    while (folder.parent / "__init__.py").exists() and (folder.parent.parent / "__init__.py").exists():
        folder = folder.parent
    return folder


@lru_cache
def _stamp(package: Path) -> str:
    """Hash of all sources of a package and of this file."""
    sources = sorted({Path(__file__), *package.rglob("*.py")})
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()


def one_blas_thread() -> AbstractContextManager[object]:
    """Limit BLAS to one thread in a ``with`` block."""
    return cast("AbstractContextManager[object]", _controller().limit(limits=1, user_api="blas"))


@cache
def _controller() -> ThreadpoolController:
    """Find the BLAS libraries once: the search takes 15 ms."""
    import scipy.linalg  # noqa: F401 (loads its own BLAS before the search)

    return ThreadpoolController()

"""Linear algebra on one thread: matrices as small as those here only lose time to more."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, cast

from threadpoolctl import ThreadpoolController

if TYPE_CHECKING:
    from contextlib import AbstractContextManager


def one_blas_thread() -> AbstractContextManager[object]:
    """Limit BLAS to one thread for the length of a ``with``."""
    return cast("AbstractContextManager[object]", _controller().limit(limits=1, user_api="blas"))


@cache
def _controller() -> ThreadpoolController:
    """Find the libraries once: looking through all that the process has loaded takes 15 ms."""
    import scipy.linalg  # noqa: F401 (brings a BLAS of its own, which must be loaded to be found)

    return ThreadpoolController()

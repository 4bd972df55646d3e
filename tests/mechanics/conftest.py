from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from threadpoolctl import threadpool_limits

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(scope="session", autouse=True)
def one_thread_a_worker() -> Iterator[None]:
    """Matrices this small only lose time to threads, the more so when several workers run."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield

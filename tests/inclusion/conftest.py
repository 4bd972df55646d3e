from __future__ import annotations

import fcntl
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits

import tsis
from tsis.inclusion import InclusionPrior
from tsis.mechanics import build_surrogate
from tsis.model import disk_cache

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.mechanics import PressSurrogate

settings.register_profile("no deadline", deadline=None)  # a busy machine is no failure
settings.load_profile("no deadline")


@pytest.fixture(scope="session", autouse=True)
def one_thread_a_worker() -> Iterator[None]:
    """Matrices this small only lose time to threads, the more so when several workers run."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield


@pytest.fixture(scope="session")
def surrogate() -> PressSurrogate:
    """The default surrogate, solved by one worker on all cores while the others wait for it."""
    disk_cache.folder().mkdir(parents=True, exist_ok=True)
    with (disk_cache.folder() / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return build_surrogate(tsis.load_probe("tsis-2011"), InclusionPrior().box())

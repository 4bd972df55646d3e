from __future__ import annotations

import fcntl
from typing import TYPE_CHECKING, TypeVar

import pytest

import tsis
from tsis.files.cache import cache_folder
from tsis.inclusion import InclusionPrior
from tsis.mechanics.surrogate.building import build_surrogate
from tsis.mechanics.surrogate.full_contact import build_full_contact_surrogate

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.mechanics.surrogate.full_contact import FullContactSurrogate
    from tsis.mechanics.surrogate.polynomial import PressSurrogate

T = TypeVar("T")


def built_once(build: Callable[[], T]) -> T:
    """Solved by one worker on all cores while the others wait for it."""
    cache_folder().mkdir(parents=True, exist_ok=True)
    with (cache_folder() / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return build()


@pytest.fixture(scope="session")
def surrogate() -> PressSurrogate:
    """Presses of the flat probe at 1 N."""
    return built_once(lambda: build_surrogate(tsis.load_probe("tsis-2011"), InclusionPrior().box()))


@pytest.fixture(scope="session")
def flat() -> FullContactSurrogate:
    """Every press of the flat probe."""
    return built_once(lambda: build_full_contact_surrogate(tsis.load_probe("tsis-2011"), InclusionPrior().box()))


@pytest.fixture(scope="session")
def domed() -> FullContactSurrogate:
    """Every press of the domed probe that covers its face."""
    return built_once(lambda: build_full_contact_surrogate(tsis.load_probe("tsis-domed"), InclusionPrior().box()))

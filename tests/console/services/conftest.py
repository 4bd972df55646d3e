from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.console.services.instruments import lit_instrument
from tests.console.services.lit_camera import World

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.console.services.instrument import Instrument


@pytest.fixture
def world() -> World:
    return World()


@pytest.fixture
def instrument(tmp_path: Path, world: World) -> Iterator[Instrument]:
    """An instrument with a camera of the test's world; Ann is its owner."""
    with lit_instrument(tmp_path, world) as created:
        yield created

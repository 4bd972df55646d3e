from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.console.services.instruments import ANN, lit_instrument
from tests.console.services.lit_camera import World

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.console.services import Instrument


@pytest.fixture
def world() -> World:
    return World()


@pytest.fixture
def lit(tmp_path: Path, world: World) -> Iterator[Instrument]:
    """An instrument with a camera of the test's world, which nobody holds yet."""
    with lit_instrument(tmp_path, world) as created:
        created.control.release(ANN)
        yield created

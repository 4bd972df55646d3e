from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.console.services.instruments import ANN, lit_instrument
from tests.console.services.lit_camera import World
from tests.present.rough_pictures import rough_pictures

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.console.services.instrument import Instrument


@pytest.fixture
def world() -> World:
    return World()


@pytest.fixture
def lit(tmp_path: Path, world: World) -> Iterator[Instrument]:
    """An instrument with a camera of the test's world, which nobody holds yet."""
    with lit_instrument(tmp_path, world) as created:
        created.control.release(ANN)
        yield created


@pytest.fixture(autouse=True)
def _fresh_readings(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have threads read camera and store as often as the fast clock of the simulated console asks for it."""
    for name in ("FRESH_S", "ENTRIES_FRESH_S"):
        monkeypatch.setattr(f"tsis.console.viewer.{name}", 0.01)
    monkeypatch.setattr("tsis.console.services.frames.EVERY_S", 0.01)


@pytest.fixture(scope="module", autouse=True)
def _rough_pictures() -> Iterator[None]:
    """Draw one picture of each title in a file and render none: tests of reports look at those."""
    with rough_pictures():
        yield

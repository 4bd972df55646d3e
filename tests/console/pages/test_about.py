"""About: what is in use and stored is what the instrument and its store have."""

from __future__ import annotations

import sqlite3
from importlib import metadata
from typing import TYPE_CHECKING

from nicegui import Client, background_tasks, ui
from tests.console.filled_store import fill
from tests.console.pages.simulated import at_console
from tests.console.services.instruments import ANN, lit_instrument

from tsis.__about__ import RESEARCH_USE_ONLY, __version__

if TYPE_CHECKING:
    from pathlib import Path

    import pytest
    from tests.console.pages.simulated import Operator


def test_it_counts_the_store_and_names_camera_calibration_and_versions(tmp_path: Path) -> None:
    fill(tmp_path / "store")
    counts = {}
    (file,) = (tmp_path / "store").glob("*.sqlite3")
    with sqlite3.connect(file) as rows:
        for table in ("targets", "presses", "estimates"):
            (counts[table],) = rows.execute(f"SELECT count(*) FROM {table}").fetchone()

    async def script(operator: Operator) -> None:
        await operator.sees("Versions", __version__, metadata.version("numpy"), "Camera", "not known before it runs")
        await operator.sees("none; lengths are in pixels, and nothing can be estimated", RESEARCH_USE_ONLY)
        await operator.sees(str((tmp_path / "store").resolve()), "in SQLite, in that folder")
        texts = operator.texts
        shown = {name: texts[texts.index(name.capitalize()) + 1] for name in counts}
        assert shown == {name: str(count) for name, count in counts.items()}
        assert not any("Redistribution and use" in text for text in texts)
        await operator.clicks("Read the licence")
        await operator.sees("Redistribution and use")
        instrument.start(by=instrument.control.owner().identity)  # type: ignore[union-attr]
        await operator.sees("Mode", "Mono8-64x48@100", "64 x 48 pixels")

    with lit_instrument(tmp_path) as instrument:
        instrument.control.release(ANN)
        at_console(instrument, script, "/about")


def test_the_end_stops_a_page_before_its_tasks_are_cancelled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cancelling that comes together with a timeout can be lost in Python 3.11, and the end would wait for ever."""
    teardown = background_tasks.teardown
    waiting: list[str] = []

    async def cancelling() -> None:
        waiting.extend(client.id for client in Client.instances.values() if not vars(client.outbox)["_should_stop"])
        await teardown()

    async def script(operator: Operator) -> None:
        await operator.sees("Versions")
        Client(ui.page("/left"))  # of a tab that was closed, kept for a while

    monkeypatch.setattr(background_tasks, "teardown", cancelling)
    with lit_instrument(tmp_path) as instrument:
        at_console(instrument, script, "/about")
    assert waiting == []

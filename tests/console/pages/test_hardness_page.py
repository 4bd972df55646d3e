"""Hardness between two looks into the store: nothing is said of another target, and trouble stays to be read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.console.pages.open_page import RecordingViewer, on_a_page, texts
from tests.console.services.instruments import ANN, lit_instrument

from tsis.console.pages.hardness import HardnessPage
from tsis.errors import RecordsError

if TYPE_CHECKING:
    from pathlib import Path

    import pytest

START = "Next: start the camera, on the page Examine; it is stopped."


def test_a_target_that_was_not_read_is_said_to_be_read(tmp_path: Path) -> None:
    with lit_instrument(tmp_path) as instrument:

        async def changed(viewer: RecordingViewer) -> None:
            page = HardnessPage(instrument, viewer)
            page._show(instrument.state())
            assert "Target 1 is being read." in texts(viewer)
            await page._refresh()
            assert START in texts(viewer)
            instrument.set_target(7, by=ANN)
            page._show(instrument.state())
            assert "Target 7 is being read." in texts(viewer)
            assert START not in texts(viewer)
            await page._refresh()
            assert START in texts(viewer)

        on_a_page(instrument, changed)


def test_why_the_store_was_not_read_stays_until_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> int:
        raise RecordsError("the store must be there; it is not")

    with lit_instrument(tmp_path) as instrument:

        async def troubled(viewer: RecordingViewer) -> None:
            page = HardnessPage(instrument, viewer)
            page._show(instrument.state())
            with monkeypatch.context() as patched:
                patched.setattr(instrument.store, "entries", broken)
                await page._refresh()
                page._show(instrument.state())  # which comes much more often
                assert "the store must be there; it is not" in texts(viewer)
            await page._refresh()
            assert "the store must be there; it is not" not in texts(viewer)
            assert START in texts(viewer)

        on_a_page(instrument, troubled)

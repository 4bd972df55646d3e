"""What is uploaded and what becomes of its copy."""

from __future__ import annotations

import tempfile
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from nicegui import ui
from tests.console.pages.open_page import RecordingViewer, on_a_page
from tests.console.services.instruments import FixedGauge, lit_instrument
from tests.waiting import HANGS_S

from tsis.console.pages.records import import_button
from tsis.console.services.jobs import AT_ONCE
from tsis.console.widgets import FileField

if TYPE_CHECKING:
    from pathlib import Path

    import pytest


async def _save(file: Path) -> None:
    file.write_bytes(b"no bundle")


def test_the_copy_goes_also_when_the_import_is_ended_before_it_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (copies := tmp_path / "copies").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(copies))
    monkeypatch.setattr(FileField, "reset", lambda _: None)  # which asks a browser, as the next does
    monkeypatch.setattr(FileField, "name_parts", lambda *_: None)
    with lit_instrument(tmp_path) as instrument:
        owned = [FixedGauge() for _ in range(AT_ONCE)]

        async def uploaded(viewer: RecordingViewer) -> None:
            import_button(instrument, viewer, ui.element("div"))
            (field,) = (item for item in viewer._client.elements.values() if isinstance(item, FileField))
            taken: Any = field._upload_handlers[0]
            await taken(SimpleNamespace(file=SimpleNamespace(save=_save)))
            assert len(list(copies.iterdir())) == 1
            job = instrument.jobs.get(instrument.state().jobs[-1].identity)
            job.end()
            for item in owned:
                item.over.set()
            assert job.wait(HANGS_S)
            assert job.state().status == "ended"

        for item in owned:
            instrument.jobs.begin("long", item)
        on_a_page(instrument, uploaded)
    assert list(copies.iterdir()) == []

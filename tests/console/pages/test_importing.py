"""What is uploaded and what becomes of its copy."""

from __future__ import annotations

import tempfile
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from nicegui import ui
from tests.console.services.instruments import Held, lit_bench
from tests.console.pages.open_page import Told, on_a_page
from tests.waiting import HANGS_S

from tsis.console.pages.components._upload import FileField
from tsis.console.pages.records._transfer import import_button
from tsis.console.services._jobs import AT_ONCE

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
    monkeypatch.setattr("tsis.console.pages.components._upload.name_parts", lambda *_: None)
    with lit_bench(tmp_path) as bench:
        held = [Held() for _ in range(AT_ONCE)]

        async def uploaded(viewer: Told) -> None:
            import_button(bench, viewer, ui.element("div"))
            (field,) = (each for each in viewer._client.elements.values() if isinstance(each, FileField))
            taken: Any = field._upload_handlers[0]
            await taken(SimpleNamespace(file=SimpleNamespace(save=_save)))
            assert len(list(copies.iterdir())) == 1
            job = bench.jobs.get(bench.state().jobs[-1].identity)
            job.end()
            for each in held:
                each.over.set()
            assert job.wait(HANGS_S)
            assert job.state().status == "ended"

        for each in held:
            bench.jobs.begin("long", each)
        on_a_page(bench, uploaded)
    assert list(copies.iterdir()) == []

"""The page My images: files are opened, refused by name, measured, and saved with their roles and forces."""

from __future__ import annotations

import shutil
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from tests.console.pages.open_page import RecordingViewer, on_a_page, texts
from tests.console.services.instruments import lit_instrument
from tests.console.services.test_captures import disc

from tsis.console.pages import images
from tsis.console.widgets import FileField

if TYPE_CHECKING:
    from pathlib import Path

    import pytest


def test_own_images_are_opened_measured_and_saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(FileField, "name_parts", lambda *_: None)  # which asks a browser
    (mine := tmp_path / "mine").mkdir()
    disc(mine, "press.png")
    (mine / "broken.png").write_bytes(b"no image")

    with lit_instrument(tmp_path) as instrument:

        async def done(viewer: RecordingViewer) -> None:
            page = images.OwnImagesPage(instrument, viewer)

            async def upload(name: str) -> None:
                async def save(to: Path) -> None:
                    shutil.copy(mine / name, to)

                event: Any = SimpleNamespace(file=SimpleNamespace(name=f"../{name}", save=save))
                await page.uploaded(event)

            for name in ("press.png", "broken.png"):
                await upload(name)
            assert any("broken.png" in text for text in texts(viewer))
            (row,) = page.rows
            page.scale_field.value = "0.1"
            row.force.value = "half"
            await page.measure()
            assert (row.force.error or "").startswith("Force of press.png must be a number"), viewer.complaints
            row.force.value = "0.5"
            await page.measure()
            assert "Contact in press.png" in texts(viewer)
            await page.save()
            assert "Saved 1 press of target 1." in texts(viewer)
            page.number_field.value = "0"
            await page.save()
            assert (page.number_field.error or "").startswith("Target must be 1–"), viewer.complaints
            page.number_field.value = "1"
            await page.save()
            assert "Saved 0 presses of target 1." in texts(viewer), "what is there is not saved twice"

        on_a_page(instrument, done)
        (press,) = instrument.store.record(instrument.store.target(1)).presses
        assert (press.force_n, press.mm_per_pixel) == (0.5, (0.1, 0.1))

"""The page My images: files are opened, refused by name, measured, and saved with their roles and forces."""

from __future__ import annotations

import re
import shutil
import threading
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from tests.console.pages.open_page import RecordingViewer, on_a_page, texts
from tests.console.services.instruments import lit_instrument
from tests.console.services.test_captures import disc
from tests.waiting import HANGS_S

from tsis.console.pages import images
from tsis.console.services.captures import measure_images
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
                await page.files.uploaded(event)

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
            assert {"Contact in each frame", "press.png"} <= set(texts(viewer))
            assert any(re.fullmatch(r"[\d.]+ mm²", text) for text in texts(viewer)), "the scale is known"
            assert not any(re.match(r"\d+ px", text) for text in texts(viewer))
            (shown,) = (item for item in row.element.descendants() if item.props.get("alt") == "Frame press.png")
            assert shown.props["src"].startswith("data:image/png;base64,")
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


def test_of_files_that_arrive_at_once_none_is_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each file is opened in a thread of its own while the page draws those before."""
    files = [disc(tmp_path, f"press-{number}.png") for number in range(8)]
    opened, all_read = images.OpenedFrames(), threading.Barrier(len(files))

    def picture(_: object) -> str:
        all_read.wait(HANGS_S)  # each thread has seen no other's frame
        return ""

    monkeypatch.setattr(images, "_picture", picture)
    shown = iter(opened.frames)
    with ThreadPoolExecutor(len(files)) as threads:
        assert list(threads.map(lambda file: opened.open([file]), files)) == [()] * len(files)
    assert list(shown) == []
    assert [path.name for path in opened.frames] == [file.name for file in files]
    opened.remove(files[0])
    assert len(opened.frames) == len(files) - 1


def test_frames_of_a_demo_are_ordered_and_known_by_their_names_and_stay_on_other_pages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FileField, "name_parts", lambda *_: None)
    (mine := tmp_path / "mine").mkdir()
    for name in ("untouched.png", "reference-1N.png", "target-1N.png", "reference-0.5N.png", "target-0.5N.png"):
        disc(mine, name)
    with lit_instrument(tmp_path) as instrument:

        async def done(viewer: RecordingViewer) -> None:
            page = images.OwnImagesPage(instrument, viewer)
            for file in sorted(mine.iterdir(), reverse=True):
                await page.open(file)
            assert [(row.name, row.role.value, row.force.value) for row in page.rows] == [
                ("target-0.5N.png", "target", "0.5"),
                ("target-1N.png", "target", "1"),
                ("reference-0.5N.png", "plain", "0.5"),
                ("reference-1N.png", "plain", "1"),
                ("untouched.png", "untouched", ""),
            ]
            page.rows[0].force.value = "0.7"
            again = images.OwnImagesPage(instrument, viewer)  # as after another page, and Back
            assert [row.force.value for row in again.rows] == ["0.7", "1", "0.5", "1", ""]
            await again.measure()
            table = images.findings_table(measure_images([row.frame() for row in again.rows], mm_per_pixel=None)[0])
            assert [row[0] for row in table.rows] == [row.name for row in again.rows[:4]], "a row a pressed frame"

        on_a_page(instrument, done)

"""Sequences begun at a page: they end by frames or by hand, and outlive the browser."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.operator import choose_target, hold, operating, requested, run, tab

from tsis.files.frame_names import target_folder

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, pytest.mark.slow, needs_browser]


def _begin(page: Page, length: str, unit: str) -> None:
    page.get_by_role("tab", name="Sequence").click()
    page.get_by_label("Length", exact=True).fill(length)
    page.get_by_role("button", name=unit, exact=True).click()
    page.get_by_role("button", name="Record").click()


def _reports(console: RunningConsole, number: int) -> list[tuple[Path, dict[str, Any]]]:
    folder = console.workspace / target_folder(number)
    return [(file.parent, json.loads(file.read_text())) for file in sorted(folder.glob("sequence*/recording.json"))]


def _frames(folder: Path) -> int:
    return sum(file.suffix in (".png", ".bmp", ".tif", ".tiff") for file in folder.iterdir())


def _target(page: Page, number: str) -> None:
    choose_target(page, number)
    expect(page.get_by_label("Target", exact=True)).to_have_value(number)


def test_so_many_frames(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        _target(page, "1")
        _begin(page, "20", "frames")
        page.get_by_text("20 frames in").first.wait_for()
    ((folder, report),) = _reports(console, 1)
    assert report["report"]["kept"] == _frames(folder) == 20


@pytest.mark.parametrize(
    ("length", "unit", "message"),
    [
        ("soon", "seconds", "Seconds must be a number, as 2 or 0.5 (you entered 'soon')."),
        ("0", "seconds", "Seconds must be 0.1–3600 s (you entered 0)."),
        ("2.5", "frames", "Frames must be a whole number (you entered 2.5)."),
        ("1e9", "frames", "Frames must be 1–200000 (you entered 1e+09)."),
    ],
)
def test_a_length_that_is_none(console: RunningConsole, browser: Browser, length: str, unit: str, message: str) -> None:
    with operating(browser, console) as page:
        run(page)
        _target(page, "2")
        _begin(page, length, unit)
        page.get_by_text(message).wait_for()
        expect(page.get_by_role("button", name="Record")).to_be_visible()
    assert _reports(console, 2) == []


def test_the_browser_closes_and_the_sequence_goes_on(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console) as page:
        hold(page)
        run(page)
        _target(page, "3")
        _begin(page, "60", "frames")
        page.get_by_role("progressbar", name="Progress of the sequence").wait_for()
    with tab(browser, console) as page:
        hold(page)
        page.get_by_role("tab", name="Sequence").click()
        page.get_by_text("60 frames in").first.wait_for()  # the new page tells what became of it
        assert requested(console, "/state")["camera"]["running"] is True
        page.get_by_role("button", name="Release the camera").click()
    ((folder, report),) = _reports(console, 3)
    assert report["report"]["kept"] == _frames(folder) == 60
    assert report["report"]["ended_by"] == ""


def test_while_it_is_recorded_no_other_begins_and_it_can_be_ended(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        _target(page, "4")
        _begin(page, "600", "seconds")
        end = page.get_by_role("button", name="Stop recording", exact=True)
        end.wait_for()
        page.get_by_role("button", name="Stop", exact=True).click()
        page.get_by_text("a sequence is being recorded; the camera can be stopped when it is over").wait_for()
        page.get_by_role("navigation").get_by_role("link", name="Camera").click()
        page.get_by_role("button", name="Apply").click()
        page.get_by_text("a sequence is being recorded; another camera can be chosen when it is over").wait_for()
        page.get_by_role("navigation").get_by_role("link", name="Examine").click()
        page.get_by_role("tab", name="Sequence").click()
        page.get_by_text("Recording sequence of target 4").wait_for()
        picture(page, "examine-sequence")
        end.click()
        page.get_by_role("button", name="Record").wait_for()
        page.get_by_text("Sequence of target 4:").wait_for()
    ((folder, report),) = _reports(console, 4)
    assert report["report"]["kept"] == _frames(folder) > 0

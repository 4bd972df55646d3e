"""Two tabs before one camera: one acts, the other sees everything and is told why its controls are grey."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.operator import RELEASE, TAKE, choose_target, hold, run, tab

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, pytest.mark.slow, needs_browser]
CONTROLS = ("Stop", "Snapshot", "Previous target", "Next target", "on the target")
WATCH = "You are watching. Take the camera"


def _grey(page: Page, grey: bool) -> None:
    for name in CONTROLS:
        expect(page.get_by_role("button", name=name)).to_be_enabled(enabled=not grey)
    for label in ("Target", "Force"):
        expect(page.get_by_label(label, exact=True)).to_be_enabled(enabled=not grey)


def test_the_second_watches_takes_over_and_the_first_is_told(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console) as first, tab(browser, console) as second:
        hold(first)
        run(first)
        second.get_by_text("controls the camera; you are watching.").wait_for()
        second.get_by_text(WATCH).wait_for()
        _grey(second, True)
        _grey(first, False)
        choose_target(first, "5")
        expect(second.get_by_label("Target", exact=True)).to_have_value("5")
        second.keyboard.press("Space")
        second.get_by_text(re.compile("The camera is controlled by .*; watch, or take it over")).wait_for()
        picture(second, "examine-watching")
        first.get_by_role("button", name="Snapshot").click()
        second.get_by_role("cell", name="on the target").first.wait_for()  # kept there, listed here
        hold(second)
        first.get_by_text("took over the camera; you are watching now.").wait_for()
        _grey(first, True)
        _grey(second, False)
        second.get_by_role("button", name=RELEASE).click()


def test_a_page_loaded_anew_keeps_the_camera(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console) as first, tab(browser, console) as second:
        hold(first)
        run(first)
        first.reload()
        first.get_by_role("button", name=RELEASE).wait_for()
        _grey(first, False)
        second.get_by_role("button", name=TAKE).wait_for()
        _grey(second, True)
        first.get_by_role("button", name=RELEASE).click()

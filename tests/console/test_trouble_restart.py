"""The console is started anew under an open page: the page comes back by itself, and what was kept is there."""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.operator import INSTRUMENT, hold, run
from tests.console.running import running_console

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser

pytestmark = [pytest.mark.system, pytest.mark.slow, needs_browser]


def test_the_page_comes_back_by_itself(tmp_path: Path, browser: Browser) -> None:
    context = browser.new_context(viewport={"width": INSTRUMENT[0], "height": INSTRUMENT[1]})
    page = context.new_page()
    with running_console(tmp_path) as console:
        page.goto(console.entrance)
        hold(page)
        run(page)
        page.get_by_role("button", name="Snapshot").click()
        page.get_by_text("1 press", exact=True).wait_for()
        port = urlsplit(console.address).port
    page.get_by_text("The connection to the console is lost.").wait_for()
    picture(page, "trouble-console-gone")
    assert page.evaluate("[...document.querySelectorAll('.bar, .content')].every(part => part.inert)")
    with running_console(tmp_path, "--port", str(port)) as again:
        page.get_by_role("button", name="Release the camera").wait_for()  # no key asked for: the old one opens
        page.get_by_text("1 press", exact=True).wait_for()
        expect(page.get_by_text("The connection to the console is lost.")).not_to_be_visible()
        assert not page.evaluate("[...document.querySelectorAll('.bar, .content')].some(part => part.inert)")
        run(page)
        page.get_by_role("button", name="Snapshot").click()
        page.get_by_text("2 presses").wait_for()
        assert again.address == console.address
        context.close()

"""The browser is opened without the key on its command line, and the page that it opens leads into the console."""

from __future__ import annotations

import os
import queue
import stat
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit
from urllib.request import url2pathname

import pytest
from tests.console.browser import needs_browser
from tests.waiting import HANGS_S

from tsis.console.app import opened_in_browser

if TYPE_CHECKING:
    from playwright.sync_api import Browser
    from tests.console.running import RunningConsole

TOKEN = "t" * 43
ADDRESS = f"http://127.0.0.1:8642/?token={TOKEN}"


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> queue.Queue[str]:
    """What a browser was told to open."""
    reported: queue.Queue[str] = queue.Queue()
    monkeypatch.setattr(webbrowser, "open", reported.put)
    return reported


def file_of(address: str) -> Path:
    return Path(url2pathname(urlsplit(address).path))


def test_the_key_is_in_a_private_file_alone_and_only_for_a_while(tmp_path: Path, opened: queue.Queue[str]) -> None:
    with opened_in_browser(ADDRESS, folder=tmp_path / "a user"):
        address = opened.get(timeout=HANGS_S)
        page = file_of(address)
        assert address.startswith("file:///")
        assert TOKEN not in address
        assert TOKEN in page.read_text()
        if os.name == "posix":
            assert stat.S_IMODE(page.stat().st_mode) == 0o600
    assert not list((tmp_path / "a user").iterdir())


def test_where_no_browser_can_be_opened_the_console_goes_on(
    tmp_path: Path, opened: queue.Queue[str], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_bytes(b"")
    with opened_in_browser(ADDRESS, folder=tmp_path / "file" / "folder"):
        assert opened.empty()
    assert "no browser is opened: " in caplog.text

    def failing(_: str) -> bool:
        opened.put("tried")
        raise webbrowser.Error("could not locate runnable browser")

    monkeypatch.setattr(webbrowser, "open", failing)
    with opened_in_browser(ADDRESS, folder=tmp_path):
        assert opened.get(timeout=HANGS_S) == "tried"


@needs_browser
@pytest.mark.system
def test_a_browser_gets_in_by_the_page(console: RunningConsole, browser: Browser, opened: queue.Queue[str]) -> None:
    context = browser.new_context()
    page = context.new_page()
    with opened_in_browser(console.entrance, folder=console.folder / "user"):
        page.goto(opened.get(timeout=HANGS_S), wait_until="commit")
        page.get_by_role("navigation", name="Groups of pages").wait_for()
        page.wait_for_url(f"{console.address}/")
    context.close()

"""A page with nothing but the live elements, in a real browser."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from tests.console.live.elements_page import LIVE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a page with nothing but the elements."""
    command = [sys.executable, "-m", "tests.console.live.elements_page", str(tmp_path_factory.mktemp("elements"))]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
    finally:
        process.terminate()
        process.communicate()


@pytest.fixture(scope="module")
def page(address: str, browser: Browser) -> Iterator[Page]:
    """That page before the camera is started."""
    with browser.new_context(viewport={"width": 1280, "height": 800}) as context:
        opened = context.new_page()
        complaints: list[str] = []
        opened.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        opened.on("pageerror", lambda error: complaints.append(error.stack or str(error)))
        opened.goto(address)
        opened.locator("figure.surface").wait_for()
        yield opened
        assert not complaints


@pytest.fixture
def still(page: Page) -> Page:
    """The page while no frames come."""
    stop = page.get_by_role("button", name="Stop", exact=True)
    stop.click()
    page.get_by_text("the camera is stopped").wait_for()
    return page


@pytest.fixture
def running(page: Page) -> Page:
    """The page while frames come."""
    page.get_by_role("button", name="Start", exact=True).click()
    page.get_by_text("the camera is stopped").wait_for(state="detached")
    page.wait_for_function(f"() => {LIVE}.stream.frame !== null && {LIVE}.stream.waiting === ''")
    return page

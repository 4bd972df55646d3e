"""What browsers make of the policy: every page works under it, and nothing foreign does."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from tests.console.browser import needs_browser

from tsis.console.pages import PAGES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, needs_browser]
NOTED = """
window.violations = [];
document.addEventListener("securitypolicyviolation",
    event => window.violations.push(`${event.violatedDirective} ${event.blockedURI}`));
"""
ADDRESSES = [re.sub(r"\{[^}]*\}", "1", address) for address in PAGES]


@pytest.fixture(scope="module")
def page(console: RunningConsole, browser: Browser) -> Iterator[Page]:
    """A page that was let in, and notes what its browser refuses."""
    context = browser.new_context()
    context.add_init_script(NOTED)
    page = context.new_page()
    page.goto(console.entrance)
    yield page
    context.close()


def violations(page: Page) -> list[str]:
    result: list[str] = page.evaluate("window.violations")
    return result


@pytest.mark.parametrize("address", [*ADDRESSES, "/nowhere"])
def test_every_page_works_under_the_policy(console: RunningConsole, page: Page, address: str) -> None:
    complaints: list[str] = []
    requested: set[str] = set()
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: requested.add(request.url))
    page.goto(console.address + address)
    page.get_by_role("navigation", name="Pages").wait_for()
    page.locator("main").locator("*").first.wait_for()
    assert violations(page) == []
    assert complaints == []
    assert [item for item in requested if not item.startswith((console.address, "data:", "blob:"))] == []


def test_scripts_of_others_do_not_run(console: RunningConsole, page: Page) -> None:
    page.goto(console.address + "/about")
    page.get_by_role("navigation", name="Pages").wait_for()
    page.evaluate(
        """() => {
        const inline = document.createElement("script");
        inline.textContent = "window.ran = 1";
        document.body.append(inline);
        const handler = document.createElement("div");
        handler.innerHTML = `<img src="/none" onerror="window.ran = 2">`;
        document.body.append(handler);
        const far = document.createElement("script");
        far.src = "http://localhost:9/far.js";
        document.body.append(far);
        const frame = document.createElement("iframe");
        frame.src = "http://localhost:9/";
        document.body.append(frame);
        new Image().src = "http://localhost:9/picture.png";
        fetch("http://localhost:9/").catch(() => 0);
        }"""
    )
    page.wait_for_function("window.violations.length >= 6")
    directives = {item.split()[0] for item in violations(page)}
    assert directives == {"script-src-elem", "script-src-attr", "frame-src", "img-src", "connect-src"}
    assert page.evaluate("window.ran") is None


def test_no_page_can_be_framed(console: RunningConsole, browser: Browser) -> None:
    context = browser.new_context()
    page = context.new_page()
    page.goto(console.entrance)
    page.get_by_role("navigation", name="Pages").wait_for()
    outside = context.new_page()
    reported: list[str] = []
    outside.on("console", lambda message: reported.append(message.text))
    with outside.expect_event("console"):
        outside.set_content(f'<iframe src="{console.address}/about"></iframe>')
    assert any("frame" in item.lower() for item in reported)
    context.close()

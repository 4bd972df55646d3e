"""A first start in a browser: what this is, and the steps of the work until the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.accessible import faults
from tests.console.browser import needs_browser, picture
from tests.console.operator import operating

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, needs_browser]


def filled(page: Page) -> list[str]:
    """Names of the filled buttons and links, apart from what a group of choices has chosen."""
    found: list[str] = page.evaluate(
        """() => [...document.querySelectorAll("main .q-btn--unelevated, main .filled")]
          .filter((each) => each.checkVisibility() && !each.closest(".q-btn-group"))
          .map((each) => each.innerText.split("\\n").at(-1).trim())"""
    )
    return found


def wait_for_main(page: Page, name: str) -> None:
    """Wait until one button is filled, with this name."""
    page.locator("main .q-btn--unelevated, main .filled").get_by_text(name, exact=True).wait_for()
    assert filled(page) == [name]


def test_the_filled_button_leads_from_the_first_start_to_the_report(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console, color_scheme="light") as page:
        page.get_by_text("What this is").wait_for()
        wait_for_main(page, "Try the virtual probe")
        expect(page.get_by_role("button", name="Connect a camera")).to_be_visible()
        expect(page.get_by_role("button", name="Open my images")).to_be_visible()
        picture(page, "first-start")
        assert faults(page) == []
        clicks = ("Try the virtual probe", "Take the presses", "Estimate", "Report")
        for name in clicks[:-1]:
            wait_for_main(page, name)
            page.locator("main").get_by_role("button", name=name, exact=True).click()
        wait_for_main(page, clicks[-1])
        picture(page, "first-report-next")
        report = page.get_by_role("button", name=clicks[-1], exact=True)
        with page.expect_download() as download:
            with page.expect_request("**/files/report/1.pdf"):
                report.click()
            report.locator(".q-spinner").wait_for()  # while it is made
        assert download.value.suggested_filename == "target-1.pdf"
        page.get_by_role("link", name="Open the target").click()
        page.wait_for_url("**/records/1")
        page.get_by_role("link", name="Measure", exact=True).click()
        page.get_by_role("region", name="Order of work").wait_for()

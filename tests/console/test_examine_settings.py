"""Settings of the camera on the page Examine: typed, slid, set back, and changed elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import httpx
import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.operator import API, operating, requested, run, tab
from tests.waiting import HANGS_S

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, pytest.mark.slow, needs_browser]


@pytest.fixture
def page(console: RunningConsole, browser: Browser) -> Iterator[Page]:
    """Examine with its settings, as the camera came."""
    with operating(browser, console) as opened:
        run(opened)
        opened.get_by_role("tab", name="Settings").click()
        opened.get_by_role("button", name="Default").click()
        expect(opened.get_by_label("Exposure").first).to_have_value("20")
        yield opened


def _settings(console: RunningConsole) -> dict[str, float]:
    return {item["name"]: item["value"] for item in requested(console, "/state")["camera"]["settings"]}


def _type(page: Page, label: str, text: str) -> None:
    field = page.get_by_role("textbox", name=label)
    field.fill(text)
    field.press("Enter")


def test_a_number_that_is_typed_reaches_the_camera(console: RunningConsole, page: Page) -> None:
    _type(page, "Exposure", "12.5")
    slider = page.get_by_role("slider", name="Exposure")
    expect(slider).to_have_attribute("aria-valuenow", "12.5")
    assert _settings(console)["exposure_ms"] == 12.5
    picture(page, "examine-settings")


def test_a_slider_reaches_the_camera(console: RunningConsole, page: Page) -> None:
    page.get_by_role("slider", name="Gain").locator("[tabindex='0']").press("ArrowRight")
    expect(page.get_by_role("textbox", name="Gain")).not_to_have_value("0")
    assert _settings(console)["gain"] == pytest.approx(24 / 200)


@pytest.mark.parametrize(
    ("typed", "message"),
    [
        ("0", "Exposure must be 0.01–33.3333 ms (you entered 0)."),
        ("dark", "(you entered 'dark')"),
        ("", "nothing was entered"),
    ],
)
def test_what_is_no_setting_is_said_and_nothing_changes(
    console: RunningConsole, page: Page, typed: str, message: str
) -> None:
    _type(page, "Exposure", typed)
    page.get_by_text(message).first.wait_for()
    expect(page.get_by_role("textbox", name="Exposure")).to_have_value(typed)  # to be corrected
    page.get_by_role("textbox", name="Exposure").press("Escape")
    expect(page.get_by_role("textbox", name="Exposure")).to_have_value("20")
    assert _settings(console)["exposure_ms"] == 20.0


def test_minimal_and_back(console: RunningConsole, page: Page) -> None:
    before = _settings(console)
    page.get_by_role("button", name="Minimal").click()
    expect(page.get_by_role("textbox", name="Brightness")).to_have_value("0")
    assert _settings(console) == {"exposure_ms": 0.01, "gain": 0.0, "brightness": 0.0}
    page.get_by_role("button", name="Default").click()
    expect(page.get_by_role("textbox", name="Exposure")).to_have_value("20")
    assert _settings(console) == before


def test_a_change_does_not_take_away_what_is_being_typed(console: RunningConsole, page: Page) -> None:
    exposure = page.get_by_role("textbox", name="Exposure")
    exposure.focus()
    exposure.press("Control+a")
    exposure.press_sequentially("15")
    page.get_by_role("button", name="Minimal").evaluate("(button) => button.click()")  # the field keeps the focus
    expect(page.get_by_role("textbox", name="Brightness")).to_have_value("0")
    expect(exposure).to_have_value("15")
    exposure.press("Enter")
    expect(page.get_by_role("slider", name="Exposure")).to_have_attribute("aria-valuenow", "15")
    assert _settings(console)["exposure_ms"] == 15.0
    exposure.press("Control+a")
    exposure.press_sequentially("30")
    exposure.press("Escape")
    expect(exposure).to_have_value("15")


def test_what_a_script_changes_appears(console: RunningConsole, browser: Browser) -> None:
    api, key = console.address + API, console.key
    with tab(browser, console) as page:
        page.get_by_role("tab", name="Settings").click()
        taken = httpx.post(
            api + "/control", headers=key, json={"name": "a script", "over": True}, timeout=HANGS_S
        ).raise_for_status()
        key = {**key, "TSIS-Control": taken.json()["identity"]}
        page.get_by_text("a script controls the camera; you are watching.").wait_for()
        httpx.post(api + "/camera/start", headers=key, timeout=HANGS_S).raise_for_status()
        httpx.patch(api + "/camera/settings", headers=key, json={"values": {"gain": 6.0}}).raise_for_status()
        expect(page.get_by_role("textbox", name="Gain")).to_have_value("6")
        expect(page.get_by_role("textbox", name="Gain")).to_be_disabled()
        httpx.delete(api + "/control", headers=key, timeout=HANGS_S)

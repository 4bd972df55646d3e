"""A real camera behind the page, which goes and comes back, with a force gauge beside it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.operator import hold, requested, run, tab
from tests.console.running import running_console
from tests.system.aravis_peer import LOOPBACK, fake_camera, loopback_camera_port
from tests.system.gauge_peer import GaugeInTerminal

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from playwright.sync_api import Browser

pytestmark = [pytest.mark.system, pytest.mark.slow, needs_browser]
SERIAL = "TSISPAGE"


@pytest.fixture(autouse=True)
def port() -> Iterator[None]:
    with loopback_camera_port():
        yield


def test_a_camera_goes_and_comes_back_and_nothing_is_lost(tmp_path: Path, browser: Browser) -> None:
    with running_console(tmp_path, "--camera", f"aravis:{LOOPBACK}") as console, tab(browser, console) as page:
        hold(page)
        with fake_camera(SERIAL):
            run(page)
            page.get_by_label("Force", exact=True).fill("0.7")
            page.get_by_label("Force", exact=True).press("Enter")
            page.get_by_text("(typed)").wait_for()
            page.keyboard.press("Escape")
            page.get_by_role("button", name="Snapshot").click()
            page.get_by_text("Saved for target 1: on the target, 0.7 N").wait_for()
        banner = page.get_by_role("alert").filter(has_text="The camera is away")
        banner.wait_for()
        page.get_by_text("the camera is away; this is its last frame").first.wait_for()
        page.get_by_role("tab", name="Settings").click()
        page.get_by_text("The camera is away.", exact=True).wait_for()
        page.get_by_role("button", name="Snapshot").click()
        page.get_by_text(re.compile("is away; nothing was saved")).wait_for()
        picture(page, "trouble-camera-away")
        with fake_camera(SERIAL):
            banner.wait_for(state="detached")
            page.get_by_role("slider", name="Gain").wait_for()
            page.get_by_role("button", name="Snapshot").click()
            page.get_by_role("tab", name="Estimate").click()
            page.get_by_text("2 presses").wait_for()
            assert requested(console, "/targets/1")["presses"] == 2
            assert requested(console, "/state")["camera"]["interruptions"] == 1


def test_a_camera_is_found_chosen_and_read_beside_a_gauge(tmp_path: Path, browser: Browser) -> None:
    gauge = GaugeInTerminal(lambda _: b"+0.420 N\r\n")
    try:
        with (
            fake_camera(SERIAL),
            running_console(tmp_path) as console,
            tab(browser, console, "/camera") as page,
        ):
            hold(page)
            expect(page.get_by_text("Force gauge")).not_to_be_visible()
            page.get_by_role("button", name="Search").click()
            page.get_by_role("cell", name="Aravis Fake").wait_for()
            page.get_by_role("button", name=f"Use Aravis-Fake-{SERIAL}").click()
            page.get_by_text("runs at").wait_for()
            page.get_by_role("combobox", name="Mode").wait_for()
            page.get_by_label("Serial port").fill(str(tmp_path / "no-port"))
            page.get_by_label("Serial port").press("Enter")
            page.get_by_role("button", name="Connect").click()
            page.get_by_text(re.compile("No serial port is called")).wait_for()
            page.get_by_label("Serial port").fill(gauge.port)
            page.get_by_label("Serial port").press("Enter")
            page.get_by_role("button", name="Connect").click()
            page.get_by_text(f"Forces are read from the gauge at {gauge.port}.").wait_for()
            picture(page, "camera-real")
            page.get_by_role("navigation").get_by_role("link", name="Examine").click()
            page.get_by_text("0.42 N").wait_for()
            page.get_by_text("from the gauge").wait_for()
            page.get_by_role("button", name="Snapshot").click()
            page.get_by_text("Saved for target 1: on the target, 0.42 N").wait_for()
            gauge.unplug()
            page.get_by_role("alert").filter(has_text="The gauge is away").wait_for()
            page.get_by_role("navigation").get_by_role("link", name="Camera").click()
            page.get_by_role("button", name="Use no gauge").click()
            page.get_by_text("Forces are typed, or not known.").wait_for()
            page.get_by_role("alert").filter(has_text="The gauge is away").wait_for(state="detached")
    finally:
        gauge.unplug()

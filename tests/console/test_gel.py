"""The page Gel sensor: a virtual sensor from its choice to depth and force, in a browser."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.accessible import faults, too_wide
from tests.console.browser import needs_browser, picture
from tests.console.contrast import texts
from tests.console.operator import operating, requested
from tests.console.services.test_gel import calibration, presses

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, needs_browser]


def test_a_press_is_outlined_and_read_in_millimetres_and_newtons(
    console: RunningConsole, browser: Browser, tmp_path: Path
) -> None:
    file = tmp_path / "depth.json"
    file.write_bytes(calibration())
    with operating(browser, console, "/gel") as page:
        page.get_by_text("Choose the sensor, or its file.").wait_for()
        page.get_by_role("button", name="Use a virtual sensor").click()
        page.get_by_text("Remove everything from the sensor, and take its untouched frame.").wait_for()
        page.get_by_text("frames/s shown").wait_for()
        page.get_by_role("button", name="Take the untouched frame now").click()
        page.get_by_text("no contact: nothing changed against the reference").wait_for()
        page.locator("input[type=file]").last.set_input_files(file)
        page.get_by_label("Virtual press").click()
        page.get_by_role("option", name="press 2").click()
        page.get_by_text("The contact is good.").wait_for()
        page.get_by_text("Deepest point").wait_for()
        page.get_by_text("N (").wait_for()
        page.locator("svg .live-line").first.wait_for(state="attached")
        picture(page, "gel-sensor-press")
        assert faults(page) == []
        assert too_wide(page) == []
        assert [item for item in texts(page) if item.contrast < item.least] == []
        shown = requested(console, "/sight")["sight"]["gel"]
        truth = presses()[1]
        assert shown["good"]
        assert shown["centre_px"] == pytest.approx(truth.centre_px, abs=2.0)
        assert shown["force_interval_n"][0] < shown["force_n"] < shown["force_interval_n"][1]
        page.get_by_label("Virtual press").click()
        page.get_by_role("option", name="untouched").click()
        page.get_by_text("no contact: nothing changed against the reference").wait_for()
        expect(page.get_by_text("Deepest point")).to_have_count(0)

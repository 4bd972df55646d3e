"""A day's work in a real browser: calibrate, examine five targets, a restart in the middle, and what follows."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import pytest
from tests.console.browser import needs_browser, picture
from tests.console.operator import INSTRUMENT, choose_target, follow, go_to, hold, requested, run
from tests.console.running import running_console
from tests.console.services.test_captures import disc

from tsis.records.store import open_store
from tsis.study.folder import open_study, verify_study

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, needs_browser]
ROLES = ("on the target", "reference (no inclusion)")


def test_a_day_s_work(tmp_path: Path, browser: Browser) -> None:
    own = disc(tmp_path, "own.png")
    context = browser.new_context(viewport={"width": INSTRUMENT[0], "height": INSTRUMENT[1]})
    page = context.new_page()
    failures: list[str] = []
    page.on("pageerror", lambda error: failures.append(str(error)))
    with running_console(tmp_path) as morning:
        page.goto(morning.entrance)
        hold(page)
        calibrated(page)
        active = requested(morning, "/state")["calibration_identity"]
        go_to(page, "Examine")
        run(page)
        for target in (1, 2, 3):
            examined(page, target)
    page.get_by_text("The connection to the console is lost.").wait_for()
    with running_console(tmp_path, "--port", str(urlsplit(morning.address).port)) as afternoon:
        page.get_by_role("button", name="Release the camera").wait_for()  # the page is back by itself
        page.get_by_text("2 presses").wait_for()
        page.get_by_text("Calibration 'morning' of the last session is active again.").wait_for()
        run(page)
        assert requested(afternoon, "/state")["calibration_identity"] == active
        for target in (4, 5):
            examined(page, target)
        compared(page)
        deleted(page, 5)
        imported(page, own)
        studied(page, afternoon)
        reported(page, afternoon)
        picture(page, "day-end")
    context.close()
    assert failures == []
    with open_store(afternoon.store) as store:
        assert [item.target.number for item in store.targets()] == [1, 2, 3, 4, 6]
        for target in (1, 2, 3, 4):
            record = store.record(store.target(target))
            assert [press.role for press in record.presses] == ["target", "plain"]
            assert {press.calibration for press in record.presses} == {active}
            assert len(record.estimates) == 1
        (image,) = store.presses(store.target(6))
        assert image.mm_per_pixel == (0.1, 0.1)


def calibrated(page: Page) -> None:
    """The virtual rig takes every step; the calibration is computed and activated."""
    go_to(page, "Calibrate")
    page.get_by_label("Name", exact=True).fill("morning")
    page.get_by_role("button", name="Begin", exact=True).click()
    page.get_by_role("button", name="Do all open steps").click()
    page.get_by_text("Every step is done or skipped.").wait_for()
    page.get_by_role("button", name="Make the calibration").click()
    page.get_by_role("button", name="Activate").click()
    page.get_by_text("It is active.").wait_for()


def examined(page: Page, target: int) -> None:
    """A target and its reference are pressed, and the estimate is made."""
    choose_target(page, str(target))
    page.get_by_text("No presses of this target yet.").wait_for()
    for role in ROLES:
        page.get_by_role("button", name=role).click()
        page.get_by_role("button", name="Snapshot").click()
        page.get_by_text(f"Saved for target {target}: {role}").wait_for()
    page.get_by_role("button", name="Estimate", exact=True).click()
    page.get_by_text("Diameter d", exact=True).wait_for()


def compared(page: Page) -> None:
    follow(page, "Open the target", "**/records/5")
    page.get_by_role("heading", name="Target 5: hardness-100").wait_for()
    page.get_by_role("button", name="Compare with a target", exact=True).click()
    page.get_by_label("Number of the other target").fill("4")
    page.get_by_role("dialog").get_by_role("button", name="Compare").click()
    page.wait_for_url("**/records/compare/5-4")
    for target in (4, 5):
        page.get_by_role("region", name=f"Target {target}").get_by_text("Current estimates").wait_for()


def deleted(page: Page, target: int) -> None:
    page.get_by_role("region", name=f"Target {target}").get_by_role("link", name="Open").click()
    page.get_by_role("button", name="Delete").click()
    page.get_by_role("dialog").get_by_role("button", name="Delete").click()
    page.get_by_text(f"Target {target} is deleted.").wait_for()
    go_to(page, "Targets")
    page.get_by_text("4 targets").wait_for()


def imported(page: Page, image: Path) -> None:
    """An image file of one's own is measured and saved as a new target."""
    go_to(page, "My images")
    page.locator("input[type=file]").set_input_files(image)
    page.get_by_label("Scale, or x,y").fill("0.1")
    page.get_by_role("button", name="Measure contact").click()
    page.get_by_text("Contact in each frame").wait_for()
    page.get_by_role("button", name="Save as target").click()
    page.get_by_text("Saved 1 press of target 6.").wait_for()


def studied(page: Page, console: RunningConsole) -> None:
    """A blinded study is made, read by the virtual probe, and unblinded."""
    go_to(page, "Studies")
    given = {"Name": "day", "Made by": "Ada", "With an inclusion": "2", "Blanks": "2", "Forces": "1", "Seed": "3"}
    for label, text in given.items():
        page.get_by_label(label, exact=True).fill(text)
    page.get_by_role("button", name="Create the study").click()
    page.get_by_text("1-4 of 4").wait_for()  # the sheet's
    page.get_by_label("Operator").fill("Ada")
    page.get_by_role("button", name="Run on the virtual probe").click()
    page.get_by_text("Ada: 4 of 4 read").wait_for()
    page.get_by_role("button", name="Unblind and analyse").click()
    page.get_by_role("dialog").get_by_role("button", name="Unblind and analyse").click()
    page.get_by_role("link", name="Report", exact=True).wait_for()
    folder = console.workspace / "studies" / "day"
    assert len(open_study(folder).readings) == 4
    assert verify_study(folder).sound


def reported(page: Page, console: RunningConsole) -> None:
    page.goto(f"{console.address}/records/1")
    page.get_by_text(re.compile("^Current estimates")).wait_for()
    with page.expect_download() as download:
        page.get_by_role("button", name="Report", exact=True).click()
    assert Path(download.value.path()).read_bytes().startswith(b"%PDF-")

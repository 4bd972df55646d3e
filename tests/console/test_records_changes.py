"""What people change of records in a browser, and what is computed again from it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.accessible import faults
from tests.console.browser import needs_browser, picture
from tests.console.filled_store import ESTIMATED, HARD, fill, still
from tests.console.operator import tab
from tests.console.running import RunningConsole, running_console

from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page

    from tsis.records.values import StoredEstimate, StoredPress, Target

pytestmark = [pytest.mark.system, needs_browser]


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    """A console on a store that is filled."""
    folder = tmp_path_factory.mktemp("console")
    fill(folder / "records")
    with running_console(folder) as running:
        yield running


def target_of(console: RunningConsole, number: int) -> Target:
    with open_store(console.store) as store:
        return store.target(number)


def presses_of(console: RunningConsole, number: int) -> tuple[StoredPress, ...]:
    with open_store(console.store) as store:
        return store.presses(store.target(number))


def estimates_of(console: RunningConsole, number: int) -> tuple[StoredEstimate, ...]:
    with open_store(console.store) as store:
        return store.estimates(store.target(number))


def open_editing(page: Page) -> None:
    page.get_by_role("button", name="Edit").click()
    page.get_by_role("dialog").get_by_label("Name").wait_for()
    still(page)


def save(page: Page) -> None:
    page.get_by_role("dialog").get_by_role("button", name="Save", exact=True).click()


def test_name_note_and_truth_are_changed(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, f"/records/{ESTIMATED}") as page:
        open_editing(page)
        dialog = page.get_by_role("dialog")
        picture(page, "records-edit")
        assert faults(page) == []
        expect(dialog.get_by_label("Name")).to_have_value("size-10")
        dialog.get_by_label("Name").fill("<b>größe</b> 10")
        dialog.get_by_label(re.compile("^True values")).fill("diameter_mm=10.25\n\ndepth_mm = 5")
        save(page)
        page.get_by_text("Target 3: <b>größe</b> 10").wait_for()
        page.get_by_text("10.25 mm").first.wait_for()
    result = target_of(console, ESTIMATED)
    assert (result.name, result.note, dict(result.truth)) == (
        "<b>größe</b> 10",
        "bench",
        {"diameter_mm": 10.25, "depth_mm": 5.0},
    )


def test_back_leaves_a_dialog_with_its_text_open(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, "/about") as page:
        page.get_by_role("link", name="Records", exact=True).click()
        page.locator(f'a[href^="/records/{ESTIMATED}"]').first.click()  # another test may have renamed it
        page.wait_for_url(f"**/records/{ESTIMATED}*")
        open_editing(page)
        page.get_by_role("dialog").get_by_label("Name").fill("half typed")
        here = page.url
        page.evaluate("history.back()")
        still(page)
        assert page.url == here
        expect(page.get_by_role("dialog").get_by_label("Name")).to_have_value("half typed")
        page.get_by_role("dialog").get_by_role("button", name="Cancel").click()
        page.get_by_role("dialog").wait_for(state="hidden")
        page.get_by_role("button", name="Help").click()
        page.get_by_role("dialog").wait_for()
        page.evaluate("history.back()")  # which has nothing to lose
        page.get_by_role("dialog").wait_for(state="hidden")
        assert page.url == here
        page.evaluate("history.back()")
        page.wait_for_url(re.compile("/records$"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("field", "text", "message"),
    [
        ("True values, one on a line: diameter_mm=10", "diameter", "must be a name and a number as diameter_mm=10"),
        ("True values, one on a line: diameter_mm=10", "diameter_mm=nan", "truth"),
        ("True values, one on a line: diameter_mm=10", "=5", "a name in truth must be"),
        ("Name", "n" * 201, "name must be printable text of at most 200 characters"),
        ("Note", "bell \a", "note must be printable text"),
    ],
)
def test_what_is_not_accepted_is_told_and_stays_to_be_mended(
    console: RunningConsole, browser: Browser, field: str, text: str, message: str
) -> None:
    before = target_of(console, HARD)
    with tab(browser, console, f"/records/{HARD}") as page:
        open_editing(page)
        page.get_by_role("dialog").get_by_label(field).fill(text)
        save(page)
        page.get_by_role("alert").get_by_text(message).wait_for()
        expect(page.get_by_role("dialog").get_by_label(field)).to_have_value(text)
    assert target_of(console, HARD) == before


def test_of_two_tabs_the_slower_is_told_and_chooses(console: RunningConsole, browser: Browser) -> None:
    with (
        tab(browser, console, f"/records/{HARD}") as slow,
        tab(browser, console, f"/records/{HARD}") as fast,
    ):
        for page in (slow, fast):
            open_editing(page)
        fast.get_by_role("dialog").get_by_label("Note").fill("of the faster")
        save(fast)
        fast.get_by_role("dialog").wait_for(state="hidden")
        slow.get_by_role("dialog").get_by_label("Name").fill("of the slower")
        save(slow)
        slow.get_by_text("somebody else has changed it").wait_for()
        slow.get_by_text("Note: was empty, is “of the faster” now.").wait_for()
        picture(slow, "records-conflict")
        slow.get_by_role("button", name="Discard my changes").click()
        slow.get_by_text("somebody else has changed it").wait_for(state="hidden")
        expect(slow.get_by_role("dialog").get_by_label("Note")).to_have_value("of the faster")
        expect(slow.get_by_role("dialog").get_by_label("Name")).not_to_have_value("of the slower")
        slow.get_by_role("dialog").get_by_label("Name").fill("of the slower")
        save(slow)
        fast.get_by_text(f"Target {HARD}: of the slower").wait_for()  # by itself
    result = target_of(console, HARD)
    assert (result.name, result.note) == ("of the slower", "of the faster")


@pytest.mark.slow
def test_one_may_save_over_what_another_has_changed(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, f"/records/{HARD}") as page:
        open_editing(page)
        with open_store(console.store) as store:
            store.edit_target(store.target(HARD), name="theirs")
        page.get_by_role("dialog").get_by_label("Name").fill("mine")
        save(page)
        page.get_by_role("button", name="Overwrite with mine").click()
        page.get_by_text(f"Target {HARD}: mine").wait_for()
    assert target_of(console, HARD).name == "mine"


@pytest.mark.slow
def test_a_press_is_seen_at_large_and_changed(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, f"/records/{ESTIMATED}") as page:
        page.get_by_role("button", name=re.compile("^Open the press on the target, 1 N")).click()
        dialog = page.get_by_role("dialog")
        dialog.get_by_role("img", name=re.compile("^Frame on the target, 1 N")).wait_for(state="attached")
        still(page)
        picture(page, "records-press")
        assert faults(page) == []
        force = dialog.get_by_label(re.compile("^Force in newtons"))
        force.fill("one")
        save(page)
        page.get_by_text("Force must be a number of newtons, or nothing (you entered 'one')").wait_for()
        force.fill("1.25")
        dialog.get_by_label("Note").fill("gauge read again")
        dialog.get_by_role("combobox", name="What was pressed").click()
        page.get_by_role("option", name="not touched").click()
        save(page)
        page.get_by_role("button", name=re.compile("^Open the press not touched, 1.25 N")).wait_for()
    result = presses_of(console, ESTIMATED)[1]
    assert (result.role, result.force_n, result.note, result.flags) == (
        "untouched",
        1.25,
        "gauge read again",
        ("moving",),
    )


def test_an_estimate_is_computed_again(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, f"/records/{HARD}") as page:
        page.get_by_role("button", name="Repeat the estimates").click()
        page.get_by_role("dialog").get_by_role("button", name="Repeat").click()
        page.get_by_text(re.compile("^Hardness: ")).wait_for()
        assert len(estimates_of(console, HARD)) == 1, "it is the same"
        with open_store(console.store) as store:
            press = store.presses(store.target(HARD))[0]
            store.edit_press(press, force_n=0.71)
        page.get_by_text("0.71 N").first.wait_for()
        page.get_by_role("button", name="Repeat the estimates").click()
        page.get_by_role("switch", name=re.compile("^dry run")).click()
        page.get_by_role("dialog").get_by_role("button", name="Repeat").click()
        page.get_by_text("Nothing was stored").wait_for()
        expect(page.get_by_role("row", name=re.compile("^young_kpa"))).to_have_count(1)
        picture(page, "records-recomputed")
        assert len(estimates_of(console, HARD)) == 1
        page.get_by_role("button", name="Repeat the estimates").click()
        page.get_by_role("dialog").get_by_role("button", name="Repeat").click()
        page.get_by_text(re.compile("^Stored as ")).wait_for()
    first, second = estimates_of(console, HARD)
    assert second.supersedes == first.id


def test_an_estimate_is_made_from_the_presses_that_were_chosen(console: RunningConsole, browser: Browser) -> None:
    before = len(estimates_of(console, HARD))
    presses = presses_of(console, HARD)
    with tab(browser, console, f"/records/{HARD}") as page:
        box = page.get_by_role("checkbox", name=re.compile("1.2 N"))
        box.click()
        page.get_by_role("button", name="Compare presses (1 chosen)").wait_for()
        clicked = box.element_handle()
        with open_store(console.store) as store:
            store.edit_target(store.target(HARD), note="written meanwhile")
        page.get_by_text("written meanwhile").wait_for()
        assert clicked.evaluate("node => node.isConnected"), "a box that is replaced loses the click that is on its way"
        page.get_by_role("button", name="Estimate", exact=True).click()
        dialog = page.get_by_role("dialog")
        dialog.get_by_role("combobox", name="What").click()
        page.get_by_role("option", name="hardness").click()
        still(page)
        picture(page, "records-estimate")
        dialog.get_by_role("button", name="Estimate").click()
        page.get_by_text("The estimate is stored and current.").wait_for()
    created = estimates_of(console, HARD)[before]
    assert created.presses == (presses[1].id,)
    with open_store(console.store) as store:
        assert verify_store(store).sound


@pytest.mark.slow
def test_an_estimate_that_cannot_be_made_says_why(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, f"/records/{ESTIMATED}") as page:
        page.get_by_role("checkbox", name=re.compile(r"reference \(no inclusion\), 0.7 N")).click()
        page.get_by_role("button", name="Compare presses (1 chosen)").wait_for()
        page.get_by_role("button", name="Estimate", exact=True).click()
        page.get_by_role("dialog").get_by_role("button", name="Estimate").click()
        page.get_by_role("alert").get_by_text("at least one press on the target").wait_for()

"""The pages of records in a real browser: found, looked at, compared, changed, taken away."""

from __future__ import annotations

import re
import zipfile
from typing import TYPE_CHECKING

import numpy as np
import pytest
from playwright.sync_api import expect
from tests.console.accessible import faults, too_wide
from tests.console.browser import needs_browser, picture
from tests.console.filled_store import ESTIMATED, HARD, MANY, PRESSES, fill, still
from tests.console.operator import TABLET, tab
from tests.console.running import RunningConsole, running_console
from tests.records.sample import WHEN, levels, sample_record

from tsis.model.image import TactileImage
from tsis.records.store import open_store
from tsis.records.target import read_bundle, write_bundle

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Page

pytestmark = [pytest.mark.system, needs_browser]
STALE = """() => getElement(document.querySelector(".targets")).$emit("update:pagination",
  { sortBy: "number", descending: false, page: 1, rowsPerPage: 50, rowsNumber: 0 })"""  # as a slow browser says


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    """A console on a store that is filled."""
    folder = tmp_path_factory.mktemp("console")
    fill(folder / "records")
    with running_console(folder) as running:
        yield running


def require_pleasant(page: Page) -> None:
    assert faults(page) == []
    assert not too_wide(page)


def names(page: Page) -> list[str]:
    return page.locator(".targets tbody tr td:nth-child(3)").all_inner_texts()


def all_shown(page: Page, count: int) -> None:
    """Wait until so many pictures of presses are there, each of them loaded."""
    page.wait_for_function(
        "count => { const all = [...document.querySelectorAll('.press img')];"
        " all.forEach(each => each.loading = 'eager');"
        " return all.length === count && all.every(each => each.complete && each.naturalWidth > 0) }",
        arg=count,
    )


def test_a_list_is_searched_sorted_and_opens_a_target(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, "/records") as page:
        page.get_by_text("3 targets (phantoms), 36 presses").wait_for()
        picture(page, "records-list")
        require_pleasant(page)
        assert names(page) == ["size-10", "many presses", "cl2000x"]
        for order in (".sorted", ".sort-desc"):  # one click after the other is answered
            page.get_by_role("columnheader", name="Presses").click()
            page.locator(f"th{order}", has_text="Presses").wait_for()
        page.locator(".targets tbody tr", has_text="many").and_(page.locator(":first-child")).wait_for()
        assert names(page) == ["many presses", "size-10", "cl2000x"]
        shown = page.locator(".target-picture")
        expect(shown).to_have_count(3)
        page.wait_for_function(
            "() => [...document.querySelectorAll('.target-picture')].every((each) => each.naturalWidth > 0)"
        )
        page.get_by_label("Search number, name, note or #tag").fill("i")  # of two names, and of a hidden note
        page.get_by_text("cl2000x").wait_for(state="hidden")
        page.get_by_role("button", name="Export the listed").click()
        page.get_by_text("Export 2 targets").wait_for()
        with page.expect_download() as loaded:
            page.get_by_role("dialog").get_by_role("button", name="Export").click()
        with zipfile.ZipFile(loaded.value.path()) as packed:
            inside = {name for name in packed.namelist() if name.endswith(".zip")}
        assert inside == {f"targets/target-{number}-csv.zip" for number in (ESTIMATED, MANY)}
        page.get_by_label(f"Choose target {MANY}").click()
        page.get_by_role("button", name="Export the 1 chosen").click()
        page.get_by_text(f"Export target {MANY}").wait_for()
        page.get_by_role("button", name="Cancel").click()
        page.get_by_label(f"Choose target {MANY}").click()
        page.get_by_role("button", name="Export the listed").wait_for()
        page.get_by_label("Search number, name, note or #tag").fill("CL2")
        page.get_by_text("size-10").wait_for(state="hidden")
        assert names(page) == ["cl2000x"]
        page.get_by_role("link", name="cl2000x").click()
        page.get_by_text(f"Target {HARD}: cl2000x").wait_for()
        page.wait_for_url(f"**/records/{HARD}")
        page.get_by_role("link", name="All targets").click()
        page.get_by_text("3 targets (phantoms)").wait_for()


def test_a_target_shows_its_presses_a_sheet_at_a_time(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, f"/records/{MANY}", size=TABLET, color_scheme="dark") as page:
        page.get_by_text(f"1 to 24 of {PRESSES}").wait_for()
        all_shown(page, 24)
        picture(page, "records-many-tablet-dark")
        require_pleasant(page)
        page.get_by_role("button", name="Later").click()
        page.get_by_text(f"25 to {PRESSES} of {PRESSES}").wait_for()
        all_shown(page, PRESSES - 24)
        assert page.locator(".press-role").all_inner_texts() == [
            "on the target",
            "reference (no inclusion)",
            "not touched",
            "on a known ball",
            "on the target",
            "reference (no inclusion)",
        ]
        expect(page.locator(".press", has_text="has not settled")).to_have_count(1)  # that of number 27
        expect(page.get_by_role("button", name="Later")).to_be_disabled()


def test_a_deep_link_shows_the_numbers_in_force(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, f"/records/{ESTIMATED}") as page:
        all_shown(page, 4)
        estimate = sample_record().estimates[0].estimate
        card = page.locator(".card", has_text="Diameter")
        assert f"{estimate.mean['diameter_mm']:.3g} mm" in card.inner_text()
        assert "not identified" in page.locator(".card", has_text="Modulus").inner_text()
        page.get_by_text("Diameter and depth are identified, the modulus is not.").wait_for()
        assert "2026-11-22 09:32:00" in page.get_by_role("table").first.inner_text()
        picture(page, "records-target")
        require_pleasant(page)


def test_two_presses_are_compared_in_one_scale(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, f"/records/{ESTIMATED}") as page:
        all_shown(page, 4)
        expect(page.get_by_role("button", name="Compare presses")).to_be_disabled()
        page.get_by_role("checkbox", name=re.compile("on the target, 1 N")).click()
        page.get_by_role("checkbox", name=re.compile(r"reference \(no inclusion\), 1 N")).click()
        page.get_by_role("button", name="Compare presses (2 chosen)").click()
        views = page.locator(".compared-frame:visible")
        expect(views).to_have_count(2)
        expect(views.locator("canvas")).to_have_count(2)
        change = levels(1, height=0.5).astype(float) - levels(3, height=0.3)
        page.get_by_text(f"root mean square {(change**2).mean() ** 0.5:.3g}").wait_for()
        expect(page.get_by_role("row", name=re.compile("^peak"))).to_have_count(1)
        views.first.scroll_into_view_if_needed()
        picture(page, "records-compared")
        require_pleasant(page)
        views.first.get_by_role("button", name="Zoom in").click()
        zooms = """() => [...document.querySelectorAll('.compared-frame figure.live')].filter(
            (each) => each.checkVisibility()).map((each) => getElement(each).zoom)"""
        page.wait_for_function(f"() => ({zooms})().every((zoom, _, all) => zoom > 1.3 && zoom === all[0])")
        page.get_by_role("button", name="Blink").click()
        expect(views).to_have_count(1)
        first, second = (page.locator(".compared-frame").nth(at) for at in (0, 1))
        for shown in (second, first):
            shown.wait_for(state="visible")
        page.get_by_role("button", name="Difference").click()
        expect(views).to_have_count(1)
        page.wait_for_function(f"() => ({zooms})().length === 1 && ({zooms})()[0] > 1.3")  # the same zoom
        signed = """() => [...document.querySelectorAll('.compared-frame figure.live')].some(
            (each) => each.checkVisibility() && getElement(each).shown?.zero < 0)"""
        page.wait_for_function(signed)
        levels_shown = views.evaluate(
            """(place) => {
              const { shown } = getElement(place.querySelector("figure.live"));
              return Array.from(shown.pixels, (level) => shown.zero + (level / 255) * shown.fullScale);
            }"""
        )
        assert np.abs(np.array(levels_shown).reshape(change.shape) - change).max() <= np.abs(change).max() / 255 * 1.01
        picture(page, "records-difference")
        page.get_by_role("switch", name="match brightness").click()
        page.get_by_text("brought to the brightness of the first").wait_for()
        page.get_by_role("button", name="Close the comparison").click()
        views.first.wait_for(state="hidden")


def test_report_and_paper(console: RunningConsole, browser: Browser, tmp_path: Path) -> None:
    with tab(browser, console, f"/records/{ESTIMATED}") as page:
        with page.context.expect_page() as opened:
            page.get_by_role("link", name="Read the report", exact=True).click()
        report = opened.value
        report.get_by_role("heading", name="Target 3: size-10").wait_for()
        notice = report.locator(".notice")
        assert notice.evaluate("each => getComputedStyle(each).textAlign") == "center", "its own styles are in force"
        assert report.locator("figure img").first.evaluate("each => each.naturalWidth") > 0
        picture(report, "records-report")
        with page.expect_download() as loaded:
            page.get_by_role("button", name="Report", exact=True).click()
        assert loaded.value.suggested_filename == "target-3.pdf"
        loaded.value.save_as(tmp_path / "a.pdf")
        assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF-1.")


@pytest.mark.slow
def test_a_target_is_exported_and_comes_back_into_a_store(
    console: RunningConsole, browser: Browser, tmp_path: Path
) -> None:
    with tab(browser, console, f"/records/{ESTIMATED}") as page:
        page.get_by_role("button", name="Export").click()
        page.get_by_text("Not masked").wait_for()
        still(page)
        picture(page, "records-export")
        page.get_by_role("combobox", name="Form").click()
        page.get_by_role("option", name=re.compile("^DICOM")).click()
        page.get_by_text("Masked: label, names and times").wait_for()
        page.get_by_role("switch", name="include label, names and true times").click()
        with page.expect_download() as loaded:
            page.get_by_role("dialog").get_by_role("button", name="Export").click()
        assert loaded.value.suggested_filename == "target-3-dicom.zip"
        with zipfile.ZipFile(loaded.value.path()) as images:
            assert any(b"size-10" in images.read(name) for name in images.namelist())
        page.get_by_role("dialog").wait_for(state="hidden")
        page.get_by_role("button", name="Export").click()
        with page.expect_download() as packed:
            page.get_by_role("dialog").get_by_role("button", name="Export").click()
        assert packed.value.suggested_filename == "target-3-csv.zip"
        with zipfile.ZipFile(packed.value.path()) as file:
            assert "target-3-csv/presses.csv" in file.namelist()


@pytest.mark.slow
def test_a_bundle_is_taken_in_once(console: RunningConsole, browser: Browser, tmp_path: Path) -> None:
    with open_store(tmp_path / "other") as other:
        target = other.add_target(number=88, name="from elsewhere")
        other.add_press(target, TactileImage(grey=levels(77).astype(float), full_scale=255.0), taken=WHEN)
        write_bundle(other.record(target), tmp_path / "bundle.zip")
    (tmp_path / "broken.zip").write_bytes((tmp_path / "bundle.zip").read_bytes()[:-40])
    with tab(browser, console, "/records") as page:
        for file, message in (
            ("bundle", "Taken in as target 88 (new); 1 press added."),
            ("bundle", "Taken in as target 88; 0 presses added, 1 there already."),
            ("broken", "must be a zip file"),
        ):
            page.get_by_role("button", name="Import a bundle").click()
            page.locator("input[type=file]").set_input_files(tmp_path / f"{file}.zip")
            page.get_by_text(message).wait_for()
        picture(page, "records-import-refused")
        page.get_by_role("link", name="from elsewhere").wait_for()
    with open_store(console.store) as store:
        assert store.target(88).id == read_bundle(tmp_path / "bundle.zip").target.id


@pytest.mark.slow
def test_a_store_is_verified(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, "/records") as page:
        page.locator(".targets tbody tr").first.wait_for()
        page.evaluate(STALE)
        page.get_by_role("button", name="Verify the store").click()
        page.get_by_text(re.compile(r"^The store is as it was stored: \d+ rows")).wait_for()
        page.get_by_text(re.compile(r"^1-\d of [1-9]$")).wait_for()
        picture(page, "records-verified")
        require_pleasant(page)


def test_what_is_stored_elsewhere_appears(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, f"/records/{MANY}") as page:
        page.get_by_text(f"1 to 24 of {PRESSES}").wait_for()
        with open_store(console.store) as store:
            target = store.target(MANY)
            image = TactileImage(grey=levels(99).astype(float), full_scale=255.0)
            press = store.add_press(target, image, taken=WHEN)
        page.get_by_text(f"1 to 24 of {PRESSES + 1}").wait_for()
        page.locator(f"img[src*='{press.id}']").wait_for()


@pytest.mark.slow
@pytest.mark.parametrize("number", ["77", "-1", "٣", "%3Cscript%3E", "9" * 60])
def test_a_target_that_is_not_there_is_told(console: RunningConsole, browser: Browser, number: str) -> None:
    with tab(browser, console, f"/records/{number}") as page:
        page.get_by_role("alert").get_by_text(re.compile("^target must")).wait_for()
        page.get_by_role("link", name="All targets").click()
        page.get_by_text("targets (phantoms)").wait_for()


@pytest.mark.slow
@pytest.mark.parametrize("rest", ["3/4", "..%2F..%2Fetc"])
def test_an_address_below_a_target_is_no_page(console: RunningConsole, browser: Browser, rest: str) -> None:
    with tab(browser, console, f"/records/{rest}", expected="404") as page:
        page.get_by_text("There is no page at this address").wait_for()

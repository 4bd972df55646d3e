"""The page Examine in a real browser: a press from the start of the camera to its estimate."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.browser import needs_browser, picture
from tests.console.operator import TABLET, choose_target, operating, press_with, requested, run

from tsis.files.frame_names import target_folder

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

SURE = 4.0  # standard deviations, which chance passes in one run of ten thousand
pytestmark = [pytest.mark.system, needs_browser]
MOVES = """
window.tops = new Set();
(function look() {
  const part = document.querySelector(".under-tabs");
  if (!part) return;
  window.tops.add(Math.round(part.getBoundingClientRect().top + scrollY));
  requestAnimationFrame(look);
})();
"""
LONGEST = """
document.querySelector(".bar .chip").firstChild.nodeValue = "120 frames/s, 123456 dropped";
document.querySelector(".bar .jobs .block").firstChild.nodeValue = "Jobs: 100 %";
"""


def _kept(console: RunningConsole, number: int) -> list[str]:
    return sorted(file.name for file in (console.workspace / target_folder(number)).glob("*.json"))


def _target(page: Page, number: str) -> None:
    expect(page.get_by_label("Target", exact=True)).to_have_value(number)


def test_start_and_stop_are_one_button(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        stop = page.get_by_role("button", name="Stop", exact=True)
        stop.click()
        page.get_by_role("button", name="Start").wait_for()
        page.get_by_text("the camera is stopped").first.wait_for()
        expect(page.locator("body")).not_to_contain_text("frames/s")
        assert requested(console, "/state")["camera"]["running"] is False
        run(page)
        assert requested(console, "/state")["camera"]["running"] is True


def test_keys_keep_snapshots_and_change_the_target(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        choose_target(page, "20")
        page.get_by_label("Target", exact=True).blur()
        page.keyboard.press("ArrowRight")
        _target(page, "21")
        page.keyboard.press("Space")
        page.get_by_text("Saved for target 21").wait_for()
        page.keyboard.press("ArrowLeft")
        _target(page, "20")
        page.keyboard.press("Space")
        page.get_by_text("Saved for target 20").wait_for()
    assert len(_kept(console, 20)) == len(_kept(console, 21)) == 1
    assert {item["target"]["number"] for item in requested(console, "/targets")["targets"]} >= {20, 21}


def test_a_target_is_pressed_estimated_and_reported_by_keys_alone(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        choose_target(page, "60")
        page.get_by_label("Target", exact=True).blur()
        for key, role in (("1", "on the target"), ("2", "reference (no inclusion)")):
            page.keyboard.press(key)
            page.get_by_role("button", name=role, pressed=True).wait_for()
            for force in ("0.5", "1"):
                page.keyboard.press("n")
                page.keyboard.type(force)
                page.keyboard.press("Space")  # which is no blank behind the number
                page.get_by_text(f"Saved for target 60: {role}, {force} N").wait_for()
        page.keyboard.press("e")
        page.get_by_text("Diameter d", exact=True).wait_for()
        with page.expect_download() as download:
            page.keyboard.press("r")
        assert download.value.suggested_filename == "target-60.pdf"


def test_the_image_is_the_widest_column_before_anything_was_saved(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        choose_target(page, "70")
        page.get_by_text("No presses of this target yet.").wait_for()
        image = page.locator(".live-stage").bounding_box()
        empty = page.get_by_text("No presses of this target yet.").locator("xpath=ancestor::section[1]").bounding_box()
        assert image is not None
        assert empty is not None
        assert image["width"] > empty["width"]


@pytest.mark.slow
def test_keys_mean_nothing_in_a_field_or_on_a_button(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        choose_target(page, "31")
        _target(page, "31")
        force = page.get_by_label("Force", exact=True)
        force.focus()
        for key in ("ArrowRight", "Space", "f"):
            page.keyboard.press(key)
        page.keyboard.press("Escape")
        expect(force).to_have_value("1")
        page.get_by_role("button", name="Next target").focus()
        page.keyboard.press("Space")  # what it does on a button, and no snapshot
        _target(page, "32")
        page.get_by_role("button", name="Previous target").click()
        _target(page, "31")
        page.keyboard.press("Space")  # the mouse has left no focus behind
        page.get_by_text("Saved for target 31").wait_for()
    assert _kept(console, 32) == []
    assert len(_kept(console, 31)) == 1


@pytest.mark.slow
def test_the_live_image_alone_and_back(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        page.keyboard.press("f")
        shown = page.locator(".live-panel").bounding_box()
        assert shown is not None
        assert (shown["width"], shown["height"]) == (1280, 800)
        assert not page.get_by_role("button", name="Snapshot").is_visible() or _covered(page, "Snapshot")
        choose = requested(console, "/state")["target"]
        page.keyboard.press("Space")
        page.get_by_text(f"Saved for target {choose}").wait_for()  # what was done is told over it
        picture(page, "examine-alone")
        page.keyboard.press("f")
        expect(page.locator("body")).not_to_have_class(re.compile("showing-alone"))
        page.get_by_role("button", name="Full screen").click()
        expect(page.locator("body")).to_have_class(re.compile("showing-alone"))
        page.keyboard.press("Escape")
        expect(page.locator("body")).not_to_have_class(re.compile("showing-alone"))


def _covered(page: Page, name: str) -> bool:
    """Whether something else lies over a button."""
    return bool(
        page.get_by_role("button", name=name).evaluate(
            "(it) => { const at = it.getBoundingClientRect();"
            " return !it.contains(document.elementFromPoint(at.x + at.width / 2, at.y + at.height / 2)); }"
        )
    )


@pytest.mark.slow
def test_the_keys_are_listed(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        page.keyboard.press("?")
        for word in ("save a snapshot", "previous target", "next target", "live image alone, and back"):
            page.get_by_role("dialog").get_by_text(word).wait_for()
        for cap in ("Space", "←", "→", "F", "?", "Tab, Enter"):
            key = page.get_by_role("dialog").locator("dt").get_by_text(cap, exact=True)
            expect(key).to_be_visible()
            assert key.evaluate("each => each.scrollWidth <= each.clientWidth && each.clientHeight >= 12"), cap
        page.keyboard.press("Escape")
        page.get_by_role("dialog").wait_for(state="hidden")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("typed", "message"),
    [
        ("abc", "target must be a number, as 2 or 0.5 (you entered 'abc')."),
        ("", "target must be a number, as 2 or 0.5 (nothing was entered)."),
        ("0", "Target must be 1–99999, number of the target (you entered 0)."),
        ("-1", "Target must be 1–99999, number of the target (you entered −1)."),
        ("100000", "Target must be 1–99999, number of the target (you entered 100000)."),
        ("1e99", "Target must be 1–99999, number of the target (you entered 1e+99)."),
        ("1e999", "Target must be a whole number (what you entered is too large)"),
        ("nan", "target must be a number, as 2 or 0.5 (you entered 'nan')."),
        ("2.5", "Target must be a whole number (you entered 2.5)"),
        ("<img src=x>", "target must be a number, as 2 or 0.5 (you entered '<img src=x>')."),
    ],
)
def test_a_target_that_is_none_is_said_and_the_number_stays(
    console: RunningConsole, browser: Browser, typed: str, message: str
) -> None:
    with operating(browser, console) as page:
        choose_target(page, "7")
        _target(page, "7")
        choose_target(page, typed)
        page.get_by_text(message).wait_for()
        _target(page, typed)  # to be corrected
        page.get_by_label("Target", exact=True).press("Escape")
        _target(page, "7")
        assert requested(console, "/state")["target"] == 7


@pytest.mark.slow
def test_no_target_before_the_first(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        choose_target(page, "1")
        page.get_by_role("button", name="Previous target").click()
        page.get_by_text("Target must be 1–99999, number of the target (you entered 0).").wait_for()
        _target(page, "1")


@pytest.mark.slow
def test_a_snapshot_while_stopped_is_one_sentence(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        page.get_by_role("button", name="Stop", exact=True).click()
        page.get_by_role("button", name="Start").wait_for()
        choose_target(page, "77")
        page.get_by_role("button", name="Snapshot").click()
        page.get_by_text("the camera must run for this; it is stopped").wait_for()
    assert _kept(console, 77) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("typed", "message"), [("6", "Force must be 0–5 N (you entered 6)"), ("x", "Force must be a number")]
)
def test_a_force_that_is_none_leaves_the_press(
    console: RunningConsole, browser: Browser, typed: str, message: str
) -> None:
    with operating(browser, console) as page:
        run(page)
        press_with(page, "0.8")
        field = page.get_by_label("Force", exact=True)
        field.fill(typed)
        field.press("Enter")
        page.get_by_text(message).wait_for()
        expect(field).to_have_value(typed)  # to be corrected
        field.press("Escape")
        expect(field).to_have_value("0.8")
        assert requested(console, "/state")["force_n"] == 0.8


@pytest.mark.slow
def test_what_is_pressed_and_flags_with_their_advice(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        page.get_by_role("button", name="not touched").click()
        flags = page.get_by_role("list", name="Flags of this press")
        flags.get_by_text("no-contact", exact=True).wait_for()
        assert requested(console, "/state")["role"] == "untouched"
        page.get_by_role("button", name="on the target").click()
        flags.get_by_text("No flags.").wait_for()
        page.get_by_text("settled", exact=True).wait_for()


@pytest.mark.slow
def test_the_live_image_has_words_and_colours(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        page.get_by_role("img", name=re.compile(r"contact around column \d+, row \d+")).first.wait_for()
        page.get_by_role("combobox", name="Colours").click()
        page.get_by_role("option", name="grey").click()
        pixel = "() => [...document.querySelector('canvas').getContext('2d').getImageData(384, 246, 1, 1).data]"
        page.wait_for_function(f"() => {{ const [r, g, b] = ({pixel})(); return r === g && g === b && r > 40; }}")
        page.get_by_role("switch", name="3-D").click()
        page.get_by_role("img", name=re.compile("relief of the live image")).wait_for()
        page.get_by_role("img", name=re.compile("grey levels: half of the pixels below")).wait_for()
        picture(page, "examine-relief")


def test_a_light_press_reads_the_tissue_and_offers_its_forces(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        choose_target(page, "55")
        page.get_by_role("button", name="Measure the tissue").click()
        page.get_by_text(re.compile(r"^Tissue [45]\.?\d* kPa \(90 % interval ")).wait_for()  # 5 kPa in truth
        assert requested(console, "/state")["role"] == "plain"
        expect(page.get_by_label("Force", exact=True)).to_have_value("0.2")
        high = page.get_by_role("button", name=re.compile(r"^(0\.9\d*|1(\.\d+)?) N$"))
        high.click()
        expect(page.get_by_label("Force", exact=True)).to_have_value(re.compile(r"^(0\.9\d*|1(\.\d+)?)$"))
        assert 0.9 <= requested(console, "/state")["force_n"] <= 1.1
        picture(page, "examine-tissue")
        page.reload()
        page.get_by_text(re.compile(r"^Tissue ")).wait_for()


def test_press_estimate_and_what_it_tells(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console) as page:
        run(page)
        choose_target(page, "50")
        page.get_by_text("No presses of this target yet.").wait_for()
        page.get_by_role("button", name="Estimate").click()
        page.get_by_text("Target 50 must have a press on the target to be estimated; it has none").wait_for()
        for role in ("on the target", "reference (no inclusion)"):
            page.get_by_role("button", name=role).click()
            for force in ("0.5", "1"):
                press_with(page, force)
                page.get_by_role("button", name="Snapshot").click()
                page.get_by_text(f"Saved for target 50: {role}, {force} N").wait_for()
        table = page.get_by_role("table")
        expect(table.get_by_role("row")).to_have_count(5)
        page.evaluate(MOVES)
        page.get_by_role("button", name="Estimate").click()
        page.get_by_text("Diameter d", exact=True).wait_for()
        assert page.evaluate("window.tops.size") == 1
        for drawn in (re.compile("^Posterior of .*depth_mm"), "Outlines of the inclusion below the surface"):
            page.get_by_role("img", name=drawn).wait_for()
        cards = page.locator(".cards").inner_text()
        for title in ("Diameter d", "Depth h", "Modulus E", "90 % interval", "truth 10 mm"):
            assert title in cards
        page.get_by_text(re.compile("^Prior: ")).wait_for()
        picture(page, "examine-estimate")
        reported = requested(console, "/targets/50/estimates")["estimates"][-1]
        page.get_by_text(reported["identifiability"]).wait_for()
        diameter = reported["parameters"]["diameter_mm"]
        assert f"{diameter['mean']:.3g} mm" in cards
        assert abs(diameter["mean"] - 10.0) < SURE * diameter["sd"]
        link = page.get_by_role("link", name="Open the target", exact=True)
        link.hover()
        page.mouse.down()
        page.evaluate(LONGEST)  # a click is lost where the page moves away under the pointer
        page.mouse.up()
        page.wait_for_url("**/records/50")


@pytest.mark.slow
def test_on_a_tablet_in_the_dark(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console, size=TABLET, color_scheme="dark", has_touch=True) as page:
        run(page)
        page.get_by_role("button", name="Snapshot").tap()
        page.get_by_text("Saved for target").first.wait_for()
        assert page.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
        picture(page, "examine-tablet-dark")

"""All pages: reached by the links, used without sight or mouse, read in both lights, on a desktop and on a tablet."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect
from tests.console.accessible import AXE, broken_rules, faults, too_wide
from tests.console.browser import needs_browser, picture
from tests.console.contrast import contrast, contrast_on, texts
from tests.console.operator import TABLET, go_to, hold, run, tab

from tsis.console.pages import PAGES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

pytestmark = [pytest.mark.system, needs_browser]
TITLES = [title for address, (title, _) in PAGES.items() if "{" not in address]
DESKTOP, WIDTHS = 1280, (390, 640, 768, 1280, 2560)  # 640 is what 1280 is with texts at 200 %


@pytest.fixture(scope="module")
def desktop(console: RunningConsole, browser: Browser) -> Iterator[Page]:
    """A light page on a desktop, with the camera running."""
    with tab(browser, console, color_scheme="light") as page:
        hold(page)
        run(page)
        yield page


@pytest.fixture(scope="module")
def tablet(console: RunningConsole, browser: Browser, desktop: Page) -> Iterator[Page]:
    """A dark page on a tablet, which watches."""
    with tab(browser, console, size=TABLET, color_scheme="dark") as page:
        page.get_by_text("controls the camera; you are watching.").wait_for()
        yield page


@pytest.mark.parametrize("title", TITLES)
@pytest.mark.parametrize("where", ["desktop", "tablet"])
def test_a_page_keeps_nobody_out(where: str, title: str, request: pytest.FixtureRequest) -> None:
    page: Page = request.getfixturevalue(where)
    go_to(page, title)
    picture(page, f"{title.lower()}-{where}-{'light' if where == 'desktop' else 'dark'}")
    assert faults(page) == []
    assert too_wide(page) == []
    pale = [item for item in texts(page) if item.contrast < item.least]
    assert pale == []


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_fits_every_width(console: RunningConsole, browser: Browser, scheme: str) -> None:
    """Pictures of all pages at five widths, for people; nothing sticks out of a page at any of them."""
    wide: dict[str, list[str]] = {}
    with tab(browser, console, color_scheme=scheme) as page:
        hold(page)
        run(page)
        for title in TITLES:
            page.set_viewport_size({"width": DESKTOP, "height": 900})
            go_to(page, title)
            for width in WIDTHS:
                page.set_viewport_size({"width": width, "height": 900})
                picture(page, f"{title.lower()}-{width}-{scheme}")
                if sticking := too_wide(page):
                    wide[f"{title}, {width}"] = sticking
    assert wide == {}


def test_controls_are_large_enough_for_a_finger(console: RunningConsole, browser: Browser) -> None:
    """44 pixels each way on a screen that is touched, of all pages."""
    small: dict[str, list[str]] = {}
    with tab(browser, console, size=(390, 844), has_touch=True) as page:
        hold(page)
        for title in TITLES:
            go_to(page, title)
            if result := page.evaluate(SMALL) + too_wide(page):
                small[title] = result
    assert small == {}


SMALL = r"""() => [...document.querySelectorAll(
    "button, a[href], [role=tab], [role=switch], [role=checkbox], .q-field__control")]
  .filter((each) => each.checkVisibility({ visibilityProperty: true }) && !each.matches(".skip, .q-uploader *"))
  .map((each) => [each.getBoundingClientRect(), each])
  .filter(([box]) => box.width && (box.width < 43.5 || box.height < 43.5))
  .map(([box, each]) => `${box.width} x ${box.height}: ${each.outerHTML.slice(0, 120)}`)"""


@pytest.mark.parametrize("title", TITLES)
@pytest.mark.parametrize("where", ["desktop", "tablet"])
def test_the_help_of_a_page_explains_each_of_its_fields(where: str, title: str, request: pytest.FixtureRequest) -> None:
    page: Page = request.getfixturevalue(where)
    go_to(page, title)
    page.wait_for_function(f"() => {{ const left = ({UNEXPLAINED})(); return left.length === 0; }}")
    page.get_by_role("button", name="Help").click()
    dialog = page.get_by_role("dialog")
    try:
        dialog.get_by_text(f"Help: {title}").wait_for()
        page.wait_for_function("document.getAnimations().every((each) => each.playState !== 'running')")
        picture(page, f"help-{title.lower()}-{where}")
        assert faults(page) == []
        assert [item for item in texts(page) if item.contrast < item.least] == []
    finally:  # an open dialog would fail each later test of this page
        dialog.get_by_role("button", name="Close").click()
        dialog.wait_for(state="hidden")


UNEXPLAINED = """() => [...document.querySelectorAll('main .q-field')]
  .filter((each) => each.checkVisibility() && !each.querySelector('[aria-description]'))
  .map((each) => each.innerText)"""


@pytest.mark.parametrize("title", ["Examine", "Camera", "Design"])
@pytest.mark.parametrize("where", ["desktop", "tablet"])
def test_the_focus_is_outlined_in_both_themes(where: str, title: str, request: pytest.FixtureRequest) -> None:
    """Each control that Tab reaches has an outline of 2 px or more, 3 : 1 against what it stands on (WCAG 1.4.11)."""
    page: Page = request.getfixturevalue(where)
    go_to(page, title)
    page.evaluate("document.activeElement.blur()")
    seen = []
    for _ in range(40):
        page.keyboard.press("Tab")
        page.wait_for_function("document.getAnimations().every((each) => each.playState !== 'running')")
        mark = page.evaluate(FOCUS)
        if mark["text"] in seen or mark["text"].startswith("<body"):  # round and at the beginning again
            continue
        seen.append(mark["text"])
        assert mark["width"] >= 2, mark["text"]
        assert contrast_on(mark["colour"], mark["grounds"]) >= 3.0, mark["text"]
    assert len(seen) > 10


FOCUS = r"""() => {
  const at = document.activeElement;
  const width = (each) => {
    const style = getComputedStyle(each);
    return style.outlineStyle === "none" ? 0 : parseFloat(style.outlineWidth);
  };
  const near = [at, at.parentElement, at.closest(".q-field__control, .q-slider, .q-toggle, .q-checkbox, .q-tab")];
  const marked = near.find((each) => each && width(each) > 0) || at;
  const grounds = [];
  for (let each = marked.parentElement; each; each = each.parentElement)
    grounds.push(getComputedStyle(each).backgroundColor);
  const colour = getComputedStyle(marked).outlineColor;
  return { text: at.outerHTML.slice(0, 200), width: width(marked), colour, grounds };
}"""


def test_contrast_is_that_of_the_standard() -> None:
    """21 between black and white, and 4.5 just reached by #767676 on white."""
    assert contrast((0, 0, 0), (255, 255, 255)) == pytest.approx(21)
    assert contrast((0x76,) * 3, (255, 255, 255)) == pytest.approx(4.54, abs=0.005)


def test_faults_are_found(browser: Browser) -> None:
    page = browser.new_page()
    page.set_content(
        """<main><h2>first</h2><button></button><input><img src="data:,"><canvas></canvas><p id="a"></p><p id="a"></p>
        <button><i class="q-icon">menu</i></button><table><tr><td>1</td></tr></table><div tabindex="3">x</div></main>"""
    )
    result = faults(page)
    page.close()
    assert sum(item.startswith("no name") for item in result) == 4
    for label in ("language", "title", "picture without words", "#a", "table without", "jumps", "level 1", "each nav"):
        assert any(label in item for item in result), label


def test_what_breaks_a_rule_of_axe_is_found(browser: Browser) -> None:
    pytest.importorskip(AXE)
    page = browser.new_page()
    page.set_content('<html lang="en"><title>x</title><main><h1>x</h1><div role="progressbar"></div></main></html>')
    result = broken_rules(page)
    page.close()
    assert result == ['axe, aria-progressbar-name: <div role="progressbar"></div>']


def test_pale_text_is_found(browser: Browser) -> None:
    page = browser.new_page()
    page.set_content('<div style="background:#333"><p style="color:#555">pale</p><p style="color:#fff">clear</p></div>')
    result = {item.text: item.contrast for item in texts(page)}
    page.close()
    assert result["pale"] < 2 < 12 < result["clear"]


def test_the_keyboard_opens_the_choice_of_a_file(console: RunningConsole, browser: Browser, desktop: Page) -> None:
    """The field lies inert in its button, which mouse and keyboard use."""
    with tab(browser, console, "/images", color_scheme="light") as page:
        button = page.locator("a.q-btn[aria-label='Choose images']")
        with page.expect_file_chooser():
            button.click()
        with page.expect_file_chooser():
            button.press("Enter")


def test_the_list_of_jobs_closes_on_its_page(desktop: Page) -> None:
    go_to(desktop, "Jobs")
    desktop.get_by_role("dialog", name="Jobs").wait_for(state="hidden")


@pytest.mark.parametrize("width", [360, 390, 430, 768])
def test_the_live_image_fills_a_narrow_screen(
    console: RunningConsole, browser: Browser, desktop: Page, width: int
) -> None:
    with tab(browser, console, size=(width, 844), color_scheme="light") as page:
        stage = page.locator(".live-stage")
        stage.wait_for()
        box = stage.bounding_box()
        assert box is not None
        assert box["width"] > 0.85 * width
        assert too_wide(page) == []


@pytest.mark.parametrize("width", [390, 768])
def test_a_snapshot_is_in_reach_on_a_narrow_screen_and_the_notice_is_read(
    console: RunningConsole, browser: Browser, desktop: Page, width: int
) -> None:
    on_top = """(each) => { const box = each.getBoundingClientRect();
      return each.contains(document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2)); }"""
    with tab(browser, console, size=(width, 844), has_touch=True) as page:
        save, notice = page.get_by_role("button", name="Snapshot"), page.locator(".foot > div").first
        expect(save).to_be_in_viewport(ratio=1)
        assert save.evaluate(on_top)
        # The page may still grow, so that its end is sought again until all of the notice is seen there.
        page.wait_for_function(
            """([each, onTop]) => { scrollTo(0, 100000); const box = each.getBoundingClientRect();
              return box.top >= 0 && box.bottom <= innerHeight && eval(onTop)(each); }""",
            arg=[notice.element_handle(), on_top],
        )
        for back in range(0, 120, 10):
            assert save.evaluate(on_top), f"the Snapshot is covered {back} px above the page's end"
            page.evaluate("scrollBy(0, -10)")


@pytest.mark.parametrize("title", ["Examine", "Targets"])
def test_at_200_percent_the_page_is_not_a_sliver(
    console: RunningConsole, browser: Browser, desktop: Page, title: str
) -> None:
    """1280 x 800 at 200 % is 640 x 400; header and footer scroll away, so that all of it is the page's."""
    with tab(browser, console, size=(640, 400)) as page:
        go_to(page, title)
        page.evaluate("scrollTo(0, 10000)")
        covered = page.evaluate(
            """() => [...document.querySelectorAll('.q-header, .q-footer')].filter(
                 (each) => getComputedStyle(each).position === 'fixed').length"""
        )
        assert covered == 0
        assert too_wide(page) == []


def test_links_of_the_navigation_do_not_overlap(console: RunningConsole, browser: Browser, desktop: Page) -> None:
    with tab(browser, console, size=(390, 844), has_touch=True) as page:
        for navigation in page.get_by_role("navigation").all():
            boxes = [link.bounding_box() for link in navigation.get_by_role("link").all()]
            edges = sorted((box["x"], box["x"] + box["width"]) for box in boxes if box)
            assert len(edges) > 1
            assert all(end <= start for (_, end), (start, _) in itertools.pairwise(edges))
        wide = page.evaluate(
            "() => [...document.querySelectorAll('nav a')].filter((a) => a.scrollWidth > a.clientWidth + 1)"
        )
        assert wide == []


def test_the_link_of_the_open_page_is_in_reach_on_a_telephone(
    console: RunningConsole, browser: Browser, desktop: Page
) -> None:
    with tab(browser, console, "/records", size=(390, 844), color_scheme="light") as page:
        link = page.get_by_role("navigation").get_by_role("link", name="Targets", exact=True)
        expect(link).to_be_in_viewport(ratio=1)

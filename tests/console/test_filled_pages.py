"""Pages with what work leaves on them: long names, messages over controls, wide screens, dropped files."""

from __future__ import annotations

import base64
import re
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

import httpx
import pytest
from playwright.sync_api import Error as BrowserError
from playwright.sync_api import expect
from tests.console.accessible import faults, too_wide
from tests.console.browser import needs_browser, picture
from tests.console.contrast import texts
from tests.console.filled_store import ESTIMATED, MANY, fill
from tests.console.operator import BY_ITSELF_MS, TRIES, hold, operating, run, tab
from tests.console.running import RunningConsole, running_console
from tests.console.services.test_captures import disc
from tests.records.sample import WHEN, levels
from tests.waiting import HANGS_S, until

from tsis.model.image import TactileImage
from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Locator

pytestmark = [pytest.mark.system, needs_browser]
LONG, NAME = 7, "phantom-of-the-second-series-" + "x" * 90
WIDE, SHARE, LEGIBLE_PX = 2560, 0.6, 18
DROPPED = """async (content) => {
  const data = new DataTransfer();
  for (const [name, text] of content)
    data.items.add(new File([Uint8Array.from(atob(text), (each) => each.charCodeAt(0))], name));
  let over = null; // the library places it while something is dragged over the field
  while (!(over = document.querySelector(".q-uploader__dnd"))) {
    const field = document.querySelector(".q-uploader");
    field?.dispatchEvent(new DragEvent("dragover", { bubbles: true, cancelable: true, dataTransfer: data }));
    await new Promise((go) => setTimeout(go, 50));
  }
  over.dispatchEvent(new DragEvent("drop", { bubbles: true, cancelable: true, dataTransfer: data }));
}"""


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    """A console on a filled store, with one target of a long name."""
    folder = tmp_path_factory.mktemp("console")
    fill(folder / "records")
    with open_store(folder / "records") as store:
        target = store.add_target(number=LONG, name=NAME, note="n" * 300)
        image = TactileImage(grey=levels(1).astype(float), full_scale=255.0, force_n=0.5, mm_per_pixel=(0.12, 0.14))
        store.add_press(target, image, role="target", taken=WHEN)
    with running_console(folder) as running:
        yield running


BROKEN_WORDS = """() => [...document.querySelectorAll("td, th, dd, dt, .card *")].flatMap((cell) => {
  const broken = [];
  for (const text of [...cell.childNodes].filter((node) => node.nodeType === Node.TEXT_NODE))
    for (const found of text.data.matchAll(/(?<![\\p{L}\\d])\\p{L}{2,20}(?![\\p{L}\\d])/gu)) {
      const range = document.createRange();
      range.setStart(text, found.index);
      range.setEnd(text, found.index + found[0].length);
      if (new Set([...range.getClientRects()].map((line) => Math.round(line.top))).size > 1) broken.push(found[0]);
    }
  return broken;
})"""


def fits(part: Locator, width: int) -> None:
    """Wait until a part lies within the window; a page that is being laid out moves."""

    def inside() -> bool:
        box = part.bounding_box()
        return box is not None and box["x"] >= 0 and box["x"] + box["width"] <= width

    part.wait_for()
    until(inside)
    until(lambda: too_wide(part.page) == [])


def wide(part: Locator, width: float) -> bool:
    box = part.bounding_box()
    return box is not None and box["width"] >= width


def repeated(act: Callable[[], object], part: Locator) -> None:
    """Do something until it shows: a page that a busy machine loads anew has lost what was done to it before."""
    for _ in range(TRIES):
        with suppress(BrowserError):
            act()
            part.first.wait_for(timeout=BY_ITSELF_MS)
            return
    part.first.wait_for()


@pytest.mark.parametrize("width", [390, 640, 1280])  # 640 is what 1280 is at 200 %
def test_a_long_name_pushes_nothing_off_the_screen(console: RunningConsole, browser: Browser, width: int) -> None:
    with tab(browser, console, "/records", size=(width, 844), color_scheme="light") as page:
        fits(page.get_by_role("link", name=NAME), width)
        if width > 390:  # the table of a telephone scrolls
            fits(page.get_by_role("columnheader", name="Last press (UTC)"), width)
        picture(page, f"records-long-name-{width}")
        for path in (f"/records/{LONG}", f"/records/compare/3-{LONG}", f"/files/report/{LONG}.html"):
            page.goto(console.address + path)
            fits(page.get_by_text(re.compile(NAME)).first, width)


def test_no_table_breaks_a_word_on_a_telephone(console: RunningConsole, browser: Browser) -> None:
    broken: dict[str, list[str]] = {}
    with tab(browser, console, "/records", size=(390, 844), has_touch=True) as page:
        for address in ("/records", f"/records/{ESTIMATED}", f"/records/{MANY}", "/jobs", "/images", "/about"):
            page.goto(console.address + address)
            page.locator("main .panel").first.wait_for()
            page.wait_for_function("() => !document.querySelector('main .q-spinner')")
            if found := page.evaluate(BROKEN_WORDS):
                broken[address] = found
    assert broken == {}


def test_jobs_are_read_without_much_scrolling_on_a_telephone(console: RunningConsole, browser: Browser) -> None:
    """Ten jobs stand on a sheet; those before them are a touch away."""
    for _ in range(12):
        job = httpx.post(
            f"{console.address}/api/v1/targets/{ESTIMATED}/estimate",
            json={"kind": "inclusion"},
            headers=console.key,
            timeout=HANGS_S,
        )
        assert job.status_code == 202, job.text
    with tab(browser, console, "/jobs", size=(390, 844), has_touch=True) as page:
        page.get_by_text("1-10 of").wait_for()
        rows = page.get_by_role("row").filter(has_text="estimate of target")
        expect(rows).to_have_count(10)
        heights = rows.evaluate_all("(all) => all.map((row) => row.getBoundingClientRect().height)")
        assert max(heights) < 844 / 6, "a job is a row, not a card"


def test_a_message_lets_clicks_through_and_stays_until_it_is_closed(console: RunningConsole, browser: Browser) -> None:
    with operating(browser, console, "/images") as page:
        message = page.locator(".q-notification").filter(has_text="an unsupported format")
        field = page.locator("input[type=file]")
        repeated(lambda: field.set_input_files({"name": "a.exe", "mimeType": "x/y", "buffer": b"x"}), message)
        message = message.first
        page.wait_for_function("document.getAnimations().every((each) => each.playState !== 'running')")
        over = """(each) => {
          const box = each.getBoundingClientRect();
          return each.contains(document.elementFromPoint(box.x + 20, box.y + box.height / 2));
        }"""
        assert message.evaluate(over) is False
        shown = page.locator(".q-notification").filter(has_text="an unsupported format").count()
        message.get_by_role("button", name="Close").click()
        expect(page.locator(".q-notification").filter(has_text="an unsupported format")).to_have_count(shown - 1)


def test_a_wide_screen_is_used_and_read_from_afar(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, "/records", size=(WIDE, 1440), color_scheme="dark") as page:
        for address, part in (("/records", "main .panel"), (f"/records/{LONG}", "main"), ("/design", "main .design")):
            page.goto(console.address + address)
            panel = page.locator("main .panel").first
            panel.wait_for()
            until(partial(wide, page.locator(part).first, SHARE * WIDE))
            size = panel.evaluate("(each) => parseFloat(getComputedStyle(each).fontSize)")
            assert size >= LEGIBLE_PX, address
        page.goto(console.address)
        hold(page)
        run(page)
        until(partial(wide, page.locator(".live-stage"), WIDE / 2))


def test_files_are_dropped_bad_ones_are_named_and_good_ones_stay(
    console: RunningConsole, browser: Browser, tmp_path: Path
) -> None:
    good = base64.b64encode(disc(tmp_path, "good.png").read_bytes()).decode()
    cut, other = (base64.b64encode(content).decode() for content in (b"\x89PNG no more", b"MZ"))
    with operating(browser, console, "/images") as page:
        page.locator(".q-uploader").wait_for()
        files = [["good.png", good], ["cut.png", cut], ["<b>other.exe", other]]
        repeated(lambda: page.evaluate(DROPPED, files), page.get_by_role("cell", name="good.png", exact=True))
        page.get_by_text("'cut.png' must be a PNG").first.wait_for()
        page.locator(".q-notification").get_by_text("an unsupported format").first.wait_for()
        assert page.get_by_role("cell", name=re.compile(r"^(cut\.png|.*other\.exe)$")).count() == 0
        assert faults(page) == []
        assert [item for item in texts(page) if item.contrast < item.least] == []
        picture(page, "images-dropped")


def test_no_search_breaks_the_list(console: RunningConsole, browser: Browser) -> None:
    with tab(browser, console, "/records") as page:
        page.get_by_text("many presses").wait_for()
        search = page.get_by_label("Search number, name, note or #tag")
        for text in ("%", "<img src=x onerror=alert(1)>", "' OR 1=1 --", "\\", "x" * 5000, "٣", "NaN"):
            search.fill(text)
            page.get_by_text("many presses").wait_for(state="hidden")
            until(lambda: too_wide(page) == [])
            search.fill("")
            page.get_by_text("many presses").wait_for()

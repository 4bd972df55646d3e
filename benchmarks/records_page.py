"""How soon the page of records is there: thousands of targets, a hundred thousand presses, in a real browser.

Run ``python -m benchmarks.records_page``. The list is reached by its link from another page, so that the start of the
browser is not measured; a target is reached from the list. Times are from the click to the moment at which the browser
shows what was asked for. Rows are entered in bulk; of the target that is opened there are frames.
"""

from __future__ import annotations

import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench
from benchmarks.store_speed import BEGUN, frame, grown
from tests.console.browser import chromium
from tests.console.running import running_console

from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Callable

    from playwright.sync_api import Page

SHEET, SEEN = 24, "1-50 of {count}"
LOADED = """count => {
    const all = [...document.querySelectorAll('.press img')];
    all.forEach(each => each.loading = 'eager');
    return all.length === count && all.every(each => each.complete && each.naturalWidth > 0);
}"""


def filled(folder: Path, rows: int, targets: int) -> int:
    """A store with one more target, whose frames can be shown; its number."""
    grown(folder, rows, targets)
    rng = np.random.default_rng(2)
    with open_store(folder) as store:
        target = store.add_target(name="with frames")
        for _ in range(SHEET):
            store.add_press(target, frame(rng), taken=BEGUN)
        return target.number


def timed(act: Callable[[], object]) -> float:
    began = time.perf_counter()
    act()
    return 1e3 * (time.perf_counter() - began)


def measured(page: Page, count: int, number: int) -> dict[str, float]:
    """Milliseconds of each way through the pages, once."""
    navigation, found = page.get_by_role("navigation"), {}

    def listed() -> None:
        navigation.get_by_role("link", name="Records", exact=True).click()
        page.get_by_text(SEEN.format(count=count)).wait_for()

    def turned() -> None:
        page.get_by_role("button", name="Next page").click()
        page.get_by_text(f"51-100 of {count}").wait_for()

    def sorted_by_last() -> None:
        page.get_by_role("columnheader", name="Last press").click()
        page.get_by_text(SEEN.format(count=count)).wait_for()

    def searched() -> None:
        page.get_by_label("Search number or name").fill("with fr")
        page.get_by_text("1-1 of 1").wait_for()

    def opened() -> None:
        page.get_by_role("link", name="with frames").click()
        page.get_by_text(f"Target {number}: with frames").wait_for()

    found[f"list of {count} targets"] = timed(listed)
    found["its next sheet"] = timed(turned)
    found["sorted by the last press"] = timed(sorted_by_last)
    found["searched (200 ms of it the wait for the next letter)"] = timed(searched)
    found["a target"] = timed(opened)
    found[f"its {SHEET} pictures, from then on"] = timed(lambda: page.wait_for_function(LOADED, arg=SHEET))

    def visited(name: str) -> None:
        navigation.get_by_role("link", name=name, exact=True).click()
        page.get_by_role("heading", level=1, name=name, exact=True).wait_for()

    for name in navigation.get_by_role("link").all_inner_texts():
        found[f"page {name}"] = timed(partial(visited, name))
    return found


def main() -> int:
    """Print the table."""
    bench = Bench(__doc__, rows=100000, targets=2000, repeats=7)
    found: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory(prefix="tsis-records-page-") as folder:
        number = filled(Path(folder) / "records", bench.rows, bench.targets)
        with running_console(Path(folder)) as console, chromium() as browser:
            for _ in range(bench.repeats):
                page = browser.new_context(viewport={"width": 1280, "height": 800}).new_page()
                page.goto(console.entrance)
                page.get_by_role("navigation").get_by_role("link", name="About", exact=True).click()
                page.get_by_role("heading", level=1, name="About").wait_for()
                # A link that is clicked before the page is connected loads the whole page anew.
                page.get_by_role("button", name="Release the camera").wait_for()
                for name, value in measured(page, bench.targets + 1, number).items():
                    found.setdefault(name, []).append(value)
                page.context.close()
    rows = [(name, f"{np.median(values):.0f} ms", f"{max(values):.0f} ms") for name, values in found.items()]
    title = f"Records of {bench.rows} presses, {bench.repeats} times"
    bench.table(title, ("what", "median", "most"), rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""The console in a browser: its start, the live view, the pages of a large store, and the way to a first report.

    python -m benchmarks.console [--only start live records report] [--times 3] [--seconds 20]

The console is started as people start it, and opened in Chromium without a window or a graphics processor, at 1280 x
800. ``start`` times the command until its page shows a heading, and *Start* until frames are shown. ``live`` asks the
page what it has drawn of the virtual probe's 30 frames a second, and the system what the server takes of a core.
``records`` times from each click to the moment at which the browser shows what was asked for, in a store whose rows are
entered in bulk. ``report`` times from nothing to a saved PDF.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, Goal, Several
from benchmarks.store_speed import BEGUN, frame, grown
from tests.console.browser import chromium
from tests.console.first_report import first_report
from tests.console.operator import tab
from tests.console.running import running_console

from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

USER, SYSTEM = 11, 12  # fields of /proc/PID/stat behind the program's name
SETTLE_S = 3.0
OPENINGS = 5
DRAWN_EVERY_S = 1.5  # the elements remember the last 120 drawings
SECONDS, MS, CORE = "{:.2f} s", "{:.1f} ms", "{:.1f} % of a core"
DRAWN = """() => ["figure.live", "figure.surface"].map((name) => {
  const figure = document.querySelector(name);
  return figure ? getElement(figure).measured() : [];
})"""
SHEET, SEEN = 24, "1-50 of {count}"
LOADED = """count => {
    const all = [...document.querySelectorAll('.press img')];
    all.forEach(each => each.loading = 'eager');
    return all.length === count && all.every(each => each.complete && each.naturalWidth > 0);
}"""


class CoreShare:
    """Share of a core that a process takes, from now on."""

    def __init__(self, process_id: int) -> None:
        self._account = Path(f"/proc/{process_id}/stat")
        self._worked_s, self._begun_s = self._used_s(), time.monotonic()

    def percent(self) -> float:
        """Share since it was made."""
        return 100.0 * (self._used_s() - self._worked_s) / (time.monotonic() - self._begun_s)

    def _used_s(self) -> float:
        fields = self._account.read_text().rpartition(")")[2].split()
        return (int(fields[USER]) + int(fields[SYSTEM])) / os.sysconf("SC_CLK_TCK")


def emptied(folder: Path, name: str) -> Path:
    """A new folder for a console."""
    place = folder / name
    place.mkdir()
    return place


def opened(console: RunningConsole, browser: Browser) -> Page:
    """The console's page in a browser that has never seen it."""
    page = browser.new_context(viewport={"width": 1280, "height": 800}).new_page()
    page.goto(console.entrance)
    return page


def connected(page: Page) -> None:
    """Wait until the page acts: a button that is clicked before does nothing."""
    page.get_by_role("button", name="Release the camera").wait_for()


def start(bench: Bench, browser: Browser, folder: Path) -> Iterator[Goal]:
    """From the command to the page, and from *Start* to the image."""
    for number in range(bench.times):
        begun = time.monotonic()
        with running_console(emptied(folder, f"start-{number}")) as console:
            page = opened(console, browser)
            page.get_by_text("What this is").wait_for()
            first_s = time.monotonic() - begun
            connected(page)
            begun = time.monotonic()
            page.get_by_role("button", name="Start", exact=True).click()
            page.get_by_text("frames/s shown").wait_for()
            image_s = time.monotonic() - begun
            page.context.close()
        yield Goal(name=f"run {number + 1}, command to first page", value=first_s, most=2.5, form=SECONDS)
        yield Goal(name=f"run {number + 1}, Start to image", value=image_s, most=1.0, form=SECONDS)


def drawn(page: Page, seconds: float) -> tuple[float, list[float], float]:
    """Frames drawn a second from now on, their ages since the server had them in ms, and reliefs a second."""
    frames: dict[float, float] = {}
    reliefs: set[float] = set()
    begun, ends = page.evaluate("performance.now()"), time.monotonic() + seconds
    while time.monotonic() < ends:
        page.wait_for_timeout(1000 * min(DRAWN_EVERY_S, max(0.0, ends - time.monotonic())))
        live, surface = page.evaluate(DRAWN)
        frames |= {at: age for at, age in live if at >= begun}
        reliefs |= {at for at in surface if at >= begun}
    passed_s = (page.evaluate("performance.now()") - begun) / 1000.0
    return len(frames) / passed_s, list(frames.values()) or [np.nan], len(reliefs) / passed_s


def live(bench: Bench, browser: Browser, folder: Path) -> Iterator[Goal]:
    """Frames shown, their age, the relief beside them, the server's share of a core, and how soon a page acts."""
    with running_console(emptied(folder, "live")) as console:
        page = opened(console, browser)
        connected(page)
        page.get_by_role("button", name="Start", exact=True).click()
        page.get_by_text("frames/s shown").wait_for(timeout=30000)
        time.sleep(SETTLE_S)
        server = CoreShare(console.process.pid)
        rate, ages, _ = drawn(page, bench.seconds)
        watched = server.percent()
        least = 30.0 - 1.0 / bench.seconds  # one frame may fall on the edge of the measured time
        yield Goal(name="frames shown a second", value=rate, least=least, form="{:.2f}")
        yield Goal(name="age when drawn, median", value=float(np.median(ages)), form=MS)
        yield Goal(name="age when drawn, 95th percentile", value=float(np.percentile(ages, 95)), most=60.0, form=MS)
        page.get_by_role("switch", name="3-D").click()
        page.locator("figure.surface").wait_for()
        time.sleep(SETTLE_S)
        rate, _, reliefs = drawn(page, bench.seconds)
        yield Goal(name="with the relief: reliefs a second", value=reliefs, least=10.0)
        yield Goal(name="with the relief: frames a second", value=rate, least=25.0)
        page.context.close()
        time.sleep(SETTLE_S)
        server = CoreShare(console.process.pid)
        time.sleep(bench.seconds)
        yield Goal(name="server with one viewer", value=watched, most=15.0, form=CORE)
        yield Goal(name="server without viewers", value=server.percent(), form=CORE)
        opening = sorted(opening_s(console, browser) for _ in range(OPENINGS))
        yield Goal(name="page can be used after, median", value=opening[OPENINGS // 2], most=2.0, form=SECONDS)


def opening_s(console: RunningConsole, browser: Browser) -> float:
    """Seconds from asking for the page until it acts: frames are drawn, and the server has told of the camera."""
    begun = time.monotonic()
    page = opened(console, browser)
    page.get_by_role("button", name="Stop", exact=True).wait_for()
    page.get_by_text("frames/s shown").wait_for()
    page.get_by_text("dropped").first.wait_for()
    took = time.monotonic() - begun
    page.context.close()
    return took


def records(bench: Bench, browser: Browser, folder: Path) -> Iterator[Goal]:
    """The list of a store of many presses, and one of its targets, reached by their links."""
    place, rng = emptied(folder, "large"), np.random.default_rng(2)
    grown(place / "records", bench.rows, bench.targets)
    with open_store(place / "records") as store:
        target = store.add_target(name="with frames")  # whose frames can be shown
        for _ in range(SHEET):
            store.add_press(target, frame(rng), taken=BEGUN)
    found: dict[str, list[float]] = {}
    with running_console(place) as console:
        for _ in range(bench.times):
            page = opened(console, browser)
            connected(page)
            for name, act in steps(page, bench.targets + 1, target.number).items():
                began = time.perf_counter()
                act()
                found.setdefault(name, []).append(1e3 * (time.perf_counter() - began))
            page.context.close()
    for name, values in found.items():
        yield Goal(name=name, value=float(np.median(values)), most=300.0, form="{:.0f} ms")


def steps(page: Page, count: int, number: int) -> dict[str, Callable[[], object]]:
    """Each way through the pages, in order."""
    navigation = page.get_by_role("navigation")

    def listed() -> None:
        navigation.get_by_role("link", name="Records", exact=True).click()
        page.get_by_text(SEEN.format(count=count)).wait_for()

    def turned() -> None:
        page.get_by_role("button", name="Next page").click()
        page.get_by_text(f"51-100 of {count}").wait_for()

    def sorted_by_last() -> None:
        page.get_by_role("columnheader", name="Last press (UTC)").click()
        page.get_by_text(SEEN.format(count=count)).wait_for()

    def searched() -> None:
        page.get_by_label("Search number, name, note or #tag").fill("with fr")
        page.get_by_text("1-1 of 1").wait_for()

    def shown() -> None:
        page.get_by_role("link", name="with frames").click()
        page.get_by_text(f"Target {number}: with frames").wait_for()

    return {
        f"list of {count} targets": listed,
        "its next sheet": turned,
        "sorted by the last press": sorted_by_last,
        "searched (200 ms of it the wait for the next letter)": searched,
        "a target": shown,
        f"its {SHEET} pictures, from then on": lambda: page.wait_for_function(LOADED, arg=SHEET),
    }


def report(bench: Bench, browser: Browser, folder: Path) -> Iterator[Goal]:
    """From nothing to a saved report, where mechanics and light are kept."""
    for number in range(bench.times):
        place, begun = emptied(folder, f"report-{number}"), time.monotonic()
        with running_console(place) as console, tab(browser, console) as page:
            first_report(page, place)
            whole = time.monotonic() - begun
        yield Goal(name=f"run {number + 1}, report saved", value=whole, most=120.0, form="{:.1f} s")


PARTS = {"start": start, "live": live, "records": records, "report": report}


def main() -> int:
    """Print the table; the exit code is 1 where a number is missed."""
    bench = Bench(__doc__, only=Several(PARTS), times=3, seconds=20.0, rows=100_000, targets=2000)
    found: list[Goal] = []
    with tempfile.TemporaryDirectory(prefix="tsis-console-") as folder, chromium() as browser:
        for name in bench.only or PARTS:
            found += PARTS[name](bench, browser, Path(folder))
    return bench.end(found)


if __name__ == "__main__":
    sys.exit(main())

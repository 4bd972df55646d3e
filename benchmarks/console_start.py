"""The console's start and one guided examination, in a browser.

    python -m benchmarks.console_start [--times 3]

Timed are the command until its page shows a heading, and *Start* until frames are shown, in a program that has not
shown one. Clicks and keys are counted by the page itself, from the first page to the report of a target, pressed
on and off its inclusion, as the filled buttons lead. The server's processor time hardly depends on what else runs.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.harness import Bench, Goal
from benchmarks.live.processor import CoreShare
from tests.console.browser import chromium
from tests.console.running import running_console

if TYPE_CHECKING:
    from playwright.sync_api import Browser

MOST_PAGE_S, MOST_IMAGE_S = 2.5, 1.0
SECONDS, COUNT = "{:.2f} s", "{:.0f}"
FILLED = "main .q-btn--unelevated, main .filled"
STEPS = ("Try the virtual probe", "Switch to the reference", "Snapshot", "Switch to the target", "Snapshot", "Estimate")
COUNTED = """() => {
  window.acts = { click: 0, keydown: 0 };
  for (const kind of Object.keys(window.acts))
    document.addEventListener(kind, (event) => event.isTrusted && window.acts[kind]++, { capture: true });
}"""


def timed(folder: Path, browser: Browser) -> tuple[float, float, float, float]:
    """Seconds from the command to the page, and from *Start* to the image; of each, the server's processor time."""
    begun = time.monotonic()
    with running_console(folder) as console:
        page = browser.new_context(viewport={"width": 1280, "height": 800}).new_page()
        page.goto(console.entrance)
        page.get_by_text("What this is").wait_for()
        first_s, server = time.monotonic() - begun, CoreShare(console.process.pid)
        first_work_s = server.used_s()
        page.get_by_role("button", name="Release the camera").wait_for()
        begun, before_s = time.monotonic(), server.used_s()
        page.get_by_role("button", name="Start", exact=True).click()
        page.get_by_text("frames/s shown").wait_for()
        image_s, image_work_s = time.monotonic() - begun, server.used_s() - before_s
        page.context.close()
    return first_s, image_s, first_work_s, image_work_s


def counted(folder: Path, browser: Browser) -> dict[str, int]:
    """Clicks and keys of one examination by the filled buttons."""
    with running_console(folder) as console:
        page = browser.new_context(viewport={"width": 1280, "height": 800}).new_page()
        page.goto(console.entrance)
        page.get_by_role("button", name="Release the camera").wait_for()
        page.evaluate(COUNTED)
        for name in STEPS:
            page.locator(FILLED).get_by_text(name, exact=True).click()
        page.locator(FILLED).get_by_text("Report", exact=True).click()
        page.wait_for_url("**/records/1")
        result: dict[str, int] = page.evaluate("window.acts")
        page.context.close()
    return result


def main() -> int:
    """Print the table; the exit code is 1 where a number is missed."""
    bench = Bench(__doc__, times=3)
    figures = []
    with chromium() as browser:
        for number in range(bench.times):
            with tempfile.TemporaryDirectory(prefix="tsis-console-start-") as folder:
                first_s, image_s, first_work_s, image_work_s = timed(Path(folder), browser)
            run = f"run {number + 1}"
            figures += [
                Goal(name=f"{run}, command to first page", value=first_s, most=MOST_PAGE_S, form=SECONDS),
                Goal(name=f"{run}, Start to image", value=image_s, most=MOST_IMAGE_S, form=SECONDS),
                Goal(name=f"{run}, server's processor time to first page", value=first_work_s, form=SECONDS),
                Goal(name=f"{run}, server's processor time, Start to image", value=image_work_s, form=SECONDS),
            ]
        with tempfile.TemporaryDirectory(prefix="tsis-console-start-") as folder:
            acts = counted(Path(folder), browser)
    figures.append(Goal(name="clicks from first page to report", value=acts["click"], form=COUNT))
    figures.append(Goal(name="keys from first page to report", value=acts["keydown"], form=COUNT))
    rows = (item.row for item in figures)
    bench.table("Start of the console, and one examination", ("what", "is", "wanted"), rows)
    return bench.end(figures)


if __name__ == "__main__":
    sys.exit(main())

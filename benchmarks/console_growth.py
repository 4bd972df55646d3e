"""What a console's server holds after a day of use: memory, descriptors, threads.

    python -m benchmarks.console_growth [--hours 8] [--speed 60] [--markdown]

A busy laboratory's day, `HOUR` over and over in another order each time, with the pauses in between left out as far as
``--speed`` says: 60 makes eight hours of events in eight minutes, or in as long as they take. A tablet shows the live
image all day. Snapshots, sequences, settings and estimates are asked for by calls as scripts make them, pages are
opened and closed in Chromium, and live views join and leave. Frames come at the camera's rate and are not compressed:
what a day of frames does to memory is measured by ``benchmarks.acquisition``. Before the day `WARM_UP` loads what is
loaded once, and makes as much room as the largest target needs.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.goals import Goal, missed_goals
from benchmarks.tables import show
from tests.console.api.script import Script
from tests.console.browser import chromium
from tests.console.operator import tab
from tests.console.running import running_console
from websockets.sync.client import connect

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.console.pages import PAGES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from playwright.sync_api import Browser
    from tests.console.running import RunningConsole

HOUR = {  # how often in an hour
    "snapshot": 30,
    "setting": 30,
    "live view": 12,
    "pages": 6,
    "sequence": 3,
    "estimate": 4,
    "report": 2,
    "camera stopped and started": 1,
    "looked at by a script": 200,
}
WARM_UP = {"estimate": 3, "report": 6, "pages": 4, "live view": 4, "sequence": 2, "camera stopped and started": 2}
LARGEST = 16  # presses of a target of the warm-up
FEW = 7  # looks at memory at each end of the day, of which the median counts
PATIENCE_S = 120.0
LOOKS_AN_HOUR = 12
MOST_GROWTH = {"resident_mb": 20.0, "descriptors": 10.0, "threads": 10.0}  # in a day


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """What the server holds."""

    resident_mb: float
    descriptors: int
    threads: int


def held(process_id: int) -> Held:
    """By the account of the system."""
    place = Path(f"/proc/{process_id}")
    pages = int((place / "statm").read_text().split()[1])
    return Held(
        resident_mb=pages * os.sysconf("SC_PAGE_SIZE") / 1e6,
        descriptors=len(list((place / "fd").iterdir())),
        threads=len(list((place / "task").iterdir())),
    )


class Laboratory:
    """Who uses the console, and how."""

    def __init__(self, console: RunningConsole, browser: Browser) -> None:
        self.console, self.browser = console, browser
        self.script = Script(console)
        self.script.ready()
        self.rng = np.random.default_rng(1)
        self.target = 0
        self.events: Mapping[str, Callable[[], object]] = {
            "snapshot": self.snapshot,
            "setting": self.setting,
            "live view": self.live_view,
            "pages": self.pages,
            "sequence": self.sequence,
            "estimate": self.estimate,
            "report": self.report,
            "camera stopped and started": self.restart,
            "looked at by a script": lambda: self.script.call("GET", "/state"),
        }
        self.next_target()

    def next_target(self) -> None:
        """A new target with a press on it and one on plain tissue."""
        self.target += 1
        self.script.call("PUT", "/target", json={"number": self.target})
        for role in ("plain", "target"):
            self.script.call("PUT", "/press", json={"role": role})
            self.script.call("POST", "/snapshot", 201)

    def warm_up(self) -> None:
        """Everything, with targets as large as they come."""
        for name, times in WARM_UP.items():
            for _ in range(times):
                if name == "estimate":
                    for _ in range(LARGEST):
                        self.snapshot()
                self.events[name]()

    def snapshot(self) -> None:
        """One more press of the target."""
        self.script.call("POST", "/snapshot", 201)

    def setting(self) -> None:
        """The gain up and back."""
        self.script.call("PATCH", "/camera/settings", json={"values": {"gain": float(self.rng.integers(3))}})
        self.script.call("PATCH", "/camera/settings", json={"values": {"gain": 0.0}})

    def live_view(self) -> None:
        """Raw pixels half of the time, pictures else, for two seconds."""
        address = self.console.address.replace("http", "ws") + self.rng.choice(["/live", "/live?jpeg=85"])
        with connect(address, additional_headers=self.console.key, max_size=None) as viewer:
            frames = 0
            while frames < 60:
                frames += isinstance(viewer.recv(PATIENCE_S), bytes)
                viewer.send("ok")

    def pages(self) -> None:
        """Every page in a browser of its own, with the relief on the first."""
        with tab(self.browser, self.console) as page:
            page.get_by_role("switch", name="3-D").click()
            page.locator("figure.surface").wait_for()
            for address in PAGES:
                if "{" not in address:
                    page.goto(self.console.address + address)
                    page.locator("main .panel").first.wait_for()
            page.goto(f"{self.console.address}/records/{self.target}")
            page.locator("main .panel").first.wait_for()

    def sequence(self) -> None:
        """Two seconds of frames."""
        self.script.done(self.script.call("POST", "/sequence", 202, json={"frames": 60}))

    def estimate(self) -> None:
        """What the target holds, then the next target."""
        self.script.done(self.script.call("POST", f"/targets/{self.target}/estimate", 202, json={"kind": "inclusion"}))
        self.next_target()

    def report(self) -> None:
        """Of the target before."""
        if self.target > 1:
            self.script.call("GET", f"/targets/{self.target - 1}/report.html")

    def restart(self) -> None:
        """As when it is unplugged for a while."""
        self.script.call("POST", "/camera/stop")
        self.script.call("POST", "/camera/start")


def day(laboratory: Laboratory, hours: float, speed: float) -> tuple[list[Held], Counter[str], float]:
    """What was held from look to look, how often what was done, and how long it took, s."""
    done: Counter[str] = Counter()
    looks: list[Held] = []
    begun = time.monotonic()
    for hour in range(int(np.ceil(hours))):
        share = min(1.0, hours - hour)
        order = [name for name, times in HOUR.items() for _ in range(round(times * share))]
        laboratory.rng.shuffle(order)
        every = max(1, len(order) // max(1, round(LOOKS_AN_HOUR * share)))
        for number, name in enumerate(order, start=1):
            due_s = begun + 3600.0 / speed * (hour + share * number / len(order))
            laboratory.events[name]()
            done[name] += 1
            if number % every == 0:
                looks.append(held(laboratory.console.process.pid))
            time.sleep(max(0.0, due_s - time.monotonic()))
    return looks, done, time.monotonic() - begun


def main() -> int:
    """Use it for a day and print; the exit code is 1 where it grows by more than is wanted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=8.0, help="of use")
    parser.add_argument("--speed", type=float, default=60.0, help="how much shorter pauses are")
    parser.add_argument("--markdown", action="store_true", help="print the table as Markdown")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, running_console(Path(folder)) as console, chromium() as browser:
        with tab(browser, console) as tablet:
            laboratory = Laboratory(console, browser)
            tablet.get_by_text("frames/s shown").wait_for()
            laboratory.warm_up()
            looks, done, took_s = day(laboratory, arguments.hours, arguments.speed)
        log = (Path(folder) / "console.log").read_text()
    rows, growths = [], []
    for name, unit in (("resident_mb", "MB"), ("descriptors", ""), ("threads", "")):
        series = [float(getattr(look, name)) for look in looks]
        before, after = statistics.median(series[:FEW]), statistics.median(series[-FEW:])
        what = f"{name.replace('_mb', ' memory')} {unit}".strip()
        growth = Goal(name=f"growth of {what}", value=after - before, most=MOST_GROWTH[name], form="{:+.1f}")
        rows.append((what, f"{before:.1f}", f"{after:.1f}", growth.shown, growth.goal))
        growths.append(growth)
    print("resident memory, MB: " + " ".join(f"{look.resident_mb:.0f}" for look in looks))
    print(f"{arguments.hours:g} hours of use in {took_s / 60:.1f} minutes: {dict(done)}")
    print(f"lines in the server's log: {len(log.splitlines())}")
    title = "held by the server at the beginning of the day and at its end"
    show(title, ("what", "before", "after", "growth", "wanted"), rows, markdown=arguments.markdown)
    print(RESEARCH_USE_ONLY)
    return missed_goals(growths)


if __name__ == "__main__":
    sys.exit(main())

"""What a console's server holds after hours of use: memory, descriptors, threads.

A busy laboratory's day, `THIRD` over and over in another order each time, without the pauses in between. A tablet shows
the live image all day. Snapshots, sequences, settings and estimates are asked for by calls as scripts make them, pages
are opened and closed in Chromium, and live views join and leave. Frames are not compressed: what a day of frames does
to memory is tested in ``tests/instrument/test_acquisition.py``. Before the day `WARM_UP` loads what is loaded
once, and makes as much room as the largest target needs.
"""

from __future__ import annotations

import os
import statistics
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.console.api.script import Script
from tests.console.browser import chromium
from tests.console.operator import tab
from tests.console.running import running_console
from tests.endurance import scaled
from websockets.sync.client import connect

from tsis.console.pages import PAGES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from playwright.sync_api import Browser
    from tests.console.running import RunningConsole

THIRD = {  # how often in twenty minutes
    "snapshot": 10,
    "setting": 10,
    "live view": 4,
    "pages": 2,
    "sequence": 1,
    "estimate": 2,
    "report": 1,
    "camera stopped and started": 1,
    "looked at by a script": 70,
}
WARM_UP = {"estimate": 3, "report": 6, "pages": 4, "live view": 4, "sequence": 2, "camera stopped and started": 2}
LARGEST = 16  # presses of a target of the warm-up
FEW = 7  # looks at memory at each end of the day, of which the median counts
PATIENCE_S = 120.0
LOOKS = 20
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


def day(laboratory: Laboratory, thirds: int) -> list[Held]:
    """What was held from look to look."""
    looks: list[Held] = []
    for _ in range(thirds):
        order = [name for name, times in THIRD.items() for _ in range(times)]
        laboratory.rng.shuffle(order)
        every = max(1, len(order) // LOOKS)
        for number, name in enumerate(order, start=1):
            laboratory.events[name]()
            if number % every == 0:
                looks.append(held(laboratory.console.process.pid))
    return looks


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
def test_use_leaves_memory_descriptors_and_threads_as_they_were(tmp_path: Path) -> None:
    with running_console(tmp_path) as console, chromium() as browser, tab(browser, console) as tablet:
        laboratory = Laboratory(console, browser)
        tablet.get_by_text("frames/s shown").wait_for()
        laboratory.warm_up()
        looks = day(laboratory, scaled(1))
        laboratory.script.close()
    for name, most in MOST_GROWTH.items():
        series = [float(getattr(look, name)) for look in looks]
        before, after = statistics.median(series[:FEW]), statistics.median(series[-FEW:])
        assert after - before < most, (name, series)

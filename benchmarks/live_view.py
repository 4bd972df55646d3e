"""The console's live view in a browser: frames shown, their age, the server's processor time, the relief beside it.

    python -m benchmarks.live_view [--seconds 20] [--camera virtual|aravis]

It starts the console as people start it and opens its page in Chromium without a window or a graphics processor, at
1280 x 800. ``virtual`` is the virtual probe, whose frames a process of the console's exposes; ``aravis`` is the
virtual probe served as a GigE Vision camera, in a network of its own (needs root, ``unshare`` and ``ip``): then the
console does what it does with hardware. Other ways to show the same frames are measured in the same run with the
virtual probe: NiceGUI's picture whose address changes, and MJPEG; and three.js for the relief.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.request import urlopen

from benchmarks.harness import Bench, Choice, Goal
from benchmarks.live.processor import CoreShare
from benchmarks.live.shown import shown_in
from tests.console.browser import chromium
from tests.console.running import running_console

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole

SERIAL = "LIVE"
APART = "TSIS_BENCHMARK_APART"  # set inside the network of its own
OTHERS = ("interactive_image", "mjpeg")
SETTLE_S = 3.0
SERVED = "Serving"  # with which the line begins that tsis serve prints once its camera answers
PATIENCE_S = 120.0  # until it does
OPENINGS = 5
LEAST_FRAMES, LEAST_FRAMES_BESIDE, LEAST_RELIEFS = 30.0, 25.0, 10.0  # a second; the camera gives 30
MOST_AGE_MS, MOST_OPENING_S = 60.0, 2.0
MOST_CORE_PERCENT = 15.0
AGE, CORE, SECONDS = "{:.1f} ms", "{:.1f} % of a core", "{:.2f} s"
DRAWINGS = 100
PAINTERS = Path(__file__).parent / "live" / "painters.js"


def of_the_console(camera: str, seconds: float, browser: Browser) -> Iterator[Goal]:
    """Each number of the console."""
    options = () if camera == "virtual" else ("--camera", f"aravis:tsis-VirtualProbe-{SERIAL}")
    with tempfile.TemporaryDirectory() as folder, running_console(Path(folder), *options) as console:
        server = console.process.pid
        page = opened(console, browser)
        page.get_by_role("button", name="Release the camera").wait_for()
        page.get_by_role("button", name="Start", exact=True).click()
        page.get_by_text("frames/s shown").wait_for(timeout=30000)
        time.sleep(SETTLE_S)
        size = page.evaluate("() => (({ width, height }) => [width, height])(document.querySelector('.live canvas'))")
        yield Goal(name="frames, width", value=size[0], form="{:.0f} pixels")
        yield Goal(name="frames, height", value=size[1], form="{:.0f} pixels")
        work = CoreShare(server)
        shown = shown_in(page, seconds)
        watched = 100.0 * work.so_far()
        least = LEAST_FRAMES - 1.0 / seconds  # one frame may fall on the edge of the measured time
        yield Goal(name="frames shown a second", value=shown.frames_per_s, least=least, form="{:.2f}")
        yield Goal(name="age when drawn, median", value=shown.age_p50_ms, form=AGE)
        yield Goal(name="age when drawn, 95th percentile", value=shown.age_p95_ms, most=MOST_AGE_MS, form=AGE)
        yield from of_the_relief(page, seconds)
        page.context.close()
        time.sleep(SETTLE_S)
        alone = 100.0 * CoreShare(server).over(seconds)
        yield Goal(name="server with one viewer", value=watched, most=MOST_CORE_PERCENT, form=CORE)
        yield Goal(name="server without viewers: camera, judging", value=alone, form=CORE)
        yield Goal(name="what the viewer costs", value=watched - alone, most=MOST_CORE_PERCENT, form=CORE)
        opening = sorted(opening_s(console, browser) for _ in range(OPENINGS))
        median = opening[OPENINGS // 2]
        yield Goal(name="page can be used after, median", value=median, most=MOST_OPENING_S, form=SECONDS)
        yield Goal(name="page can be used after, longest", value=opening[-1], form=SECONDS)


def of_the_relief(page: Page, seconds: float) -> Iterator[Goal]:
    """The relief beside the live image."""
    page.get_by_role("switch", name="3-D").click()
    page.locator("figure.surface").wait_for()
    time.sleep(SETTLE_S)
    both = shown_in(page, seconds)
    yield Goal(name="with the relief: reliefs a second", value=both.surface_per_s, least=LEAST_RELIEFS)
    yield Goal(name="with the relief: frames a second", value=both.frames_per_s, least=LEAST_FRAMES_BESIDE)
    yield Goal(name="with the relief: age, 95th percentile", value=both.age_p95_ms, form=AGE)
    own = page.evaluate(PAINTERS.read_text(encoding="utf-8"), ["own", DRAWINGS])
    for name, value in zip(("median", "95th percentile"), own, strict=True):
        yield Goal(name=f"a relief painted, {name}", value=value, form=AGE)


def opened(console: RunningConsole, browser: Browser) -> Page:
    """The console's page in a browser that has never seen it."""
    page = browser.new_context(viewport={"width": 1280, "height": 800}).new_page()
    page.goto(console.entrance)
    return page


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


def of_others(seconds: float, browser: Browser) -> Iterator[Goal]:
    """The same frames and the same relief shown in other ways."""
    for way in OTHERS:
        with program("benchmarks.live.other_ways", way) as (address, process):
            sent(address)  # it answers once the camera was started
            time.sleep(2 * SETTLE_S)
            alone = CoreShare(process.pid).over(seconds)
            page = browser.new_context(viewport={"width": 1280, "height": 800}).new_page()
            page.goto(address, wait_until="commit")
            time.sleep(SETTLE_S)
            before, begun = sent(address), time.monotonic()
            watched = CoreShare(process.pid).over(seconds)
            rate = (sent(address) - before) / (time.monotonic() - begun)
            page.context.close()
        yield Goal(name=f"{way}: frames sent a second", value=rate)
        yield Goal(name=f"{way}: what the viewer costs", value=100.0 * (watched - alone), form=CORE)
    with program("benchmarks.live.other_ways", "three") as (address, _):
        page = browser.new_page()
        page.goto(address)
        page.locator("canvas").first.wait_for()
        took = page.evaluate(PAINTERS.read_text(encoding="utf-8"), ["three", DRAWINGS])
        page.close()
    for name, value in zip(("median", "95th percentile"), took, strict=True):
        yield Goal(name=f"three.js: a relief painted, {name}", value=value, form=AGE)


def sent(address: str) -> int:
    """How many frames a program of `other_ways` has sent."""
    with urlopen(f"{address}sent") as answer:
        return int(answer.read())


@contextmanager
def program(module: str, *arguments: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A program of this repository that prints its address first; ended with the block."""
    command = [sys.executable, "-m", module, *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip(), process
    finally:
        process.kill()
        process.wait()


@contextmanager
def served_camera() -> Iterator[None]:
    """The virtual probe as a camera on the network."""
    command = [sys.executable, "-c", "from tsis.cli import main; main()", "serve", "--serial", SERIAL]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    late = threading.Timer(PATIENCE_S, process.kill)
    late.start()
    try:
        said: list[str] = []
        while not (said and said[-1].startswith(SERVED)):
            said.append(process.stdout.readline())
            if not said[-1]:
                raise RuntimeError("the camera must be served; got: " + " ".join("".join(said).split()))
        late.cancel()
        yield
    finally:
        late.cancel()
        process.kill()
        process.communicate()


def apart() -> int:
    """Run this again in a network of its own, where no other camera answers."""
    inside = f'ip link set lo up && exec {sys.executable} -m benchmarks.live_view "$@"'
    command = ["unshare", "--net", "sh", "-c", inside, "sh", *sys.argv[1:]]
    return subprocess.run(command, env={**os.environ, APART: "1"}, check=False).returncode


def main() -> int:
    """Measure and print; the exit code is 1 where a number is not as wanted."""
    bench = Bench(__doc__, seconds=20.0, camera=Choice(("virtual", "aravis"), "virtual"))
    if bench.camera == "aravis" and APART not in os.environ:
        return apart()
    with nullcontext() if bench.camera == "virtual" else served_camera(), chromium() as browser:
        found = list(of_the_console(bench.camera, bench.seconds, browser))
        if bench.camera == "virtual":
            found += of_others(bench.seconds, browser)
        title = f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; Chromium {browser.version}"
    bench.table(title, ("what", "measured", "wanted"), [each.row for each in found])
    return bench.end(found)


if __name__ == "__main__":
    sys.exit(main())

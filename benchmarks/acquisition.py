"""Acquisition at length: frames lost, time of the processor, unplugged cameras, memory over a day.

    python -m benchmarks.acquisition --minutes 10 --reconnects 50 --hours 24

The camera that is read for minutes is the virtual probe, served as a GigE Vision camera by a process of its own over
the loopback interface, 768 x 492 pixels of 8 bits, 30 frames a second. Beside the acquisition its peer is timed, which
is nothing but a loop over the camera's frames: what the ring, the counting and the watch add to it is the ratio. The
camera that is unplugged is Aravis' own fake one, 512 x 512 at 25 a second, whose process is killed.

A day is simulated: the camera's frames and the clock advance together as fast as they can, with a loss every half hour.
"""

from __future__ import annotations

import argparse
import gc
import os
import shutil
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import CameraError
from tsis.instrument import Frame, Mode
from tsis.instrument.acquisition import Acquisition
from tsis.instrument.drivers.aravis import AravisCamera

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.instrument import Setting

PROGRAM = "arv-fake-gv-camera-0.8"
SERIAL = "SOAK"
SERVED, KILLED = f"tsis-VirtualProbe-{SERIAL}", f"Aravis-Fake-{SERIAL}"
ATTEMPTS = 150
FRAMES_PER_S = 30.0
LOSS_EVERY_S = 1800.0
BACK_WITHIN_S = 30.0


@contextmanager
def served(command: list[str]) -> Iterator[subprocess.Popen[bytes]]:
    """A camera in a process of its own, which is ended with the block."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def _starts(acquisition: Acquisition) -> bool:
    try:
        acquisition.start()
    except CameraError:
        return False
    return True


def until(happened: Callable[[], bool], limit_s: float) -> float | None:
    """Seconds until it happened; None when it did not within the limit."""
    begun = time.monotonic()
    while not happened():
        if time.monotonic() - begun > limit_s:
            return None
        time.sleep(0.002)
    return time.monotonic() - begun


def soak(minutes: float) -> None:
    """Read for so long and count."""
    with served([sys.executable, "-c", "from tsis.cli import main; main()", "serve", "--serial", SERIAL]):
        bare = _bare(min(60.0, 6.0 * minutes))
        acquisition = _connected(SERVED)
        begun, work = time.monotonic(), time.process_time()
        time.sleep(60 * minutes)
        seconds, work = time.monotonic() - begun, time.process_time() - work
        account, mode = acquisition.account(), acquisition.mode
        acquisition.stop()
    core = work / seconds
    assert mode is not None
    rate = account.received / seconds
    print(f"{seconds / 60:.1f} minutes of {mode.label}: {account.received} frames, {rate:.2f} a second")
    print(f"lost on the way {account.missed}, interruptions {len(account.interruptions)}")
    print(f"processor: {core:.2%} of a core; a bare loop over the frames {bare:.2%}; ratio {core / bare:.2f}")


def _connected(identity: str) -> Acquisition:
    """An acquisition that streams, as soon as the camera answers."""
    for _ in range(ATTEMPTS):
        acquisition = Acquisition(partial(AravisCamera, identity))
        if _starts(acquisition) and acquisition.ring.wait(0, BACK_WITHIN_S):
            return acquisition
        time.sleep(0.2)
    raise CameraError(f"the camera {identity} must answer on 127.0.0.1; is another GigE Vision camera served there?")


def _bare(seconds: float) -> float:
    """Share of a core that a bare loop over the frames takes."""
    _connected(SERVED).stop()  # the camera answers
    time.sleep(2.0)  # and lets go of its last client
    one = AravisCamera(SERVED)
    one.open()
    one.start()
    begun, work = time.monotonic(), time.process_time()
    for _ in one.frames():
        if time.monotonic() - begun >= seconds:
            break
    share = (time.process_time() - work) / (time.monotonic() - begun)
    one.stop()
    return share


def reconnects(times: int) -> None:
    """Kill the camera again and again while it streams."""
    seen: list[float | None] = []
    back: list[float | None] = []
    kept = 0
    acquisition: Acquisition | None = None
    for number in range(times + 1):  # the last time to see that it comes back
        with served([PROGRAM, "-i", "127.0.0.1", "-s", SERIAL]) as process:
            if acquisition is None:
                acquisition = _connected(KILLED)
            else:
                place, began = acquisition.ring.end, time.monotonic()
                got = acquisition.ring.wait(place, BACK_WITHIN_S)
                back.append(time.monotonic() - began if got else None)
            if number == times:
                break
            time.sleep(1.0 + 0.013 * number)  # killed at another moment of the stream each time
            before = acquisition.account().received
            process.kill()
            process.wait()
            seen.append(until(partial(_is_lost, acquisition), 5.0))
            kept += acquisition.account().received >= before
    assert acquisition is not None
    account = acquisition.account()
    acquisition.stop()
    noticed_s = [one for one in seen if one is not None]
    back_s = [one for one in back if one is not None]
    print(f"unplugged {times} times: noticed {len(noticed_s)}, at the latest after {max(noticed_s):.2f} s")
    print(f"reconnected {len(back_s)} of {len(back)}, at the latest {max(back_s):.2f} s after the camera was back")
    print(f"frames kept through every loss: {kept == times}; threads left {threading.active_count() - 1}")
    print(f"connections counted {account.connections}, interruptions {len(account.interruptions)}")


def _is_lost(acquisition: Acquisition) -> bool:
    return acquisition.lost


class SimulatedDay:
    """A camera whose clock stands still between frames, and which is lost every half hour."""

    def __init__(self) -> None:
        self.now_s, self.lost, self.frames_made = 0.0, False, 0
        rng = np.random.default_rng(1)
        self._pixels = [rng.integers(0, 256, (492, 768), dtype=np.uint8) for _ in range(4)]
        self._running = threading.Event()

    name = "simulated day"

    def open(self) -> None:
        """Nothing to take hold of."""
        self.lost = False

    def modes(self) -> tuple[Mode, ...]:
        """The one mode."""
        return (Mode(width_px=768, height_px=492, frames_per_s=FRAMES_PER_S),)

    def settings(self) -> tuple[Setting, ...]:
        """None."""
        return ()

    def adjust(self, name: str, value: float) -> None:
        """Refuse."""
        raise CameraError(f"{name} cannot be set to {value:g}")

    def start(self, mode: Mode | None = None) -> None:
        """Begin."""
        self._running.set()

    def frames(self) -> Iterator[Frame]:
        """Half an hour of frames, then a loss."""
        sequence, ends_s = 0, self.now_s + LOSS_EVERY_S
        while self._running.is_set():
            self.now_s += 1 / FRAMES_PER_S
            if self.now_s > ends_s:
                self.lost = True
                self.now_s += 1.0
                raise CameraError("the simulated camera was unplugged")
            self.frames_made += 1
            yield Frame(pixels=self._pixels[sequence % 4], sequence=sequence, time_s=self.now_s)
            sequence += 1

    def stop(self) -> None:
        """End."""
        self._running.clear()


def day(hours: float) -> None:
    """Simulate so many hours and compare memory and descriptors after the first of twenty parts with the end."""
    source = SimulatedDay()
    acquisition = Acquisition(lambda: source, clock=lambda: source.now_s, retry_s=0.0)
    acquisition.start()
    marks = []
    for part in range(21):
        expected = 3600 * hours * part / 20
        until(partial(_reached, source, expected), 36000.0)
        gc.collect()
        marks.append((_resident_mb(), len(list(Path("/proc/self/fd").iterdir()))))
    account = acquisition.account()
    acquisition.stop()
    memory, descriptors = zip(*marks, strict=True)
    print(f"{hours:g} simulated hours: {account.received} frames, {account.connections} connections")
    growth = memory[-1] - memory[1]
    print(f"resident memory {memory[1]:.1f} MB after a twentieth, {memory[-1]:.1f} MB at the end: {growth:+.1f} MB")
    print(f"largest in between {max(memory[1:]):.1f} MB; open descriptors {descriptors[1]} and {descriptors[-1]}")


def _reached(source: SimulatedDay, time_s: float) -> bool:
    return source.now_s >= time_s


def _resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0, help="of real frames; 0 leaves it out")
    parser.add_argument("--reconnects", type=int, default=50, help="0 leaves them out")
    parser.add_argument("--hours", type=float, default=24.0, help="simulated; 0 leaves them out")
    arguments = parser.parse_args()
    fake = shutil.which(PROGRAM) is not None
    if not fake:
        print(f"{PROGRAM} is not installed (Debian: aravis-tools): no real frames")
    if fake and arguments.minutes > 0:
        soak(arguments.minutes)
    if fake and arguments.reconnects > 0:
        reconnects(arguments.reconnects)
    if arguments.hours > 0:
        day(arguments.hours)
    print("Research use only")


if __name__ == "__main__":
    main()

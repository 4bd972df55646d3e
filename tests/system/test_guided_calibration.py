"""The guided calibration as a person at a terminal meets it: a real camera on the loopback interface, a real port."""

from __future__ import annotations

import itertools
import os
import select
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING

import pytest
from tests.system.aravis_peer import LOOPBACK, fake_camera, loopback_camera_port
from tests.system.gauge_peer import GaugeInTerminal
from tests.waiting import HANGS_S

from tsis.calibration.session import SessionFolder, plan_steps

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(not hasattr(os, "openpty"), reason="this system has no pseudo-terminals"),
]
_pause = threading.Event()


class Guided:
    """``tsis calibrate`` in a terminal of its own."""

    def __init__(self, folder: Path, *options: str) -> None:
        self._master, slave = os.openpty()
        command = [sys.executable, "-c", "from tsis.cli import main; main()", "calibrate", *options]
        self.process = subprocess.Popen(command, cwd=folder, stdin=slave, stdout=slave, stderr=slave)
        os.close(slave)
        self.said = ""
        self._read = 0

    def hears(self, words: str) -> None:
        """Wait until it says these words, after those that were waited for before."""
        until = time.monotonic() + HANGS_S
        while words not in self.said[self._read :]:
            assert time.monotonic() < until, f"it never said {words!r} but: {self.said}"
            if not self._listen():
                break
        at = self.said.find(words, self._read)
        assert at >= 0, f"it ended before it said {words!r}: {self.said}"
        self._read = at + len(words)

    def answer(self, text: str = "") -> None:
        os.write(self._master, text.encode() + b"\n")

    def ends(self) -> int:
        while self._listen():
            pass
        code = self.process.wait(HANGS_S)
        os.close(self._master)
        return code

    def _listen(self) -> bool:
        ready, _, _ = select.select([self._master], [], [], HANGS_S)
        try:
            heard = os.read(self._master, 4096) if ready else b""
        except OSError:  # the other end has gone
            heard = b""
        self.said += heard.decode(errors="replace").replace("\r\n", "\n")
        return bool(heard)


@pytest.fixture(scope="module")
def camera() -> Iterator[subprocess.Popen[str]]:
    with loopback_camera_port(), fake_camera("GUIDED") as process:
        yield process


@pytest.fixture
def guide(tmp_path: Path) -> Iterator[Callable[..., Guided]]:
    begun: list[Guided] = []

    def begin(*options: str) -> Guided:
        camera = ("--camera", f"aravis:{LOOPBACK}", "--probe", "mine", "--session", "s", "--tip-mm", "2")
        begun.append(Guided(tmp_path, *camera, *options))
        return begun[-1]

    yield begin
    for each in begun:
        each.process.kill()
        each.process.wait()


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def happened(condition: Callable[[], bool]) -> None:
    until = time.monotonic() + HANGS_S
    while not condition():
        assert time.monotonic() < until
        _pause.wait(0.02)


@pytest.mark.usefixtures("camera")
def test_a_new_user_is_guided_killed_and_goes_on(guide: Callable[..., Guided], tmp_path: Path) -> None:
    first = guide()
    for step in ("dark", "untouched"):
        first.hears(f", {step}: ")
        first.hears("Enter when ready: ")
        first.answer()
        first.hears("16 frames")
    first.hears("flat-1: ")
    first.hears("s to leave it out: ")
    first.answer("s")
    first.hears("left out")
    first.process.kill()
    first.ends()
    session = SessionFolder(tmp_path / "s")
    before = files(session.path)
    assert {name.split("/")[0] for name in before} == {"session.json", "dark", "untouched"}

    second = guide()
    second.hears("Resuming the session in s with its settings.")
    second.hears("done before")
    second.hears("done before")
    for _ in range(3):
        second.hears("s to leave it out: ")
        second.answer("s")
    for step in ("board-untouched", "board"):
        second.hears(f", {step}: ")
        second.hears("Enter when ready: ")
        second.answer()
        second.hears("4 frames")
    second.hears("edge: ")
    second.hears("leave it out: ")
    second.answer("s")
    second.hears("Mount the tip of 2 mm radius")
    second.answer()
    for force in ("0", "0,5", "soft", "1.5", ""):
        second.hears("an empty line ends): ")
        second.answer(force)
        if force == "soft":
            second.hears("that is no number")
    second.hears("3 frames")
    assert second.ends() == 3
    assert "Error: step 'board': " in second.said.splitlines()[-1]  # the fake camera shows no dots
    assert "Traceback" not in second.said
    after = files(session.path)
    assert {name: after[name] for name in before} == before
    assert session.missing() == ()
    *_, loading = session.plan()
    assert [shot.force_n for shot in session.shots(loading)] == [0.0, 0.5, 1.5]


@pytest.mark.slow
@pytest.mark.usefixtures("camera")
def test_a_loading_by_gauge_is_whole_or_absent(guide: Callable[..., Guided], tmp_path: Path) -> None:
    session = SessionFolder(tmp_path / "s")

    def taken() -> int:
        return len(list(session.path.glob(".tip-2mm-1-*/frame-*.png")))

    gauge = GaugeInTerminal(lambda count: f"{count / 1000:+.3f} N\r\n".encode())
    first = guide("--gauge", gauge.port)
    for step in session_steps():
        first.hears(f", {step}: ")
        optional = step.startswith("flat") or step == "edge"
        first.hears("s to leave it out: " if optional else "Enter when ready: ")
        first.answer("s" if optional else "")
    first.hears("Enter when it is back at 0: ")
    happened(lambda: taken() >= 2)
    gauge.unplug()
    assert first.ends() == 1
    assert "Error: " in first.said.splitlines()[-1]
    assert "Traceback" not in first.said
    assert "Fatal" not in first.said
    assert session.missing() == ("tip-2mm-1",)
    assert taken() == 0

    gauge = GaugeInTerminal(lambda count: f"{count / 1000:+.3f} N\r\n".encode())
    second = guide("--gauge", gauge.port)
    for _ in range(4):  # what was left out is asked for again
        second.hears("s to leave it out: ")
        second.answer("s")
    second.hears("not yet touching")
    second.answer()
    second.hears("Enter when it is back at 0: ")
    happened(lambda: taken() >= 3)
    second.answer()
    assert second.ends() == 3
    gauge.unplug()
    assert "Error: step 'board': " in second.said
    *_, loading = session.plan()
    shots = session.shots(loading)
    assert len(shots) >= 3
    forces = [shot.force_n or 0.0 for shot in shots]
    assert forces == sorted(set(forces))  # the gauge counts up
    assert forces[0] > 0
    times = [shot.time_s or 0.0 for shot in shots]
    assert all(later - earlier >= 0.5 for earlier, later in itertools.pairwise(times))


def session_steps() -> tuple[str, ...]:
    return tuple(step.name for step in plan_steps((2.0,)))


LOST_IN_MID_LOADING = """
import sys
from rich.console import Console
from tsis.calibration.session import plan_steps
from tsis.cli.calibrate import Operator

class Bench:
    def loading(self, over):
        assert not over()
        raise SystemExit("Error: the gauge was lost")

next(iter(Operator(Bench(), Console(stderr=True), has_gauge=True).take(plan_steps()[-1])))
"""


def test_the_program_ends_while_it_waits_for_enter_on_a_pipe() -> None:
    command = [sys.executable, "-c", LOST_IN_MID_LOADING]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        process.stdin.write(b"\n")
        process.stdin.flush()
        said = process.stderr.read().decode()  # until it ends, the pipe to it still open
        assert process.wait(HANGS_S) == 1
    assert "Error: the gauge was lost" in said
    assert "Fatal" not in said

"""Work in a process of its own, what becomes of it when that process ends, and the memory of a server."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.waiting import HANGS_S, until

from tsis.console.worker import WorkerProcess, collecting_garbage, give_memory_back, share_memory_among_threads
from tsis.errors import ControlError, InputError, UnknownNameError
from tsis.model.require import require_integer, require_one_of

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def apart() -> Iterator[WorkerProcess]:
    created = WorkerProcess(most=6)
    yield created
    created.close()


@pytest.mark.system
def test_work_is_done_elsewhere_and_its_errors_come_back(
    apart: WorkerProcess, caplog: pytest.LogCaptureFixture
) -> None:
    there = apart.call(os.getpid)
    assert there != os.getpid()
    assert apart.call(print, "what a library says") is None
    with pytest.raises(UnknownNameError, match="did you mean 'pdf'"):
        apart.call(require_one_of, "form", "pfd", ("html", "pdf"))
    with pytest.raises(RuntimeError, match="failed"):
        apart.call(int, "three")
    assert "invalid literal" in caplog.text
    assert apart.call(pow, 2, exp=10) == 1024
    assert apart.call(os.getpid) == there  # the sixth and last
    assert apart.call(os.getpid) != there


@pytest.mark.system
def test_a_process_that_was_killed_is_replaced(apart: WorkerProcess) -> None:
    there = apart.call(os.getpid)
    with pytest.raises(RuntimeError, match="ended before its work was done"):
        apart.call(os.kill, there, signal.SIGTERM)
    assert apart.call(os.getpid) != there


def loaded(module: str) -> bool:
    return module in sys.modules


@pytest.mark.system
def test_a_process_that_was_begun_has_loaded_its_module() -> None:
    with closing(WorkerProcess(nice=0, loads="tsis.optics")) as begun, closing(WorkerProcess()) as plain:
        begun.begin()
        assert begun.call(loaded, "tsis.optics")
        assert not plain.call(loaded, "tsis.optics")


def touch_and_sleep(path: Path) -> None:
    path.touch()
    time.sleep(3600)


@pytest.mark.system
def test_nothing_is_waited_for_when_the_console_ends(apart: WorkerProcess, tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    assert apart.call(require_integer, "port", 1, 0, 2) == 1
    reported: list[BaseException] = []

    def wait() -> None:
        try:
            apart.call(touch_and_sleep, begun)
        except ControlError as error:
            reported.append(error)

    waits = threading.Thread(target=wait)
    waits.start()
    while not begun.exists():
        threading.Event().wait(0.01)
    apart.close()
    waits.join(HANGS_S)
    assert len(reported) == 1
    with pytest.raises(ControlError, match="shutting down"):
        apart.call(os.getpid)


@pytest.mark.system
def test_what_cannot_be_sent_is_said_at_once(apart: WorkerProcess) -> None:
    with pytest.raises((AttributeError, TypeError)):
        apart.call(lambda: 1)
    with pytest.raises(InputError):
        apart.call(require_integer, "port", 3, 0, 2)


CONSOLE = """
import os, sys, time
from tsis.console.worker import WorkerProcess

if __name__ == "__main__":
    print(WorkerProcess().call(os.getpid), flush=True)
    time.sleep(3600)
"""


@pytest.mark.system
def test_the_process_ends_with_a_console_that_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "console.py"
    script.write_text(CONSOLE, encoding="utf-8")
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as console:
        assert console.stdout is not None
        there = int(console.stdout.readline())
        console.kill()
    with pytest.raises(ProcessLookupError):  # noqa: PT012 - until it has ended
        while True:
            os.kill(there, 0)
            threading.Event().wait(0.01)


class Knot:
    """Two such things that hold each other are garbage that only a search finds."""

    other: Knot


def test_what_holds_each_other_is_found_while_nothing_else_is_made() -> None:
    gc.disable()
    try:
        with collecting_garbage(every_s=0.01):
            one, two = Knot(), Knot()
            one.other, two.other = two, one
            left = weakref.ref(one)
            del one, two
            until(lambda: left() is None)
            assert gc.get_freeze_count() > 0
        assert gc.get_freeze_count() == 0
        assert not [thread for thread in threading.enumerate() if thread.name == "garbage"]
    finally:
        gc.enable()


def test_memory_is_shared_wherever_that_can_be_asked_for() -> None:
    share_memory_among_threads()
    share_memory_among_threads()  # as often as one likes


@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
def test_memory_that_was_freed_between_pieces_in_use_goes_back() -> None:
    def resident_mib() -> float:
        resident = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return resident * os.sysconf("SC_PAGE_SIZE") / 2**20

    pieces = [bytearray(1500) for _ in range(60_000)]
    used = pieces[::100]  # which keep the C library from giving the rest back by itself
    full = resident_mib()
    del pieces
    give_memory_back()
    assert resident_mib() < full - 50
    assert len(used) == 600

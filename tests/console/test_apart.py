"""Work in a process of its own: what comes back, and what becomes of it when that process ends."""

from __future__ import annotations

import os
import signal
import threading
import time
from typing import TYPE_CHECKING

import pytest
from tests.waiting import HANGS_S

from tsis.console._worker import WorkerProcess
from tsis.errors import ControlError, InputError, UnknownNameError
from tsis.model import require_integer, require_one_of

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.system


@pytest.fixture
def apart() -> Iterator[WorkerProcess]:
    made = WorkerProcess(most=6)
    yield made
    made.close()


def test_work_is_done_elsewhere_and_its_errors_come_back(
    apart: WorkerProcess, caplog: pytest.LogCaptureFixture
) -> None:
    there = apart.ask(os.getpid)
    assert there != os.getpid()
    assert apart.ask(print, "what a library says") is None
    with pytest.raises(UnknownNameError, match="did you mean 'pdf'"):
        apart.ask(require_one_of, "form", "pfd", ("html", "pdf"))
    with pytest.raises(RuntimeError, match="failed"):
        apart.ask(int, "three")
    assert "invalid literal" in caplog.text
    assert apart.ask(pow, 2, exp=10) == 1024
    assert apart.ask(os.getpid) == there  # the sixth and last
    assert apart.ask(os.getpid) != there


def test_a_process_that_was_killed_is_replaced(apart: WorkerProcess) -> None:
    there = apart.ask(os.getpid)
    with pytest.raises(RuntimeError, match="ended before its work was done"):
        apart.ask(os.kill, there, signal.SIGTERM)
    assert apart.ask(os.getpid) != there


def test_nothing_is_waited_for_when_the_console_ends(apart: WorkerProcess) -> None:
    assert apart.ask(require_integer, "port", 1, 0, 2) == 1
    told: list[BaseException] = []

    def wait() -> None:
        try:
            apart.ask(time.sleep, 3600)
        except ControlError as error:
            told.append(error)

    waits = threading.Thread(target=wait)
    waits.start()
    while apart._done < 2:
        threading.Event().wait(0.01)
    apart.close()
    waits.join(HANGS_S)
    assert len(told) == 1
    with pytest.raises(ControlError, match="being ended"):
        apart.ask(os.getpid)


def test_what_cannot_be_sent_is_said_at_once(apart: WorkerProcess) -> None:
    with pytest.raises((AttributeError, TypeError)):
        apart.ask(lambda: 1)
    with pytest.raises(InputError):
        apart.ask(require_integer, "port", 3, 0, 2)

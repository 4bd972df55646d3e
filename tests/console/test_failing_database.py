"""A working console while its PostgreSQL is halted, killed, or has no connection left."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import psycopg
import pytest
from tests.console.api.script import Script
from tests.console.running import running_console
from tests.records import postgres_server

from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

    from tests.console.running import RunningConsole
    from tests.records.postgres_server import Server

PRESSES, HALTED_S = 3, 5.0
CONNECTIONS = "12"
REFUSED = 503  # the status of a refusal


@contextmanager
def halted(server: Server, seconds: float) -> Iterator[None]:
    """All processes of the server are stopped, and go on after so many seconds."""
    assert server.process is not None
    parent = server.process.pid
    children = Path(f"/proc/{parent}/task/{parent}/children").read_text(encoding="ascii").split()

    def tell(number: int) -> None:
        for process in (parent, *map(int, children)):
            with suppress(ProcessLookupError):
                os.kill(process, number)

    tell(signal.SIGSTOP)
    timer = threading.Timer(seconds, tell, (signal.SIGCONT,))
    timer.start()
    try:
        yield
    finally:
        timer.join()


@contextmanager
def killed(server: Server) -> Iterator[None]:
    """The server is killed, and started again after the block."""
    server.kill()
    try:
        yield
    finally:
        server.start()


@contextmanager
def crowded(server: Server) -> Iterator[None]:
    """Others hold all connections that are left."""
    with ExitStack() as others:
        with suppress(psycopg.OperationalError):
            while True:
                others.enter_context(server.connect())
        yield


@contextmanager
def asking(console: RunningConsole, times: list[float]) -> Iterator[None]:
    """Ask for the console's state meanwhile; seconds of each answer."""
    script, ended = Script(console), threading.Event()

    def ask() -> None:
        while not times or not ended.wait(0.1):
            began = time.perf_counter()
            script.call("GET", "/state")
            times.append(time.perf_counter() - began)

    thread = threading.Thread(target=ask)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        script.close()


def saved(script: Script, presses: int) -> tuple[int, int]:
    """Presses acknowledged, and refused in a sentence."""
    counts = {201: 0, REFUSED: 0}
    for _ in range(presses):
        answer = script.client.post("/snapshot")
        assert answer.status_code == 201 or "\n" not in answer.json()["error"]
        counts[answer.status_code] += 1
    return counts[201], counts[REFUSED]


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.skipif(bool(postgres_server.missing()), reason="PostgreSQL is not on this machine")
def test_a_failing_postgresql_costs_no_acknowledged_press(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = 0
    with ExitStack() as stack:
        server = stack.enter_context(postgres_server.server(max_connections=CONNECTIONS))
        database = server.new_database()
        monkeypatch.setenv("TSIS_RECORDS_DATABASE", database)
        console = stack.enter_context(running_console(tmp_path))
        script = Script(console)
        stack.callback(script.close)
        script.ready()
        script.call("PUT", "/target", json={"number": 1})
        states: dict[str, Callable[[], AbstractContextManager[object]]] = {
            "works": nullcontext,
            "is halted": lambda: halted(server, HALTED_S),
            "goes on": nullcontext,
            "is killed": lambda: killed(server),
            "is back": nullcontext,
            "has no connection left": lambda: crowded(server),
            "has some again": nullcontext,
        }
        for name, state in states.items():
            times: list[float] = []
            with asking(console, times), state():
                obeyed, refused = saved(script, PRESSES)
            kept += obeyed
            assert times, name
            assert refused == (PRESSES if name == "is killed" else 0), name
        with open_store(console.store, database=database, create=False) as store:
            assert len(store.presses(store.target(1))) >= kept
            assert verify_store(store).sound

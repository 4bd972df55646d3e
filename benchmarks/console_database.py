"""What a working console does while its PostgreSQL is halted, killed, or has no connection left.

    python -m benchmarks.console_database [--presses 3] [--seconds 15]

A console on a PostgreSQL of its own saves presses of the virtual probe over HTTP. Meanwhile the server is halted (all
its processes are stopped for some seconds), killed and started again, and other clients take all its connections.
Another script asks for the console's state ten times a second. The exit code is 1 where a call is neither obeyed nor
refused in one sentence, the state takes more than a second, or an acknowledged press is lost; 2 without PostgreSQL.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
import threading
import time
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import psycopg
from benchmarks.tables import show
from tests.console.api.script import Script
from tests.console.running import running_console
from tests.records import postgres_server

from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

    from tests.console.running import RunningConsole
    from tests.records.postgres_server import Server

LONGEST_S = 1.0
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


def saved(script: Script, presses: int) -> tuple[int, int, float]:
    """Presses acknowledged and refused in a sentence, and the longest call in seconds."""
    counts, longest = {201: 0, REFUSED: 0}, 0.0
    for _ in range(presses):
        began = time.perf_counter()
        answer = script.client.post("/snapshot")
        longest = max(longest, time.perf_counter() - began)
        assert answer.status_code == 201 or "\n" not in answer.json()["error"]
        counts[answer.status_code] += 1
    return counts[201], counts[REFUSED], longest


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--presses", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    if why := postgres_server.missing():
        print(why)
        return 2
    rows, wrong, kept = [], False, 0
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="tsis-database-")))
        server = stack.enter_context(postgres_server.server(max_connections=CONNECTIONS))
        database = os.environ["TSIS_RECORDS_DATABASE"] = server.new_database()
        console = stack.enter_context(running_console(folder))
        script = Script(console)
        stack.callback(script.close)
        script.ready()
        script.call("PUT", "/target", json={"number": 1})
        states: dict[str, Callable[[], AbstractContextManager[object]]] = {
            "works": nullcontext,
            f"is halted for {options.seconds:g} s": lambda: halted(server, options.seconds),
            "goes on": nullcontext,
            "is killed": lambda: killed(server),
            "is back": nullcontext,
            "has no connection left": lambda: crowded(server),
            "has some again": nullcontext,
        }
        for name, state in states.items():
            times: list[float] = []
            with asking(console, times), state():
                obeyed, refused, longest = saved(script, options.presses)
            kept += obeyed
            wrong |= max(times) > LONGEST_S
            rows.append((name, f"{obeyed}", f"{refused}", f"{longest:.2f} s", f"{1e3 * max(times):.0f} ms"))
        with open_store(console.store, database=database, create=False) as store:
            found = len(store.presses(store.target(1)))
            wrong |= found < kept or not verify_store(store).sound
    heads = ("the server", "presses acknowledged", "refused", "longest call", "longest answer of the state")
    show("A console whose PostgreSQL fails", heads, rows, markdown=options.markdown)
    print(f"{kept} presses acknowledged, {found} in the database")
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())

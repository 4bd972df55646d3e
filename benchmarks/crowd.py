"""How soon a console answers others while one address holds hundreds of silent connections.

    python -m benchmarks.crowd [--connections 600] [--requests 30]

A running console is asked for a page by a client with the key: alone, and beside so many connections that say nothing,
send half a line, or headers that never end. A new silent connection is opened whenever one is closed. The exit code is
1 where an answer is no page, or takes more than a second.
"""

from __future__ import annotations

import argparse
import socket
import sys
import tempfile
import threading
import time
from contextlib import ExitStack
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
from benchmarks.tables import show
from tests.console.running import RunningConsole, running_console

LONGEST_S = 1.0
BEGUN = {"nothing": b"", "half a line": b"GET / HT", "headers without end": b"GET / HTTP/1.1\r\nHost: x\r\nX: y\r\n"}


def asked(console: RunningConsole) -> tuple[int, float]:
    """Status and seconds of one request over a new connection."""
    place = urlsplit(console.address)
    began = time.perf_counter()
    connection = HTTPConnection(place.hostname or "", place.port, timeout=60)
    connection.request("GET", "/api/v1/state", headers=console.key)
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer.status, time.perf_counter() - began


class Crowd:
    """Silent connections that are opened again when they are closed."""

    def __init__(self, console: RunningConsole, count: int, begun: bytes) -> None:
        place = urlsplit(console.address)
        self._at, self._begun = (place.hostname or "", place.port or 0), begun
        self._ended = threading.Event()
        self._open = [self._connected() for _ in range(count)]
        self.again = 0
        self._thread = threading.Thread(target=self._renew)
        self._thread.start()

    def _connected(self) -> socket.socket:
        connection = socket.create_connection(self._at, timeout=60)
        connection.sendall(self._begun)
        connection.setblocking(False)
        return connection

    def _renew(self) -> None:
        while not self._ended.wait(0.01):
            for number, connection in enumerate(self._open):
                try:
                    gone = connection.recv(1) == b""
                except BlockingIOError:
                    gone = False
                except OSError:
                    gone = True
                if gone and not self._ended.is_set():
                    connection.close()
                    self._open[number] = self._connected()
                    self.again += 1

    def close(self) -> None:
        """End all."""
        self._ended.set()
        self._thread.join()
        for connection in self._open:
            connection.close()


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--connections", type=int, default=600)
    parser.add_argument("--requests", type=int, default=30)
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    rows, wrong = [], False
    with tempfile.TemporaryDirectory(prefix="tsis-crowd-") as folder, running_console(Path(folder)) as console:
        asked(console)
        for name, begun in {"nobody": None, **BEGUN}.items():
            with ExitStack() as stack:
                crowd = None if begun is None else Crowd(console, options.connections, begun)
                if crowd is not None:
                    stack.callback(crowd.close)
                found = [asked(console) for _ in range(options.requests)]
            times = 1e3 * np.array([seconds for _, seconds in found])
            good = sum(status == 200 for status, _ in found)
            wrong |= good < len(found) or bool(times.max() > 1e3 * LONGEST_S)
            again = "" if crowd is None else f"{crowd.again}"
            rows.append((name, f"{good} of {len(found)}", f"{np.median(times):.0f} ms", f"{times.max():.0f} ms", again))
    heads = (f"{options.connections} connections say", "answered", "median", "longest", "opened again")
    show("A console beside a crowd", heads, rows, markdown=options.markdown)
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())

"""A gauge behind a pseudo-terminal: a real serial port to the driver, the operating system and pyserial."""

from __future__ import annotations

import os
import select
import threading
from typing import TYPE_CHECKING

from tests.waiting import HANGS_S

if TYPE_CHECKING:
    from collections.abc import Callable


class GaugeInTerminal:
    """The gauge's end of the line: answers questions, or sends every ``every_s`` seconds on its own."""

    def __init__(self, say: Callable[[int], bytes | None], *, every_s: float | None = None) -> None:
        self._master, slave = os.openpty()
        self.port = os.ttyname(slave)
        self._slave: int | None = slave  # held open, so that the port may be closed and opened again
        self._say, self._every_s = say, every_s
        self.commands: list[bytes] = []
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        self._ended.set()
        self._thread.join(HANGS_S)
        if self._slave is not None:
            os.close(self._slave)
            os.close(self._master)
            self._slave = None

    def _run(self) -> None:
        count = 0
        while not self._ended.is_set():
            ready, _, _ = select.select([self._master], [], [], 0.02 if self._every_s is None else self._every_s)
            command = os.read(self._master, 64) if ready else b""
            if command:
                self.commands.append(command)
            if b"?" in command or (self._every_s is not None and not ready):
                words = self._say(count)
                count += 1
                if words:
                    os.write(self._master, words)

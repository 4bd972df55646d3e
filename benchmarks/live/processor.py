"""How much of a core a process takes."""

from __future__ import annotations

import os
import time
from pathlib import Path

USER, SYSTEM = 11, 12  # fields of /proc/PID/stat behind the program's name


class CoreShare:
    """Share of a core that a process takes, from now on."""

    def __init__(self, process_id: int) -> None:
        self._account = Path(f"/proc/{process_id}/stat")
        self._worked_s, self._begun_s = self.used_s(), time.monotonic()

    def so_far(self) -> float:
        """Share since it was made."""
        return (self.used_s() - self._worked_s) / (time.monotonic() - self._begun_s)

    def over(self, seconds: float) -> float:
        """Share after so many seconds more."""
        time.sleep(seconds)
        return self.so_far()

    def used_s(self) -> float:
        """Processor time since the process was started, s."""
        fields = self._account.read_text().rpartition(")")[2].split()
        return (int(fields[USER]) + int(fields[SYSTEM])) / os.sysconf("SC_CLK_TCK")

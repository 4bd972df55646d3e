"""What a measurement was made on: processor, cores, how busy, versions of everything, and when."""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """Where and when.

    Attributes
    ----------
    processor, cores
        As the system names it, and how many of them this process may use.
    load
        Mean number of processes that wanted a core in the last minute, at the beginning and at the end; NaN where the
        system does not tell.
    versions
        Of libraries by name; None for one that is not installed.
    date
        When it began, UTC.
    """

    processor: str
    cores: int
    load: tuple[float, float]
    versions: Mapping[str, str | None]
    date: datetime

    @classmethod
    def here(cls, versions: Mapping[str, str | None]) -> Machine:
        """The one that runs this, now."""
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        before = _load()
        return cls(
            processor=_processor(),
            cores=cores,
            load=(before, before),
            versions={"Python": platform.python_version(), **versions},
            date=datetime.now(UTC),
        )

    def afterwards(self) -> Machine:
        """The same, with the load at the end."""
        return replace(self, load=(self.load[0], _load()))

    def sentence(self) -> str:
        """All of it in words."""
        there = ", ".join(f"{name} {version}" for name, version in self.versions.items() if version)
        absent = ", ".join(name for name, version in self.versions.items() if not version)
        missing = f" Not installed: {absent}." if absent else ""
        return (
            f"{self.processor}, {self.cores} cores, load {self.load[0]:.1f} before and {self.load[1]:.1f} after, "
            f"{self.date:%d %B %Y}. {there}.{missing}"
        )

    def document(self) -> dict[str, Any]:
        """All of it as plain values."""
        return {
            "processor": self.processor,
            "cores": self.cores,
            "load": list(self.load),
            "versions": dict(self.versions),
            "date": self.date.isoformat(),
        }


def _load() -> float:
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")


def _processor() -> str:
    listed = Path("/proc/cpuinfo")
    if listed.is_file():
        for line in listed.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()

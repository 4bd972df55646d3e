"""What a process holds, before and after doing the same thing often."""

from __future__ import annotations

import gc
import logging
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable

_PROCESS = Path("/proc/self")
_PAGE_BYTES = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Growth:
    """How much more is held after than before."""

    resident_bytes: int
    descriptors: int
    threads: int


def growth_over(times: int, act: Callable[[], object], *, warm_up: int = 20) -> Growth:
    """Growth between the end of a warm-up and that of ``times`` more; the median of several looks at each end."""
    if not _PROCESS.is_dir():
        pytest.skip("what a process holds is read from /proc, which this system has not")
    logging.disable()  # what pytest keeps of the log would be counted
    try:
        before = _held(warm_up, act)
        after = _held(times, act)
    finally:
        logging.disable(logging.NOTSET)
    growth = Growth(**{name: after[name] - before[name] for name in before})
    print(f"over {times} times: {growth}")  # noqa: T201 - shown by pytest -s
    return growth


def _held(times: int, act: Callable[[], object]) -> dict[str, int]:
    looks = []
    for number in range(times):
        act()
        if times - number <= 9:  # resident memory goes up and down with the buffers in use
            gc.collect()
            looks.append(int((_PROCESS / "statm").read_text().split()[1]) * _PAGE_BYTES)
    return {
        "resident_bytes": sorted(looks)[len(looks) // 2],
        "descriptors": len(list((_PROCESS / "fd").iterdir())),
        "threads": threading.active_count(),
    }

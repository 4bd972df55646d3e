"""What a process holds, before and after doing the same thing often."""

from __future__ import annotations

import gc
import logging
import threading
from dataclasses import dataclass
from itertools import pairwise
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


PARTS = 3


def growth_over(times: int, act: Callable[[], object], *, warm_up: int = 20) -> Growth:
    """Growth between the end of a warm-up and that of ``times`` more; the median of several looks at each end.

    A leak grows in each part of the run, a buffer that is used for the first time in one: the growth of resident memory
    is that of the median third, three times.
    """
    if not _PROCESS.is_dir():
        pytest.skip("what a process holds is read from /proc, which this system has not")
    logging.disable()  # what pytest keeps of the log would be counted
    try:
        held = [_held(warm_up, act), *(_held(times // PARTS, act) for _ in range(PARTS))]
    finally:
        logging.disable(logging.NOTSET)
    resident = [after["resident_bytes"] - before["resident_bytes"] for before, after in pairwise(held)]
    growth = Growth(
        resident_bytes=PARTS * sorted(resident)[PARTS // 2],
        **{name: held[-1][name] - held[0][name] for name in ("descriptors", "threads")},
    )
    print(f"over {times} times: {growth}, by parts {resident}")  # noqa: T201 - shown by pytest -s
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

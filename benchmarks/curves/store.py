"""Time of a store's calls over the number of its presses."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.curves.curve import Curve, Line
from benchmarks.store_speed import BEGUN, frame, grown

from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Callable

SIZES = (100, 1_000, 10_000, 100_000)
OF_TARGET, REPEATS = 100, 15


def over_presses(told: Callable[[str], None], folder: Path | None = None) -> Curve:
    """Targets of 100 presses each; medians of calls in turns, of a store that is open."""
    found: dict[str, dict[int, float]] = {}
    for size in SIZES:
        told(f"store of {size:,} presses")
        with tempfile.TemporaryDirectory(prefix="tsis-scaling-", dir=folder) as place:
            grown(Path(place), size, size // OF_TARGET)
            for name, milliseconds in _calls(Path(place)).items():
                found.setdefault(name, {})[size] = milliseconds
    lines = tuple(
        Line(name=name, unit="ms", size=tuple(each), value=tuple(each.values())) for name, each in found.items()
    )
    return Curve(title="Store", size_name="presses in the store, 100 a target", lines=lines)


def _calls(folder: Path) -> dict[str, float]:
    rng, taken = np.random.default_rng(1), dict[str, list[float]]()
    with open_store(folder) as store:
        target = store.targets()[-1].target
        for _ in range(REPEATS):
            image = frame(rng)
            calls: dict[str, Callable[[], object]] = {
                "list all targets": store.targets,
                "read 50 presses": lambda: store.presses(target, limit=50),
                "add a press": lambda image=image: store.add_press(target, image, taken=BEGUN),  # type: ignore[misc]
            }
            for name, call in calls.items():
                began = time.perf_counter()
                call()
                taken.setdefault(name, []).append(1e3 * (time.perf_counter() - began))
    return {name: median(times) for name, times in taken.items()}

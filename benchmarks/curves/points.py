"""Processor time to match point sets over the number of their points; other work beside it changes it little."""

from __future__ import annotations

import time
from statistics import median
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.curves.curve import Curve, Line
from benchmarks.matching.__main__ import speed_trial
from benchmarks.matching.methods import BenchmarkMethod

if TYPE_CHECKING:
    from collections.abc import Callable

SIZES = (50, 100, 200, 400, 800, 1400, 2000)
MANY, FEW, LARGE = 3, 1, 1000  # trials up to so many points, and above
FIT_FROM = 200
METHODS = ("tprl", "pycpd")


def over_points(told: Callable[[str], None]) -> Curve:
    """Strokes bent and turned by 30 degrees; medians over trials, one thread, the methods in turns."""
    methods = {name: BenchmarkMethod(name=name) for name in METHODS if not BenchmarkMethod(name=name).absent()}
    taken: dict[str, dict[int, float]] = {name: {} for name in methods}
    for size in SIZES:
        told(f"matching {size} points")
        trials = [speed_trial(size, number) for number in range(MANY if size <= LARGE else FEW)]
        times: dict[str, list[float]] = {name: [] for name in methods}
        for trial in trials:
            for name, method in methods.items():
                if size == SIZES[0]:
                    method(trial.source, trial.target, rng=np.random.default_rng(0))  # compiles
                began = time.process_time()
                method(trial.source, trial.target, rng=np.random.default_rng(0))
                times[name].append(time.process_time() - began)
        for name, found in times.items():
            taken[name][size] = median(found)
    lines = tuple(
        Line(
            name=name.upper() if name == "tprl" else f"CPD of {name}",
            unit="s",
            size=tuple(found),
            value=tuple(found.values()),
            fit_from=FIT_FROM,
        )
        for name, found in taken.items()
    )
    return Curve(title="Matching", size_name="points in each set", lines=lines)

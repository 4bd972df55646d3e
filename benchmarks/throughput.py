"""Presses, frames and profiles a second of all cores: one process a core, each on one thread.

    python -m benchmarks.throughput [--seconds 10] [--only NAME]

Every process warms up; then all work at once. "By the clock" is what was done between the first start and the last end.
"By processor time" is what a core would do that had no other work, from the processor time of each process: on an idle
machine both agree. A press has a new inclusion under the default mesh (0.01 %); a frame has 768 x 492 pixels and noise;
a profile is 20 rings of the table of the default box.
"""

from __future__ import annotations

import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import cycle
from multiprocessing import get_context
from typing import TYPE_CHECKING

import cv2
import numpy as np
from benchmarks.camera import uneven_light, whole_frames
from benchmarks.harness import Bench, Goal, Several
from benchmarks.hot.mechanics import PROFILES
from benchmarks.mechanics import PROBE, drawn_inclusions, slab_kernel, solved, twenty_rings
from threadpoolctl import threadpool_limits

import tsis
from tsis.mechanics.small_strain.slab import Resolution
from tsis.mechanics.surrogate.building import build_surrogate

if TYPE_CHECKING:
    from collections.abc import Callable

GOALS = {"presses": 150.0, "frames": 100.0, "profiles": 1e6}  # a second: of two cores, two cores, one core
A_CORE = {"profiles"}
WARM_UP = 3


def presses() -> tuple[Callable[[], object], int]:
    """A press of another inclusion each time."""
    kernel, drawn = slab_kernel(Resolution()), cycle(zip(*drawn_inclusions(200), strict=True))
    return lambda: solved(kernel, *map(float, next(drawn))), 1


def frames() -> tuple[Callable[[], object], int]:
    """A frame of one press with new noise."""
    field = tsis.mechanics.press(PROBE, tsis.load_phantom("size-8"), force_n=1.0)
    return whole_frames(field, uneven_light(), np.random.default_rng(os.getpid()))[0], 1


def profiles() -> tuple[Callable[[], object], int]:
    """Many profiles at once."""
    rings, asked = twenty_rings(build_surrogate(PROBE)), drawn_inclusions(PROFILES)
    return lambda: rings(*asked), PROFILES


WORK = {"presses": presses, "frames": frames, "profiles": profiles}


def worked(name: str, seconds: float, begin: float) -> tuple[int, float, float, float]:
    """What one process did: how much, from when to when, and its processor time."""
    cv2.setNumThreads(1)
    with threadpool_limits(limits=1):
        call, of_each = WORK[name]()
        for _ in range(WARM_UP):
            call()
        time.sleep(max(0.0, begin - time.time()))
        done, began, spent = 0, time.time(), time.process_time()
        while time.process_time() - spent < seconds:
            call()
            done += of_each
        return done, began, time.time(), time.process_time() - spent


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__, seconds=10.0, after=20.0, only=Several(WORK))
    rows, goals = [], []
    for name in bench.only or WORK:
        cores = 1 if name in A_CORE else bench.machine["cores"]
        with ProcessPoolExecutor(cores, mp_context=get_context("spawn")) as pool:
            begin = time.time() + bench.after
            parts = [pool.submit(worked, name, bench.seconds, begin) for _ in range(cores)]
            found = [part.result() for part in parts]
        clock = sum(part[0] for part in found) / (max(part[2] for part in found) - min(part[1] for part in found))
        processor = sum(part[0] / part[3] for part in found)
        goals.append(
            Goal(name=f"{name} a second by processor time", value=processor, least=GOALS[name], form="{:,.0f}")
        )
        rows.append((f"{name}, {cores} cores", f"{clock:,.0f}", f"{processor:,.0f}"))
    heads = ("what", "a second by the clock", "by processor time")
    bench.table("Throughput", heads, rows)
    return bench.end(goals)


if __name__ == "__main__":
    sys.exit(main())

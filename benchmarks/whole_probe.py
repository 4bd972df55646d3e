"""Whether Mitsuba should trace the light in the whole probe: time to the same error of the map, both in one run.

    python -m benchmarks.whole_probe [--rays 2e6] [--seeds 5] [--peer-python PATH]

The map is the power that arrives at the face of an unpressed probe, in 24 x 24 bins, from the catalog's lamps and from
level ones. The error is each bin's relative standard deviation between seeds, as RMS over the bins within 0.8 of the
radius; the time to an error of 1 % follows from it by the inverse square. Times are of all processors together, so that
other work on the machine changes little. ``--peer-python`` has Mitsuba, Dr.Jit and
NumPy; LLVM must be on the machine (``DRJIT_LIBLLVM_PATH`` names it).
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench
from benchmarks.rays import INNER, LEVEL, PROBE

from tsis.optics.rays.geometry import scene
from tsis.optics.rays.tracing import trace_rays

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.probe import Probe

BINS, GOAL = 24, 0.01
WORTH = 2.0  # times as fast at the same error


def told(probe: Probe) -> dict[str, Any]:
    """The unpressed probe and its lamps as plain numbers."""
    view, lit = scene(probe, None), [led for led in probe.leds if led.power > 0]
    lamps = []
    for led in lit:
        x, y = np.cos(np.radians(led.azimuth_deg)), np.sin(np.radians(led.azimuth_deg))
        up, level = np.sin(np.radians(led.aim_deg)), np.cos(np.radians(led.aim_deg))
        place = [probe.radius_mm * x, probe.radius_mm * y, probe.led_height_mm(led)]
        lamps.append(
            {
                "position": [float(each) for each in place],
                "axis": [float(-x * level), float(-y * level), float(up)],
                "radius": led.diameter_mm / 2,
                "exponent": led.exponent,
                "power": led.power / sum(each.power for each in lit),
            }
        )
    return {
        "radius": view.radius,
        "level": view.level.tolist(),
        "indices": view.indices.tolist(),
        "outside": view.outside,
        "weak": view.weak,
        "bins": BINS,
        "lamps": lamps,
    }


def by_peer(probe: Probe, rays: float, seeds: int, python: str) -> tuple[str, list[float], NDArray[np.float64]]:
    """Mitsuba's version, processor seconds and maps."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.json"
        path.write_text(json.dumps(told(probe)), encoding="utf-8")
        command = [python, "-m", "benchmarks.peers.mitsuba_probe", str(path), str(rays), str(seeds)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
    found = json.loads(done.stdout)
    return found["version"], found["seconds"], np.array(found["maps"]).reshape(seeds, BINS, BINS)


def by_tsis(probe: Probe, rays: float, seeds: int) -> tuple[list[float], NDArray[np.float64]]:
    """Processor seconds and maps."""
    trace_rays(probe, None, rays=1e4, bins=BINS)
    seconds, maps = [], []
    for seed in range(1, seeds + 1):
        began = time.process_time()
        maps.append(trace_rays(probe, None, rays=rays, seed=seed, bins=BINS).arriving)
        seconds.append(time.process_time() - began)
    return seconds, np.array(maps)


def error_of(maps: NDArray[np.float64]) -> float:
    """RMS over the inner bins of the relative standard deviation between seeds."""
    middles = (np.arange(BINS) + 0.5) / (BINS / 2) - 1
    inner = np.hypot(middles, middles[:, None]) < INNER
    return float(np.sqrt(np.mean((maps.std(axis=0, ddof=1)[inner] / maps.mean(axis=0)[inner]) ** 2)))


def main() -> int:
    """Print the table."""
    bench = Bench(__doc__, rays=2000000.0, seeds=5, peer_python=sys.executable)
    rows = []
    for probe in (PROBE, LEVEL):
        own_s, own = by_tsis(probe, bench.rays, bench.seeds)
        version, peer_s, peer = by_peer(probe, bench.rays, bench.seeds, bench.peer_python)
        bias = float(np.abs(peer.mean(axis=0).sum() / own.mean(axis=0).sum() - 1))
        needs = [float(np.median(t)) * (error_of(m) / GOAL) ** 2 for t, m in ((own_s, own), (peer_s, peer))]
        rows += [
            (
                f"{program}, {probe.name}",
                f"{bench.rays / np.median(seconds) / 1e6:.2f}",
                f"{100 * error_of(maps):.2f} %",
                f"{need:.2f} s",
                more,
            )
            for program, seconds, maps, need, more in (
                ("tsis", own_s, own, needs[0], ""),
                (f"Mitsuba {version}, llvm", peer_s, peer, needs[1], f"{needs[0] / needs[1]:.2f}; {bias:.2%}"),
            )
        ]
    heads = (
        "program and probe",
        "million rays a CPU second",
        "error of a bin",
        "CPU time to 1 %",
        "times as fast; sums differ by",
    )
    bench.table(f"The map of a whole probe, {bench.rays:g} rays", heads, rows)
    print(f"worth an extra from {WORTH:g} times on")
    return 0


if __name__ == "__main__":
    sys.exit(main())

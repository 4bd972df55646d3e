"""Moduli from simulated force curves: are the intervals honest, and are the medians right?

    python -m benchmarks.force_curves --curves 100 --seed 7001 --seconds 240

Presses and judged curves lie on the disk (`--bank`): a run that is interrupted, or that ends after `--seconds`, goes on
where it ended. Each curve has a random generator of its own by its number.

The curves are finite-strain presses of a rigid ball (`tsis.mechanics.finite_strain`: neo-Hookean, frictionless, on a
bonded slab), another path than the estimator's small-strain layer. Each curve has its own modulus (2-200 kPa), ball
(5 µm to 10 mm), thickness (2-50 radii), depth, Poisson's ratio, contact point, offset and tilt, white and 1/f noise,
drift, and errors of radius, thickness and force with the standard deviations that the estimator is told.
"""

from __future__ import annotations

import json
import sys
from functools import cache
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, Goal
from rich.progress import track

import tsis
from tsis.files.atomic import write_durably
from tsis.hardness.force_curves import ForceCurve
from tsis.mechanics.finite_strain.neo_hookean_press import press_path

if TYPE_CHECKING:
    from numpy.typing import NDArray

RADIUS_MM, YOUNG_KPA, STIFF_KPA = 10.0, 10.0, 3e4
RATIOS, POISSONS = (2.0, 3.0, 5.0, 10.0, 20.0, 50.0), (0.48, 0.49, 0.495)
POINTS = 1500


@cache
def finite_path(ratio: float, poisson: float, bank: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth over the ball's radius, and force over modulus and squared radius, of one path of presses."""
    stored = bank / f"path-{ratio:g}-{poisson:g}.json"
    if not stored.is_file():
        stiff = tsis.Layer(thickness_mm=8.0, young_kpa=STIFF_KPA, poisson=0.3)
        ball = tsis.Probe(radius_mm=7.0, face_curvature_mm=RADIUS_MM, layers=(stiff,))
        slab = tsis.Phantom(young_kpa=YOUNG_KPA, poisson=poisson, thickness_mm=ratio * RADIUS_MM)
        depth = np.geomspace(0.1, 2.4 if ratio > 3 else 1.6, 11)
        forces = 4 / 3 * YOUNG_KPA / (1 - poisson**2) * np.sqrt(RADIUS_MM) * depth**1.5 / 1e3
        path = press_path(ball, slab, forces_n=forces.tolist())
        write_durably(stored, json.dumps([[press.approach_mm, press.force_n] for press in path]).encode())
    depths, newtons = np.array(json.loads(stored.read_text())).T
    return depths / RADIUS_MM, newtons * 1e3 / (YOUNG_KPA * RADIUS_MM**2)


def pink(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Noise of a density 1/f, of unit standard deviation."""
    spectrum = np.fft.rfft(rng.standard_normal(count))
    spectrum[1:] /= np.sqrt(np.arange(1, len(spectrum)))
    spectrum[0] = 0
    noise = np.fft.irfft(spectrum, count)
    return np.asarray(noise / noise.std())


def one_curve(rng: np.random.Generator, bank: Path) -> tuple[float, tsis.Estimate, float]:
    """True modulus, the estimate, and the thickness over the radius."""
    ratio, poisson = float(rng.choice(RATIOS)), float(rng.choice(POISSONS))
    depth, force = finite_path(ratio, poisson, bank)
    young, radius = float(np.exp(rng.uniform(*np.log((2, 200))))), float(np.exp(rng.uniform(*np.log((5e-3, 10)))))
    deepest = float(rng.uniform(0.4, 1.0)) * depth[-1] * radius
    position = np.linspace(-rng.uniform(0.5, 2.5) * deepest, deepest, POINTS)
    below = np.maximum(position, 1e-30) / radius
    slope = np.log(force[1] / force[0]) / np.log(depth[1] / depth[0])
    logs = np.interp(np.log(below), np.log(depth), np.log(force)) + slope * np.minimum(np.log(below / depth[0]), 0)
    clean = np.where(position > 0, np.exp(logs), 0.0) * young * radius**2 * 1e-3
    peak = clean.max()
    course = position / np.ptp(position)
    measured = (
        clean * np.exp(0.01 * rng.standard_normal())
        + peak * float(np.exp(rng.uniform(*np.log((1e-3, 2e-2))))) * rng.standard_normal(POINTS)
        + peak * float(np.exp(rng.uniform(*np.log((1e-3, 1e-2))))) * pink(rng, POINTS)
        + peak * (rng.uniform(-0.5, 0.5) + rng.normal(0, 0.03) * course + rng.normal(0, 0.005) * course**2)
    )
    curve = ForceCurve(position_mm=position + rng.uniform(-1, 1) * radius, force_n=measured)
    told = {"radius_mm": radius * np.exp(0.01 * rng.standard_normal())}
    told["thickness_mm"] = ratio * radius * np.exp(0.02 * rng.standard_normal())
    return young, tsis.hardness.indentation(curve, **told, seed=int(rng.integers(2**31))), ratio


def judged_curve(seed: int, number: int, bank: Path) -> tuple[float, ...]:
    """Thickness, whether trusted, relative error, relative width, and whether the interval holds, of one curve."""
    stored = bank / f"curve-{seed}-{number}.json"
    if not stored.is_file():
        young, estimate, ratio = one_curve(np.random.default_rng([seed, number]), bank)
        row = (ratio, 0.0, 0.0, 0.0, 0.0)
        if estimate.trusted:
            low, high = estimate.interval()["young_kpa"]
            mean = estimate.untrusted.mean["young_kpa"]
            row = (ratio, 1.0, mean / young - 1, (high - low) / mean, float(low <= young <= high))
        write_durably(stored, json.dumps(row).encode())
    return tuple(json.loads(stored.read_text()))


def main() -> int:
    """Judge the intervals and the median error."""
    bench = Bench(__doc__, seed=7001, curves=100, seconds=1e9, bank=Path("build/force-curves"))
    bench.bank.mkdir(parents=True, exist_ok=True)
    rows, end = [], monotonic() + bench.seconds
    for number in track(range(bench.curves), "curves"):
        rows.append(judged_curve(bench.seed, number, bench.bank))
        if monotonic() > end:
            break
    found = np.array(rows, dtype=float)
    good = found[found[:, 1] > 0]
    parts = [("all", good), *((f"{ratio:g} radii", good[good[:, 0] == ratio]) for ratio in RATIOS)]
    table = [
        (name, len(part), f"{100 * part[:, 4].mean():.0f} %", f"{100 * np.median(part[:, 2]):+.1f} %",
         f"{100 * np.median(np.abs(part[:, 2])):.1f} %", f"{100 * np.median(part[:, 3]):.0f} %")
        for name, part in parts if len(part)
    ]  # fmt: skip
    heads = ("thickness", "curves", "interval holds", "median error", "median size of the error", "median width")
    bench.table("Simulated force curves", heads, table)
    return bench.end(
        [
            Goal(name="90 % interval holds, %", value=100 * good[:, 4].mean(), least=85, most=95),
            Goal(name="median size of the error, %", value=100 * float(np.median(np.abs(good[:, 2]))), most=3),
            Goal(name="trusted, %", value=100 * len(good) / len(found), least=90),
        ]
    )


if __name__ == "__main__":
    sys.exit(main())

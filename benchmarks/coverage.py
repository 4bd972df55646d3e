"""Do the intervals hold? Virtual presses whose tissue, force, gain and mesh the estimator does not know.

    python benchmarks/coverage.py --presses 200 --seed 1

Each press draws an inclusion from the prior, a tissue (modulus and thickness 10 % off, as one standard deviation), a
reference site (modulus 3 % off), a probe with its own gain (1 %) and fixed pattern (0.2 %), forces 1 % off, stray light
(1 %) and a pattern that does not repeat (0.05 %). The virtual probe's mesh is finer and of another order than the one
behind the estimator; mechanics and image model are the same.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

import tsis
from tsis.inclusion import PARAMETERS, InclusionPrior, estimate
from tsis.virtual import VirtualProbe

if TYPE_CHECKING:
    from numpy.typing import NDArray

LEVEL = 0.9
FORCE_N = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """Truths, means, interval bounds and narrowings, shape (presses, 3) each, and the flags' counts."""

    truth: NDArray[np.float64]
    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    narrowing: NDArray[np.float64]
    flags: dict[str, int]

    @property
    def coverage(self) -> NDArray[np.float64]:
        """Share of truths inside their interval, by parameter."""
        return np.asarray(((self.truth >= self.low) & (self.truth <= self.high)).mean(axis=0))


def draw(prior: InclusionPrior, rng: np.random.Generator) -> tsis.Phantom:
    """A phantom from the prior; draws whose inclusion touches the chest wall are drawn again."""
    while True:
        diameter, depth, young = rng.uniform(prior.low, prior.high)
        thickness = prior.thickness_mm * (1 + prior.thickness_sd * rng.standard_normal())
        if depth + diameter < 0.97 * thickness:
            break
    return tsis.Phantom(
        young_kpa=prior.tissue_young_kpa * (1 + prior.tissue_young_sd * rng.standard_normal()),
        thickness_mm=thickness,
        inclusion=tsis.Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young),
    )


def one(seed: np.random.SeedSequence) -> tuple[list[list[float]], tuple[str, ...]]:
    """One press with its reference, and the estimate: rows truth, mean, low, high, narrowing."""
    rng, probe, prior = np.random.default_rng(seed), tsis.load_probe("tsis-2011"), InclusionPrior()
    phantom = draw(prior, rng)
    virtual = VirtualProbe(probe, rng=rng)
    site = replace(
        phantom.without_inclusion(),
        young_kpa=phantom.young_kpa * float(np.exp(virtual.calibration.site_sd * rng.standard_normal())),
    )
    image, reference = virtual.press(phantom, force_n=FORCE_N), virtual.press(site, force_n=FORCE_N)
    result = estimate(image, probe=probe, calibration=virtual.calibration, reference=reference)
    interval = result.interval(LEVEL)
    rows = [
        [
            getattr(phantom.inclusion, name),
            result.mean[name],
            *interval[name],
            result.narrowing[name],
        ]
        for name in PARAMETERS
    ]
    return rows, result.flags


def run(presses: int, seed: int) -> Outcome:
    """All presses, on all cores."""
    seeds = np.random.SeedSequence(seed).spawn(presses)
    one(seeds[0])  # fills the surrogate's cache once, before the workers share it
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
        results = list(track(pool.map(one, seeds), total=presses, description="pressing", console=Console(stderr=True)))
    table = np.array([rows for rows, _ in results]).transpose(2, 0, 1)
    flags = [flag for _, flags in results for flag in flags]
    return Outcome(
        truth=table[0],
        mean=table[1],
        low=table[2],
        high=table[3],
        narrowing=table[4],
        flags={flag: flags.count(flag) for flag in sorted(set(flags))},
    )


def summary(outcome: Outcome) -> dict[str, dict[str, float]]:
    """The numbers of the report, by parameter."""
    prior = InclusionPrior()
    guess = (prior.low + prior.high) / 2
    error, blind = np.abs(outcome.mean - outcome.truth), np.abs(guess - outcome.truth)
    return {
        name: {
            "coverage": float(outcome.coverage[i]),
            "median_error": float(np.median(error[:, i])),
            "rmse": float(np.sqrt((error[:, i] ** 2).mean())),
            "prior_mean_median_error": float(np.median(blind[:, i])),
            "prior_mean_rmse": float(np.sqrt((blind[:, i] ** 2).mean())),
            "median_narrowing": float(np.median(outcome.narrowing[:, i])),
        }
        for i, name in enumerate(PARAMETERS)
    }


def main() -> int:
    """Print the table; the exit code says whether all coverages lie in 85 to 95 %."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--presses", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    outcome = run(options.presses, options.seed)
    numbers = summary(outcome)
    if options.json:
        print(json.dumps({"parameters": numbers, "flags": outcome.flags}, indent=2))
    else:
        table = Table(title=f"{options.presses} virtual presses, flat probe, one press and one reference at 1 N")
        for heading in ("", *next(iter(numbers.values()))):
            table.add_column(heading.replace("_", " "))
        for name, row in numbers.items():
            table.add_row(name, *(f"{value:.3g}" for value in row.values()))
        Console().print(table)
        Console().print(f"flags: {outcome.flags}")
    return 0 if all(0.85 <= row["coverage"] <= 0.95 for row in numbers.values()) else 1


if __name__ == "__main__":
    sys.exit(main())

"""Do intervals of areas under curves hold? Binormal studies of few and of many targets.

    python -m benchmarks.detection_intervals --studies 2000 --seed 1

Scores are normal with equal variances, as many targets with an inclusion as without. Coverage is the share of studies
whose 95 % interval holds the true area; a method that gives no interval for a study has not held it.
"""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench
from scipy.special import ndtri

from tsis.cli.progress import progress_bar
from tsis.errors import InputError
from tsis.study.roc import Roc

if TYPE_CHECKING:
    from collections.abc import Callable

SIZES = (3, 5, 8, 20, 50)
AREAS = (0.6, 0.75, 0.9, 0.98)
METHODS = ("delong", "newcombe", "bootstrap", "default")
LEAST = 0.92  # of the default, where 0.95 is meant: what is tolerated at any size and area
LEVEL = 0.95


def study(
    size: int, area: float, studies: int, *, rng: np.random.Generator, draws: int
) -> dict[str, tuple[float, float]]:
    """Coverage and mean length of each method's intervals."""
    present = np.arange(2 * size) < size
    shift = math.sqrt(2) * float(ndtri(area))
    held, lengths = dict.fromkeys(METHODS, 0), dict.fromkeys(METHODS, 0.0)
    for _ in range(studies):
        curve = Roc.of(rng.normal(size=2 * size) + shift * present, present)
        for method in METHODS:
            try:
                expected = None if method == "default" else method
                interval = curve.auc_interval(LEVEL, expected, rng=rng, draws=draws)
            except InputError:  # no spread, so no interval
                continue
            held[method] += interval.holds(area)
            lengths[method] += interval.high - interval.low
    return {method: (held[method] / studies, lengths[method] / studies) for method in METHODS}


def run(
    studies: int, *, seed: int = 1, draws: int = 500, progress: Callable[[int, int], None] | None = None
) -> dict[tuple[int, float], dict[str, tuple[float, float]]]:
    """Coverage and mean length by size and area."""
    cells = [(size, area) for size in SIZES for area in AREAS]
    found = {}
    for done, (size, area) in enumerate(cells, 1):
        rng = np.random.default_rng([seed, done])
        found[size, area] = study(size, area, studies, rng=rng, draws=draws)
        if progress is not None:
            progress(done, len(cells))
    return found


def main() -> int:
    """Print the table; the exit code is 1 when the default method covers less than is tolerated anywhere."""
    bench = Bench(__doc__, studies=2000, seed=1, draws=500)
    with progress_bar("drawing studies") as progress:
        found = run(bench.studies, seed=bench.seed, draws=bench.draws, progress=progress)
    rows = [
        (f"{size} + {size}", f"{area:g}", *(f"{held:.3f} ({length:.2f})" for held, length in cell.values()))
        for (size, area), cell in found.items()
    ]
    title = f"coverage (mean length) of 95 % intervals, {bench.studies} studies each, seed {bench.seed}"
    bench.table(title, ("targets", "true area", *METHODS), rows)
    worst = min(cell["default"][0] for cell in found.values())
    print(f"least coverage of the default: {worst:.3f}")
    return 0 if worst >= LEAST else 1


if __name__ == "__main__":
    sys.exit(main())

"""The nine inclusions of table 6.2 with every nuisance drawn: mean relative errors beside those that are printed.

    python -m benchmarks.nine_inclusions [--protocol domed] [--repeats 12]

Each inclusion is pressed several times, each time in another tissue by another virtual probe, as
`benchmarks.simulated_presses` says. The estimate is the posterior mean, which makes squared errors small and not
relative ones: where a press tells little, it errs by more of a small truth than the best guess for this table would.
"""

from __future__ import annotations

import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, Several
from benchmarks.simulated_presses import PROTOCOLS, SMALL, Protocol, examine
from studies.section_6_3 import PRINTED, PRINTED_ERROR, relative_error, without_itself

import tsis
from tsis.cli.progress import progress_bar
from tsis.inclusion import InclusionPrior, estimate
from tsis.inclusion.prior import PARAMETERS
from tsis.virtual.examinations import surround

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

INCLUSIONS = 9
TARGETS = {"flat-alone": (6.0, 6.0, None), "domed": (2.5, 2.5, 25.0)}  # per cent of d, h, E


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NineInclusions:
    """Posterior means, shape (9, repeats, 3), and the truth, shape (9, 3)."""

    truth: NDArray[np.float64]
    means: NDArray[np.float64]

    @property
    def errors(self) -> NDArray[np.float64]:
        """Relative errors in %, shape (9, repeats, 3)."""
        return relative_error(self.means, self.truth[:, None])

    @property
    def mean_error(self) -> NDArray[np.float64]:
        """Their mean over inclusions and repeats, shape (3,)."""
        return np.asarray(self.errors.mean(axis=(0, 1)))

    @property
    def standard_error(self) -> NDArray[np.float64]:
        """Of that mean, by the scatter of the repeats of each inclusion, shape (3,)."""
        scatter = self.errors.var(axis=1, ddof=1).mean(axis=0)
        return np.asarray(np.sqrt(scatter / (self.errors.shape[0] * self.errors.shape[1])))


def inclusion(number: int) -> tsis.Inclusion:
    """Row ``number``, from 0, of table 6.2."""
    found = tsis.load_phantom(f"calibration-{number + 1}").inclusion
    assert found is not None  # the catalog's calibration phantoms all have one
    return found


def posterior_mean(
    protocol: Protocol, seed: int, number: int, repeat: int, prior: InclusionPrior | None = None
) -> list[float]:
    """Diameter, depth and modulus estimated from one repeat, by default under the shipped prior, which draws it too."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number, repeat)))
    case = examine(protocol, surround(inclusion(number), InclusionPrior(), rng), rng)
    found = estimate(
        case.frames,
        probe=protocol.probe,
        calibration=case.calibration,
        reference=case.references,
        prior=prior or InclusionPrior(),
        strain=protocol.strain,
    )
    return [found.untrusted.mean[name] for name in PARAMETERS]


def run(
    protocol: Protocol,
    *,
    repeats: int,
    seed: int,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> NineInclusions:
    """All repeats of all nine, on all cores."""
    numbers = [number for number in range(INCLUSIONS) for _ in range(repeats)]
    turns = [repeat for _ in range(INCLUSIONS) for repeat in range(repeats)]
    means = [posterior_mean(protocol, seed, numbers[0], turns[0])]  # fills the caches before the workers share them
    with ProcessPoolExecutor(max_workers=workers or os.cpu_count()) as pool:
        rest = len(numbers) - 1
        for mean in pool.map(posterior_mean, rest * [protocol], rest * [seed], numbers[1:], turns[1:]):
            means.append(mean)
            if progress is not None:
                progress(len(means), len(numbers))
    return NineInclusions(
        truth=np.array([[getattr(inclusion(number), name) for name in PARAMETERS] for number in range(INCLUSIONS)]),
        means=np.reshape(means, (INCLUSIONS, repeats, len(PARAMETERS))),
    )


def known_rows(truth: NDArray[np.float64]) -> list[list[str]]:
    """What the dissertation's networks and two guesses err by, %."""
    prior = InclusionPrior()
    errors = {
        "table 6.2, printed errors": PRINTED_ERROR,
        "table 6.2, errors of its estimates": relative_error(PRINTED, truth),
        "the prior's mean": relative_error((prior.low + prior.high) / 2, truth),
        "mean of the other eight": relative_error(without_itself(truth), truth),
    }
    return [[name, *(f"{value:.1f}" for value in error.mean(axis=0)), ""] for name, error in errors.items()]


def row(protocol: Protocol, found: NineInclusions) -> list[str]:
    """Ours, %, with the standard error of each mean, and what was aimed at."""
    cells = (f"{mean:.1f} ± {se:.1f}" for mean, se in zip(found.mean_error, found.standard_error, strict=True))
    aimed = zip("dhE", TARGETS.get(protocol.name, (None,) * 3), strict=True)
    return [protocol.name, *cells, ", ".join(f"{name} <= {most:g}" for name, most in aimed if most is not None)]


def main() -> int:
    """Print the table."""
    bench = Bench(__doc__, protocol=Several(PROTOCOLS), repeats=12, seed=1, workers=int)
    rows: list[list[str]] = []
    for name in bench.protocol or [one.name for one in SMALL]:
        with progress_bar(name) as progress:
            found = run(
                PROTOCOLS[name],
                repeats=bench.repeats,
                seed=bench.seed,
                workers=bench.workers,
                progress=progress,
            )
        rows = [*(rows or known_rows(found.truth)), row(PROTOCOLS[name], found)]
    title = f"mean relative error in %, posterior mean, {bench.repeats} repeats of each of nine, seed {bench.seed}"
    bench.table(title, ("", "d", "h", "E", "aim"), rows)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())

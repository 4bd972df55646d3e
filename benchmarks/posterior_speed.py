"""How long an estimate takes, and how much longer the same posterior takes on one dense grid.

    python -m benchmarks.posterior_speed [--repeats 20]

One thread. An estimate reads the frames into ring profiles, explores the posterior and looks at the pictures. In the
same run: the likelihood that is linearised at every inclusion on a dense grid of 60 x 60 x 12 over the reach of the
samples, which a plain program would lay, if it knew that reach. Last, the first estimate of a fresh installation, which
builds the surrogate of presses on all cores.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench
from threadpoolctl import threadpool_limits

import tsis
from tsis.inclusion import InclusionPrior, estimate
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.inclusion.reading import press_tables, read_frames
from tsis.mechanics.surrogate.full_contact import build_full_contact_surrogate
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.inclusion.posterior.exploration import InclusionPosterior
    from tsis.inclusion.posterior.likelihood import InclusionLikelihood
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage

PHANTOM = tsis.Phantom(
    young_kpa=5.0, thickness_mm=30.0, inclusion=tsis.Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=60.0)
)
DENSE = (60, 60, 12)  # along diameter, depth and modulus
AT_ONCE = 2160  # inclusions of the dense grid, so that their derivatives fit into memory
PROTOCOLS = {
    "flat, 1 frame alone": ("tsis-2011", (1.0,), False),
    "flat, 1 + 1 reference": ("tsis-2011", (1.0,), True),
    "domed, 2 + 2": ("tsis-domed", (0.5, 1.0), True),
    "domed, 5 + 5": ("tsis-domed", tuple(np.linspace(0.5, 1.0, 5).tolist()), True),
    "domed, 10 + 10": ("tsis-domed", tuple(np.linspace(0.5, 1.0, 10).tolist()), True),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosteriorBench:
    """Frames of one protocol and what is known of their probe."""

    frames: list[TactileImage]
    references: list[TactileImage]
    calibration: Calibration
    probe: tsis.Probe
    prior: InclusionPrior

    @classmethod
    def of(cls, name: str, forces_n: tuple[float, ...], *, with_reference: bool) -> PosteriorBench:
        """Pressed by a virtual probe."""
        probe = tsis.load_probe(name)
        virtual = VirtualProbe(probe, rng=np.random.default_rng(1), strain="small")
        plain = PHANTOM.without_inclusion()
        return cls(
            frames=[virtual.press(PHANTOM, force_n=force) for force in forces_n],
            references=[virtual.press(plain, force_n=force) for force in forces_n] if with_reference else [],
            calibration=virtual.calibration,
            probe=probe,
            prior=InclusionPrior(),
        )

    def estimate(self) -> None:
        """All of it, as a caller has it."""
        estimate(
            self.frames,
            probe=self.probe,
            calibration=self.calibration,
            reference=self.references,
            prior=self.prior,
            strain="small",
        )

    def likelihood(self) -> InclusionLikelihood:
        """Read the frames, the surrogate being at hand."""
        tables = press_tables(self.probe, self.prior, "small")
        return read_frames(
            self.frames, self.references, tables, probe=self.probe, calibration=self.calibration, prior=self.prior
        ).likelihood


def median_ms(call: Callable[[], object], repeats: int) -> float:
    """Median wall time of a call in ms."""
    times = []
    for _ in range(repeats):
        started = perf_counter()
        call()
        times.append(1e3 * (perf_counter() - started))
    return float(np.median(times))


def dense_grid(
    likelihood: InclusionLikelihood, low: NDArray[np.float64], high: NDArray[np.float64], nuisance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Log evidence at the middles of a dense grid's cells."""
    axes = [a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in zip(low, high, DENSE, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    parts = np.array_split(points, -(-len(points) // AT_ONCE))
    return np.concatenate([likelihood(part, nuisance).log_evidence for part in parts])


def grid_within_reach(likelihood: InclusionLikelihood, found: InclusionPosterior) -> Callable[[], NDArray[np.float64]]:
    """The dense grid over the reach of the samples that were found."""
    low, high = found.samples.min(axis=0), found.samples.max(axis=0)
    nuisance = likelihood.within(found.fit.nuisance[0])
    return lambda: dense_grid(likelihood, low, high, nuisance)


def row(name: str, bench: PosteriorBench, repeats: int) -> list[str]:
    """One line of the table."""
    bench.estimate()  # loads what later calls find at hand
    likelihood = bench.likelihood()
    found = explore_inclusion(likelihood, bench.prior)
    whole = median_ms(bench.estimate, repeats)
    reading = median_ms(bench.likelihood, repeats)
    with threadpool_limits(limits=1, user_api="blas"):
        exploring = median_ms(lambda: explore_inclusion(likelihood, bench.prior), repeats)
        dense = median_ms(grid_within_reach(likelihood, found), 1)
    return [
        name,
        f"{whole:.0f} ms",
        f"{reading:.0f} ms",
        f"{exploring:.0f} ms",
        f"{dense / 1e3:.1f} s",
        f"{dense / exploring:.0f}",
    ]


def first_ms(bench: PosteriorBench) -> float:
    """Time of the first estimate, whose surrogate nobody has built before, ms."""
    build = median_ms(lambda: build_full_contact_surrogate(bench.probe, bench.prior.box(), cached=False), 1)
    return build + median_ms(bench.estimate, 1)


def main() -> int:
    """Print the table."""
    bench = Bench(__doc__, repeats=20)
    benches = {
        name: PosteriorBench.of(probe, forces_n, with_reference=also)
        for name, (probe, forces_n, also) in PROTOCOLS.items()
    }
    rows = [row(name, protocol, bench.repeats) for name, protocol in benches.items()]
    heads = ("frames", "estimate", "of it reading", "exploring", "dense grid", "dense grid over exploring")
    title = f"one thread, median of {bench.repeats}; the dense grid once"
    bench.table(title, heads, rows)
    for name in ("flat, 1 + 1 reference", "domed, 2 + 2"):
        print(f"first estimate, surrogate and all: {name}: {first_ms(benches[name]) / 1e3:.1f} s")
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())

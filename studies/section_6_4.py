"""Section 6.4: eight inclusions and eight blank places, found or not; the study repeated many times on a virtual bench.

The source prints 6 of 8 inclusions found, 7 of 8 blank places called so, and an area under the curve of 0.735. It names
neither size, depth nor modulus of its inclusions, no force, no score and no threshold. Here the phantoms detection-1 to
detection-8 (3, 5, 7 and 10 mm, 5 and 8 mm deep, 100 kPa, in tissue of 5 kPa, all assumed) and eight places of the same
tissue without any are pressed; the score is the probability of an inclusion, and the threshold 0.5 is fixed beforehand.
One study is one virtual probe with its own gain, stiffness, pattern and light; each press has its own force, stray
light and noise, and each reference place a modulus of its own. This is done twice: with the probe over the inclusion in
even tissue, and as in a search, up to 5 mm beside it in tissue of lumps that differ by up to a tenth
(`benchmarks.uneven_tissue`). `studies.section_6_4_bench` says how presses are made.

What such a study can say at all is the point: with eight of each kind the intervals are wide, and that of the printed
area holds 0.5.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.searched_presses import COVERING_N, OFFSET_MM, UNEVEN_SD
from benchmarks.simulated_presses import PROTOCOLS, Protocol
from benchmarks.uneven_tissue import Site, lump_changes, uneven
from studies.printed_6_4 import PRINTED, PRINTED_AREA, percent, printed_lines, table_2_1
from studies.section_6_4_bench import BLANK, PreparedProbe, solved

import tsis
from tsis.cli import progress_bar
from tsis.errors import TsisError
from tsis.inclusion import estimate
from tsis.study.proportions import Counts, Proportion
from tsis.study.roc import Roc

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

PRESENT = tuple(f"detection-{number}" for number in range(1, 9))
TRUTH = np.array([True] * 8 + [False] * 8)
THRESHOLD = 0.5
REPETITIONS = 200


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """Probabilities that the studies gave.

    Attributes
    ----------
    protocol, place
        What was pressed how, and where.
    presence
        Of each study and target, inclusions first, shape (repetitions, 16); NaN where the estimate was refused.
    """

    protocol: Protocol
    place: Place
    presence: NDArray[np.float64]

    @property
    def scores(self) -> NDArray[np.float64]:
        """The same, a refused estimate counted as the wrong answer."""
        return np.where(np.isnan(self.presence), np.where(TRUTH, 0.0, 1.0), self.presence)

    @property
    def counts(self) -> list[Counts]:
        """Decisions of each study."""
        return [Counts.of(row >= THRESHOLD, TRUTH) for row in self.scores]

    @property
    def areas(self) -> NDArray[np.float64]:
        """Area under each study's curve, shape (repetitions,)."""
        return np.array([Roc.of(row, TRUTH).auc for row in self.scores])

    @property
    def found(self) -> list[Proportion]:
        """How often each of the 16 targets was said to hold an inclusion."""
        said = (self.scores >= THRESHOLD).sum(axis=0)
        return [Proportion(successes=int(one), trials=len(self.scores)) for one in said]


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """How well the probe lies over its target, and what tissue it meets.

    Attributes
    ----------
    name
        What tables call it.
    offset_mm
        Largest distance of an inclusion from the axis; distances are uniform.
    uneven_sd
        Largest standard deviation of the log moduli of lumps; uniform, one a target.
    """

    name: str
    offset_mm: float
    uneven_sd: float


PLACES = (
    Place(name="over the inclusion, even tissue", offset_mm=0.0, uneven_sd=0.0),
    Place(name="beside it, uneven tissue", offset_mm=OFFSET_MM, uneven_sd=UNEVEN_SD),
)


def drawn(name: str, place: Place, site_sd: float, rng: np.random.Generator) -> tuple[Site, Site]:
    """Where one target and its reference are pressed; the same numbers are drawn for every place."""
    away, angle = place.offset_mm * rng.random(), 2 * np.pi * rng.random()
    site_log, sd = site_sd * rng.standard_normal(), place.uneven_sd * rng.random()
    phantom, plain = tsis.load_phantom(name), tsis.load_phantom(BLANK)
    if phantom.inclusion is not None:
        offset = (float(away * np.cos(angle)), float(away * np.sin(angle)))
        phantom = replace(phantom, inclusion=replace(phantom.inclusion, offset_mm=offset))
    nearby = replace(plain, young_kpa=plain.young_kpa * float(np.exp(site_log)))
    if place.uneven_sd == 0:
        return Site(phantom=phantom), Site(phantom=nearby)
    return uneven(phantom, sd, rng), uneven(nearby, sd, rng)


def one_study(protocol: Protocol, place: Place, seed: np.random.SeedSequence) -> list[float]:
    """Probabilities of an inclusion in the 16 targets of one study, NaN where refused."""
    rng = np.random.default_rng(seed)
    probe = PreparedProbe(protocol.probe, rng=rng)
    found = []
    for name in (*PRESENT, *[BLANK] * 8):
        site, nearby = drawn(name, place, probe.calibration.site_sd, rng)
        frames = [probe.press_prepared(name, site, force) for force in protocol.forces_n]
        references = [
            probe.press_prepared(BLANK, nearby, force) for force in protocol.forces_n if protocol.with_reference
        ]
        try:
            result = estimate(
                frames,
                probe=protocol.probe,
                calibration=probe.calibration,
                reference=references or None,
                strain="small",
            )
        except TsisError:
            found.append(float("nan"))
            continue
        found.append(float("nan") if result.presence is None else result.presence)
    return found


def run(
    rng: np.random.Generator,
    *,
    repetitions: int = REPETITIONS,
    protocol: str = "flat",
    place: Place = PLACES[0],
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Result:
    """Repeat the whole study; the same ``rng`` gives the same studies whatever the number of workers."""
    plan = PROTOCOLS[protocol]
    for name in (*PRESENT, BLANK):
        for force in plan.forces_n:
            solved(plan.probe_name, name, force)  # before workers share them
    if place.uneven_sd > 0:
        lump_changes(plan.probe, COVERING_N)
    seeds = np.random.SeedSequence(int(rng.integers(2**63))).spawn(repetitions)
    rows: list[list[float]] = []

    def done(row: list[float]) -> None:
        rows.append(row)
        if progress is not None:
            progress(len(rows), repetitions)

    if workers == 1:
        for seed in seeds:
            done(one_study(plan, place, seed))
    else:
        with ProcessPoolExecutor(max_workers=workers) as pool:
            for row in pool.map(one_study, [plan] * repetitions, [place] * repetitions, seeds):
                done(row)
    return Result(protocol=plan, place=place, presence=np.array(rows))


def lines(result: Result) -> list[str]:
    """The repeated studies beside the printed one."""
    counts, areas = result.counts, result.areas
    found = [one.true_positives for one in counts]
    empty = [one.true_negatives for one in counts]
    studies = len(counts)
    out = [f"{result.protocol.described}; {result.place.name}; {studies} studies of 8 + 8 targets"]
    error = 1.96 * areas.std() / np.sqrt(studies)
    out += [
        _rate("sensitivity", found, PRINTED.true_positives),
        _rate("specificity", empty, PRINTED.true_negatives),
        f"area of a study: mean {areas.mean():.4f} ± {error:.4f} ({_spread(areas)}); at most {PRINTED_AREA:g} in "
        f"{np.count_nonzero(areas <= PRINTED_AREA)} of {studies} studies",
        f"refused: {int(np.isnan(result.presence).sum())} of {result.presence.size}, counted as the wrong answer",
    ]
    out.append("said to hold an inclusion, of all studies:")
    for name, one in zip((*PRESENT, "eight blanks"), [*result.found[:8], _together(result.found[8:])], strict=True):
        out.append(f"  {name:14} {_of(name)} {one.value:6.1%} ({percent(*one.interval())})")
    return out


def _rate(name: str, successes: Sequence[int], printed: int) -> str:
    shares = np.array(successes) / 8
    pooled = Proportion(successes=int(sum(successes)), trials=8 * len(successes))
    worse = sum(one <= printed for one in successes)
    return (
        f"{name}: {pooled.value:.1%} of {pooled.trials} targets ({percent(*pooled.interval())}); a study of eight has "
        f"{_spread(shares)}; {worse} of {len(successes)} studies have the printed {printed} of 8 or less"
    )


def _spread(values: NDArray[np.float64]) -> str:
    low, high = np.quantile(values, [0.025, 0.975])
    return f"95 % of studies {low:.3f} to {high:.3f}"


def _together(parts: Sequence[Proportion]) -> Proportion:
    return Proportion(successes=sum(one.successes for one in parts), trials=sum(one.trials for one in parts))


def _of(name: str) -> str:
    lump = None if name not in PRESENT else tsis.load_phantom(name).inclusion
    return " " * 16 if lump is None else f"d {lump.diameter_mm:2g} mm, h {lump.depth_mm:g} mm"


def main() -> None:
    """Print the studies."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    protocols = ("flat-alone", "flat", "domed")
    parser.add_argument("--protocol", nargs="+", choices=protocols, default=protocols)
    parser.add_argument("--repetitions", type=int, default=REPETITIONS)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    print("\n".join(printed_lines()))
    results = []
    for name in options.protocol:
        for place in PLACES:
            with progress_bar(f"{name}, {place.name}") as progress:
                results.append(
                    run(
                        np.random.default_rng(options.seed),
                        repetitions=options.repetitions,
                        protocol=name,
                        place=place,
                        workers=options.workers,
                        progress=progress,
                    )
                )
            print("\n".join(["", *lines(results[-1])]), flush=True)
    print("\n".join(["", *table_2_1(), "Research use only"]))


if __name__ == "__main__":
    main()

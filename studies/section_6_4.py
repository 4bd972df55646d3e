"""Section 6.4: eight inclusions and eight blank places, found or not; the study repeated many times on a virtual bench.

The source prints 6 of 8 inclusions found, 7 of 8 blank places called so, and an area under the curve of 0.735. It names
neither size, depth nor modulus of its inclusions, no force, no score and no threshold. Here the phantoms detection-1 to
detection-8 (3, 5, 7 and 10 mm, 5 and 8 mm deep, 100 kPa, in tissue of 5 kPa, all assumed) and eight places of the same
tissue without any are pressed; the score is the probability of an inclusion, and the threshold 0.5 is fixed beforehand.
One study is one virtual probe with its own gain, stiffness, pattern and light; each press has its own force, stray
light and noise, and each reference place a modulus of its own. This is done twice: with the probe over the inclusion in
even tissue, and as in a search, up to 5 mm beside it in tissue of lumps that differ by up to a tenth
(`benchmarks.uneven_tissue`). `studies.section_6_4` says how presses are made.

What such a study can say at all is the point: with eight of each kind the intervals are wide, and that of the printed
area holds 0.5.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.searched_presses import COVERING_N, OFFSET_MM, UNEVEN_SD, MovingProbe
from benchmarks.simulated_presses import PROTOCOLS, Protocol
from benchmarks.uneven_tissue import Site, lump_changes, uneven
from studies.shown import Shown

import tsis
from tsis.cli.progress import progress_bar
from tsis.errors import TsisError
from tsis.files.cache import cached_arrays, content_key
from tsis.inclusion import estimate
from tsis.mechanics import press
from tsis.mechanics.mesh import mechanical_content
from tsis.model.press import PressField
from tsis.study.proportions import Counts, Proportion
from tsis.study.roc import Roc, newcombe_interval
from tsis.virtual.probe import FINE_RESOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.model.phantom import Phantom


PRINTED = Counts(true_positives=6, false_negatives=2, true_negatives=7, false_positives=1)
PRINTED_AREA = 0.735
# Table 2.1: sensitivity and specificity in per cent, with the source that the dissertation names for each row.
TABLE_2_1 = (
    ("Clinical breast examination", 57.14, 97.11, "Ratanachaikanont 2005"),
    ("Mammography", 68.6, 91.4, "Carney et al. 2003"),
    ("Doppler ultrasound", 68.1, 95.1, "Raza and Baum 1997"),
    ("Magnetic resonance imaging", 88.2, 67.7, "Bluemke et al. 2004"),
    ("Positron emission tomography", 96.4, 77.3, "Lind et al. 2004"),
    ("Thermography imaging", 97.3, 14.1, "Parisky et al. 2003"),
)


def printed_lines() -> list[str]:
    """What the printed numbers can mean."""
    sensitivity, specificity = PRINTED.sensitivity.interval(), PRINTED.specificity.interval()
    area = newcombe_interval(PRINTED_AREA, 8, 8)
    hit, false = PRINTED.sensitivity.value, 1 - PRINTED.specificity.value
    corner = np.trapezoid([0, hit, 1], [0, false, 1])
    least, most = hit * (1 - false), 1 - false * (1 - hit)
    steps = round(PRINTED_AREA * 128)
    return [
        "printed: sensitivity 75 %, 95 % interval " + percent(sensitivity.low, sensitivity.high),
        "printed: specificity 87.5 %, 95 % interval " + percent(specificity.low, specificity.high),
        f"printed: area {PRINTED_AREA:g}; with 8 + 8 targets its 95 % interval (Newcombe) is {area.low:.3f} to "
        f"{area.high:.3f}, which {'holds' if area.holds(0.5) else 'does not hold'} 0.5",
        f"  through the printed point alone lines enclose {corner:.4f}; no concave curve through it encloses less; "
        f"steps through it enclose {least:.3f} to {most:.3f}",
        f"  areas of 8 + 8 targets are multiples of 1/128, of which the nearest is {steps / 128:.6f}: not 0.735",
    ]


def percent(low: float, high: float) -> str:
    """Ends of an interval of a share."""
    return f"{100 * low:.1f} to {100 * high:.1f} %"


def table_2_1() -> list[str]:
    """Table 2.1 of the source, for context; without numbers of persons it has no intervals."""
    rows = [f"  {name:30} {hit:6.2f} % {empty:6.2f} %  {source}" for name, hit, empty, source in TABLE_2_1]
    return ["table 2.1 as printed, sensitivity and specificity, on persons and so not comparable with phantoms:", *rows]


def youden(rows: tuple[tuple[str, float, float, str], ...]) -> dict[str, float]:
    """Sensitivity and specificity less one, in per cent, of each row: 0 for chance, 100 without error."""
    return {f"{name}, sensitivity and specificity less one": hit + empty - 100 for name, hit, empty, _ in rows}


def draw(rows: tuple[tuple[str, float, float, str], ...], figure: Figure) -> None:
    """Table 2.1 as points; persons, so that no point of a study on phantoms stands among them."""
    axis = figure.subplots()
    for mark, (name, hit, empty, _) in zip("osD^vP", rows, strict=True):
        axis.plot(1 - empty / 100, hit / 100, mark, color="0.35", mfc="none", markersize=8, label=name)
    axis.plot([0, 1], [0, 1], ":", color="0.6", label="chance")
    axis.set(xlabel="1 - specificity", ylabel="sensitivity", xlim=(0, 1), ylim=(0, 1.05))
    axis.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=9)


SHOWN = (Shown(name="table-2-1", run=lambda _: TABLE_2_1, values=youden, draw=draw),)


BLANK = "detection-blank"
# Presses of the phantoms are solved at a few stiffnesses and forces and interpolated between, on a mesh that is finer
# and of another order than the estimator's. A probe's own stiffness, and the modulus of a reference place, only scale
# the moduli of the tissue, so one coordinate serves both; a press that covers the face is linear in its force.
LOG_SOFTER = (-0.15, -0.05, 0.05, 0.15)  # logarithms of tissue over nominal, at which presses are solved
FORCE_SHARES = (0.96, 1.04)  # of the commanded force


@lru_cache(maxsize=64)
def solved(probe_name: str, phantom_name: str, force_n: float) -> NDArray[np.float64]:
    """Pressure and displacement at the stiffnesses and forces of the grid, shape (4, 2, 2, n); kept on disk."""
    probe, phantom = tsis.load_probe(probe_name), tsis.load_phantom(phantom_name)

    def solve() -> dict[str, NDArray[np.float64]]:
        fields = [
            [
                press(probe, scaled(phantom, np.exp(log)), force_n=share * force_n, resolution=FINE_RESOLUTION)
                for share in FORCE_SHARES
            ]
            for log in LOG_SOFTER
        ]
        return {"fields": np.array([[[f.pressure_kpa, f.face_displacement_mm] for f in row] for row in fields])}

    content = {
        "probe": mechanical_content(probe),
        "phantom": repr(phantom),
        "force": force_n,
        "grid": [*LOG_SOFTER, *FORCE_SHARES],
    }
    return cached_arrays("section-6-4", content_key(content), solve)["fields"]


def scaled(phantom: Phantom, factor: float) -> Phantom:
    """The phantom with every modulus times a factor."""
    lump = phantom.inclusion
    stiffer = None if lump is None else replace(lump, young_kpa=float(factor) * lump.young_kpa)
    return replace(phantom, young_kpa=float(factor) * phantom.young_kpa, inclusion=stiffer)


def between(probe_name: str, phantom_name: str, *, nominal_n: float, log_softer: float, force_n: float) -> PressField:
    """A press of the phantom with moduli times ``exp(log_softer)``, interpolated between those that were solved."""
    fields = solved(probe_name, phantom_name, nominal_n)
    nodes = np.array(LOG_SOFTER)
    log = float(np.clip(log_softer, *nodes[[0, -1]]))
    cubic = [np.prod([(log - other) / (node - other) for other in nodes if other != node]) for node in nodes]
    low, high = FORCE_SHARES
    share = (force_n / nominal_n - low) / (high - low)
    pressure, moved = np.einsum("s,f,sfqn->qn", cubic, [1 - share, share], fields)
    radius = np.linspace(0.0, tsis.load_probe(probe_name).radius_mm, len(pressure))
    return PressField(
        radius_mm=radius, pressure_kpa=pressure, face_displacement_mm=moved, approach_mm=0.0, force_n=force_n
    )


class PreparedProbe(MovingProbe):
    """A virtual probe whose round presses were solved before: it makes all its errors, and no mechanics."""

    phantom_name: str = BLANK
    nominal_n: float = 1.0

    def press_prepared(self, phantom_name: str, site: Site, force_n: float) -> tsis.TactileImage:
        """One frame of a site whose tissue and inclusion are those of a phantom, all moduli times one factor."""
        self.phantom_name, self.nominal_n = phantom_name, force_n
        return self.press_site(site, force_n=force_n)

    def _round_press(self, phantom: Phantom, force_n: float) -> PressField:
        name = BLANK if phantom.inclusion is None else self.phantom_name
        nominal = tsis.load_phantom(name).young_kpa
        return between(
            self.probe.name,
            name,
            nominal_n=self.nominal_n,
            log_softer=float(np.log(phantom.young_kpa / nominal)),
            force_n=force_n,
        )


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

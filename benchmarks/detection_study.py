"""How well are inclusions found? A large virtual study, half of its targets blank, every nuisance drawn.

    python -m benchmarks.detection_study --targets 2000 --seed 1 --workers 2 --out /tmp/study

`benchmarks.searched_presses` says how targets are drawn and pressed: sizes of 2 to 15 mm, depths of 4 to 12 mm, moduli
of 40 to 120 kPa, up to 5 mm beside the axis, in tissue whose lumps differ by up to 10 per cent (`--uneven`). Judged are
areas under the curve, the detection limit over size and depth, and probabilities. With ``--out`` a figure is drawn, and
``reach.csv`` written, the table of reaches that a scan plan takes. Every finished target is kept, so a run that was cut
off goes on where it stopped; targets of other settings or another code are never mixed in. Ends with 1 when the area
under the curve is below 0.95 for inclusions of at least 5 mm at most 8 mm deep.
"""

from __future__ import annotations

import os
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from benchmarks.coverage import code
from benchmarks.harness import Bench, Choice, Goal, append_line, read_lines, show
from benchmarks.searched_presses import COVERING_N, PRIOR, UNEVEN_SD, draw, examine
from benchmarks.simulated_presses import PROTOCOLS
from benchmarks.uneven_tissue import lump_changes
from matplotlib.figure import Figure

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli.progress import progress_bar
from tsis.errors import InputError, TsisError
from tsis.files.cache import cache_folder, content_key
from tsis.inclusion import estimate
from tsis.inclusion.flags import NEARLY_CERTAIN, UNTRUSTED_FLAGS
from tsis.model.estimate import ABSENCE_FLAG
from tsis.study.probabilities import brier_interval, brier_score, recalibration, reliability_curve
from tsis.study.proportions import Proportion
from tsis.study.roc import Roc, at_specificity
from tsis.study.search import detection_range_of_trials

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

SITE_SD = 0.03  # as calibrations state
DIAMETERS_MM = (2.0, 3.5, 5.0, 7.0, 9.0, 12.0, 15.0)  # ends of the map's cells
DEPTHS_MM = (4.0, 6.0, 8.0, 10.0, 12.0)
WITHIN = (5.0, 8.0)  # at least so large and at most so deep is where the area is wanted
WANTED = f"d >= {WITHIN[0]:g} mm, h <= {WITHIN[1]:g} mm"
AREA = 0.95
SPECIFICITIES = (0.9, 0.95)
REACHED = 0.9  # probability with which an inclusion is found as far beside the axis as the table says
FARTHEST_OUT = 1 - 1e-12  # a probability that is nearer to 0 or 1 counts as this for slopes of logits


def judge(protocol_name: str, seed: int, index: int, uneven_most: float) -> dict[str, Any]:
    """Draw, press, estimate; a line with the truth beside what was said."""
    protocol = PROTOCOLS[protocol_name]
    target = draw(seed, index, site_sd=SITE_SD, uneven_most=uneven_most)
    drawn = target.drawn
    line: dict[str, Any] = {
        "index": index,
        "present": target.inclusion is not None,
        "truth": [drawn.diameter_mm, drawn.depth_mm, drawn.young_kpa],
        "offset_mm": float(np.hypot(*drawn.offset_mm)),
        "uneven_sd": target.uneven_sd,
    }
    try:
        case = examine(target, protocol, seed=seed)
        found = estimate(
            case.frames,
            probe=protocol.probe,
            calibration=case.calibration,
            reference=case.references,
            prior=PRIOR,
            strain=protocol.strain,
        )
    except TsisError as error:
        return line | {"refused": str(error)}
    said = {"presence": found.presence, "evidence": found.log_bayes_factor}
    return line | said | {"trusted": found.trusted, "flags": list(found.flags)}


def run(bench: Bench, out: Path, progress: Callable[[int, int], None]) -> list[dict[str, Any]]:
    """Lines of all targets, those that ``out`` holds already and the rest."""
    found = read_lines(out, "index")
    missing = [index for index in range(bench.targets) if index not in found]
    lump_changes(PROTOCOLS[bench.protocol].probe, COVERING_N)  # before workers share what is kept of them
    with ProcessPoolExecutor(max_workers=bench.workers) as pool:
        tasks = [pool.submit(judge, bench.protocol, bench.seed, index, bench.uneven) for index in missing]
        for future in as_completed(tasks):
            line = future.result()
            append_line(out, line)
            found[line["index"]] = line
            progress(len(found), bench.targets)
    return [found[index] for index in range(bench.targets)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Searched:
    """Targets that were judged.

    Attributes
    ----------
    present
        Whether a target holds an inclusion, shape (n,).
    presence
        Probability of an inclusion that its estimate gave, shape (n,); hundreds of nats of evidence are rounded to 1.
    evidence
        Natural logarithm of how much better an inclusion explains its frames, before that is rounded, shape (n,).
    truth
        Diameter, depth and modulus as drawn, for blanks of what was left out, shape (n, 3).
    offset_mm
        Distance from the axis that was drawn, shape (n,).
    """

    present: NDArray[np.bool_]
    presence: NDArray[np.float64]
    evidence: NDArray[np.float64]
    truth: NDArray[np.float64]
    offset_mm: NDArray[np.float64]

    @classmethod
    def of(cls, lines: Iterable[Mapping[str, Any]]) -> Searched:
        """From lines of `judge` whose estimate was not refused."""
        every = list(lines)
        columns = {
            name: np.array([line[name] for line in every], dtype=float)
            for name in ("presence", "evidence", "offset_mm")
        }
        return cls(
            present=np.array([line["present"] for line in every], dtype=bool),
            truth=np.array([line["truth"] for line in every], dtype=float).reshape(-1, 3),
            **columns,
        )

    @property
    def wanted(self) -> NDArray[np.bool_]:
        """Blanks, and the inclusions for which the area is wanted."""
        return ~self.present | ((self.truth[:, 0] >= WITHIN[0]) & (self.truth[:, 1] <= WITHIN[1]))

    def curve(self, among: NDArray[np.bool_] | None = None, score: NDArray[np.float64] | None = None) -> Roc:
        """Curve of a score, by default the evidence, over some of the targets."""
        kept = np.ones(len(self.present), dtype=bool) if among is None else among
        return Roc.of((self.evidence if score is None else score)[kept], self.present[kept])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectionLimit:
    """How many inclusions of a size and depth are found, by a threshold that other blanks chose.

    Attributes
    ----------
    wanted
        Specificity that the threshold was chosen for.
    specificity
        On the blanks that had no part in the choice.
    found
        Of each cell of `DIAMETERS_MM` and `DEPTHS_MM`, None where no target fell.
    """

    wanted: float
    specificity: Proportion
    found: tuple[tuple[Proportion | None, ...], ...]
    decided: NDArray[np.bool_]


def detection_limit(searched: Searched, wanted: float) -> DetectionLimit:
    """Choose a threshold on every other blank; judge it on the other blanks and all inclusions; then change places.

    Every blank is decided once, by a threshold that it had no part in; inclusions are decided by the threshold of one
    half or the other in turn.
    """
    said = searched.evidence
    half = np.empty(len(said), dtype=int)
    for kind in (True, False):
        half[searched.present == kind] = np.arange(np.count_nonzero(searched.present == kind)) % 2
    decided = np.empty(len(said), dtype=bool)
    for part in (0, 1):
        choosing = searched.present | (half == part)
        point = at_specificity(Roc.of(said[choosing], searched.present[choosing]), wanted)
        decided[half != part] = point.decide(said[half != part])
    blanks = ~searched.present
    size, depth = (
        np.digitize(searched.truth[:, axis], ends[1:-1]) for axis, ends in ((0, DIAMETERS_MM), (1, DEPTHS_MM))
    )

    def cell(i: int, j: int) -> Proportion | None:
        here = searched.present & (size == i) & (depth == j)
        return _share(decided & here, here) if here.any() else None

    return DetectionLimit(
        wanted=wanted,
        specificity=_share(~decided & blanks, blanks),
        found=tuple(tuple(cell(i, j) for j in range(len(DEPTHS_MM) - 1)) for i in range(len(DIAMETERS_MM) - 1)),
        decided=decided,
    )


def _share(successes: NDArray[np.bool_], trials: NDArray[np.bool_]) -> Proportion:
    return Proportion(successes=int(np.count_nonzero(successes)), trials=int(np.count_nonzero(trials)))


def reaches(searched: Searched, limit: DetectionLimit, *, probability: float) -> list[tuple[float, float, float]]:
    """Diameter, depth and how far beside the axis inclusions are found with a probability, cell by cell.

    A cell's row names its smallest diameter and greatest depth: those of its inclusions that are hardest to find. No
    cell is said to reach farther than one of larger, shallower inclusions: chance in few trials promises nothing.
    """
    size, depth = searched.truth[:, 0], searched.truth[:, 1]

    def reach(low: float, high: float, top: float, bottom: float) -> float:
        here = searched.present & (size >= low) & (size < high) & (depth >= top) & (depth < bottom)
        if not here.any():
            return 0.0
        return detection_range_of_trials(searched.offset_mm[here], limit.decided[here], probability=probability)

    table = np.array([[reach(*sizes, *depths) for depths in pairwise(DEPTHS_MM)] for sizes in pairwise(DIAMETERS_MM)])
    table = np.minimum.accumulate(np.minimum.accumulate(table[::-1], axis=0)[::-1], axis=1)
    return [
        (low, bottom, float(table[i, j]))
        for i, low in enumerate(DIAMETERS_MM[:-1])
        for j, bottom in enumerate(DEPTHS_MM[1:])
    ]


class Table(Protocol):
    """Prints a table, as `benchmarks.harness.Bench.table` does."""

    def __call__(self, title: str, heads: Sequence[str], rows: Iterable[Sequence[str]], /) -> None:
        """Print it."""


def report(
    lines: Sequence[Mapping[str, Any]], table: Table = show
) -> tuple[Searched, tuple[DetectionLimit, ...], list[Goal]]:
    """Print the tables of a study; what was judged, the limits, and the wanted area."""
    kept = [line for line in lines if "refused" not in line]
    searched = Searched.of(kept)
    refused = [line["present"] for line in lines if "refused" in line]
    print(f"refused: {len(refused)} of {len(lines)}, {sum(refused)} of them inclusions")
    curves = {
        "all, by evidence": searched.curve(),
        f"{WANTED}, by evidence": searched.curve(searched.wanted),
        "all, by probability as it is told": searched.curve(score=searched.presence),
        f"{WANTED}, by probability as it is told": searched.curve(searched.wanted, searched.presence),
    }
    rows = [(name, *area_cells(curve)) for name, curve in curves.items()]
    table("Area under the curve", ("targets", "inclusions, blanks", "area", "95 % interval", "method"), rows)
    limits = tuple(detection_limit(searched, wanted) for wanted in SPECIFICITIES)
    for limit in limits:
        ends = limit.specificity.interval()
        table(
            f"Sensitivity at specificity {limit.wanted:g}: on other blanks {limit.specificity.value:.3f}"
            f" ({ends.low:.3f} to {ends.high:.3f})",
            ["diameter / mm", *(f"h {low:g} to {high:g} mm" for low, high in pairwise(DEPTHS_MM))],
            [
                [f"{low:g} to {high:g}", *map(share_cell, row)]
                for (low, high), row in zip(pairwise(DIAMETERS_MM), limit.found, strict=True)
            ],
        )
    probabilities(searched, kept, table)
    (goal,) = (
        Goal(name=f"area, {name}", value=curve.auc, least=AREA, form="{:.4f}")
        for name, curve in curves.items()
        if name == f"{WANTED}, by evidence"
    )
    return searched, limits, [goal]


def area_cells(curve: Roc) -> tuple[str, str, str, str]:
    """How many, the area, its interval, and by which method."""
    within = curve.auc_interval()
    ends = f"{within.low:.4f} to {within.high:.4f}"
    return f"{curve.targets}, {curve.blanks}", f"{curve.auc:.4f}", ends, within.method


def share_cell(one: Proportion | None) -> str:
    """A share with Wilson's interval and the number of targets."""
    if one is None:
        return "-"
    low, high = one.interval()
    return f"{one.value:.2f} ({low:.2f}-{high:.2f}), {one.trials}"


def probabilities(searched: Searched, kept: Sequence[Mapping[str, Any]], table: Table) -> None:
    """Reliability, Brier score, slope of the logits, and blanks that are told to be nearly certain."""
    said, there = searched.presence, searched.present
    rows = [
        (f"{one.probability:.3g}", *share_cell(one.observed).rsplit(", ", 1))
        for one in reliability_curve(said, there).bins
    ]
    table("Of those told so probable, how many hold an inclusion", ("probability", "share", "targets"), rows)
    within = brier_interval(said, there, rng=np.random.default_rng(0), draws=1000)
    print(f"Brier score {brier_score(said, there).score:.4f} ({within.low:.4f} to {within.high:.4f})")
    try:
        fitted = recalibration(np.clip(said, 1 - FARTHEST_OUT, FARTHEST_OUT), there)
        print(f"calibration slope {fitted.slope.value:.3f}, in the large {fitted.in_the_large.value:+.3f}")
    except InputError as error:
        print(f"no calibration slope: {error}")
    blanks = [line for line in kept if not line["present"]]
    bold = [line for line in blanks if line["presence"] > NEARLY_CERTAIN]
    undoubted = sum((UNTRUSTED_FLAGS - {ABSENCE_FLAG}).isdisjoint(line["flags"]) for line in bold)
    print(f"blanks told more than {NEARLY_CERTAIN:g}: {len(bold)} of {len(blanks)}, {undoubted} of them without a flag")


def figure_of(searched: Searched, limits: Sequence[DetectionLimit]) -> Figure:
    """The limit at both specificities, the curve, and the reliability of the probabilities."""
    sheet = Figure(figsize=(13.0, 8.0), layout="constrained")
    ((looser, stricter), (curve, reliability)) = sheet.subplots(2, 2)
    for ax, limit in zip((looser, stricter), limits, strict=True):
        _map(sheet, ax, limit)
    for label, among in (("all", None), (WANTED, searched.wanted)):
        found = searched.curve(among)
        curve.step(found.false_positive_rate, found.true_positive_rate, where="post", label=f"{label}: {found.auc:.3f}")
    curve.set(xlabel="1 - specificity", ylabel="sensitivity", title="curve and its area, by evidence")
    curve.legend(fontsize=8)
    bins = reliability_curve(searched.presence, searched.present).bins
    share = np.array([one.observed.value for one in bins])
    ends = np.array([list(one.observed.interval()) for one in bins])
    place = [one.probability for one in bins]
    reliability.errorbar(place, share, yerr=np.abs(ends - share[:, None]).T, fmt="o", capsize=3)
    reliability.set(xlabel="probability as told", ylabel="share with an inclusion", title="reliability")
    for ax in (curve, reliability):
        ax.plot([0, 1], [0, 1], ":", color="#999999")
    sheet.supxlabel(RESEARCH_USE_ONLY, fontsize=8)
    return sheet


def _map(sheet: Figure, ax: Any, limit: DetectionLimit) -> None:
    shares: NDArray[np.float64] = np.array(
        [[np.nan if one is None else one.value for one in row] for row in limit.found]
    )
    picture = ax.pcolormesh(DIAMETERS_MM, DEPTHS_MM, shares.T, vmin=0, vmax=1, cmap="cividis", edgecolors="white")
    sheet.colorbar(picture, ax=ax, label="sensitivity")
    for (left, right), row in zip(pairwise(DIAMETERS_MM), limit.found, strict=True):
        for (low, high), one in zip(pairwise(DEPTHS_MM), row, strict=True):
            if one is not None:
                colour = "black" if one.value > 0.5 else "white"
                text = f"{one.value:.2f}\nn {one.trials}"
                ax.text((left + right) / 2, (low + high) / 2, text, ha="center", va="center", color=colour, fontsize=7)
    ax.invert_yaxis()
    ax.set(xlabel="diameter / mm", ylabel="depth / mm")
    ax.set_title(f"specificity {limit.specificity.value:.3f} (wanted {limit.wanted:g}) on other blanks", fontsize=10)


def main() -> int:
    """Run what is missing, print the tables; 1 when the wanted area is missed."""
    bench = Bench(
        __doc__,
        protocol=Choice(("domed", "flat", "flat-alone"), "domed"),
        targets=2000,
        uneven=UNEVEN_SD,
        seed=1,
        workers=os.cpu_count(),
        bank=cache_folder() / "detection",
    )
    decided_by = {name: getattr(bench, name) for name in ("protocol", "seed", "uneven")}
    kept_in = bench.bank / f"{content_key(decided_by | {'tsis': tsis.__version__, 'code': code()})}.jsonl"
    with progress_bar("searching") as progress:
        lines = run(bench, kept_in, progress)
    searched, limits, goals = report(lines, bench.table)
    if bench.out is not None:
        bench.out.mkdir(parents=True, exist_ok=True)
        rows = [f"{d:g},{h:g},{reach:.3f}" for d, h, reach in reaches(searched, limits[0], probability=REACHED)]
        (bench.out / "reach.csv").write_text("\n".join(["diameter_mm,depth_mm,reach_mm", *rows, ""]))
        figure_of(searched, limits).savefig(bench.out / "detection.png", dpi=130)
    return bench.end(goals)


if __name__ == "__main__":
    sys.exit(main())

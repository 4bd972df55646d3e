"""How well and how fast points are matched, beside other programs, on the same trials in one run.

    python -m benchmarks.matching [--data FOLDER] [--trials 10] [--methods tprl,cpd,pycpd] [--only distorted]
                                  [--rows FILE]

One thread. The public trials and the hotel sequence are read from ``--data``; where they are missing, shapes are
generated and the hotel is left out. pycpd and probreg take part where they are installed. With ``--rows`` an
interrupted run goes on. Errors are root-mean-square distances of the moved points from their true, noise-free places;
a match has failed above 0.1 of the unit box, in the hotel above 5 pixels. Silent: failed, and the method trusted its
answer; withheld: it did not trust it, so that `tsis.matching.register` would keep it back. It is judged all the same.
"""

from __future__ import annotations

import statistics
import sys
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, Goal, Several
from benchmarks.matching.distort import SHAPES, Distortion, distort, even_texture, public_distortion
from benchmarks.matching.methods import OWN_METHODS, PEERS, RIVAL_METHODS, BenchmarkMethod
from benchmarks.matching.runs import run_trials
from benchmarks.matching.summary import FAILURE_RMS, summarise, summarise_pooled
from benchmarks.matching.trials import DATA, distorted_set, hotel_set

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from benchmarks.matching.distort import Trial
    from benchmarks.matching.runs import TrialRow
    from benchmarks.matching.summary import TrialSummary

JUDGED = "tprl"
PARTS = ("distorted", "hotel", "textures", "speed")
HOTEL_FAILURE_PX = 5.0
RATIO_GOALS = {"deformation": 0.5, "outliers": 0.5, "rotation": 0.05, "noise": 1.0, "occlusion": 1.0}
TEXTURE_POINTS, TEXTURE_TARGETS = 1000, (1000, 2000, 3000, 4000)
SPEED_POINTS = (105, 200, 400, 700, 1000, 1400, 2000)
# as slow as their like, and no better there
SLOW = ("pycpd-common", "pycpd-outliers", "pycpd-raw", "biocpd-common", "biocpd-outliers", "probreg-common")


def texture_trials(count: int, *, sizes: Sequence[int] = TEXTURE_TARGETS, seed: int = 0) -> Iterator[Trial]:
    """Textures of 1,000 points against as many, and up to 3,000 outliers more."""
    for size in sizes:
        for number in range(count):
            rng = np.random.default_rng([seed, size, number])
            ratio = size / TEXTURE_POINTS - 1
            shape = even_texture(TEXTURE_POINTS, rng=rng)
            bent = Distortion(bending=0.05, affine=0.1, outlier_ratio=ratio)
            yield distort(shape, bent, rng=rng, name=f"texture/outliers/{size}/{number}")


def speed_trials(count: int, *, seed: int = 0) -> Iterator[Trial]:
    """Shapes of growing numbers of points, deformed and turned by 30 degrees."""
    for size in SPEED_POINTS:
        for number in range(count):
            yield speed_trial(size, number, seed=seed)


def speed_trial(size: int, number: int, *, seed: int = 0) -> Trial:
    """One of them."""
    rng = np.random.default_rng([seed, size, number])
    shape = SHAPES["strokes"](size, rng=rng)
    return distort(shape, public_distortion("rotation", 2), rng=rng, name=f"speed/points/{size}/{number}")


def exponent(points: Sequence[float], seconds: Sequence[float]) -> float:
    """Slope of log time over log number of points.

    Examples
    --------
    >>> round(exponent([100, 200, 400], [1.0, 4.0, 16.0]), 6)
    2.0
    """
    return float(np.polyfit(np.log(points), np.log(seconds), 1)[0])


def distorted_goals(pooled: Sequence[TrialSummary]) -> Iterator[Goal]:
    """The ratio of means to the best coherent point drift, a line a kind of distortion."""
    for each in pooled:
        if each.method == JUDGED and each.group in RATIO_GOALS and each.ratio is not None:
            yield Goal(
                name=f"{each.group}: mean RMS over that of the best CPD",
                value=each.ratio.value,
                most=RATIO_GOALS[each.group],
                form="{:.3f}",
                peer=f"[{each.ratio.low:.3f}, {each.ratio.high:.3f}]",
            )


def hotel_goals(levels: Sequence[TrialSummary]) -> Iterator[Goal]:
    """Mean RMS without hidden landmarks, and with 30 % of them beside the best coherent point drift."""
    cells: dict[tuple[str, str], list[float]] = defaultdict(list)
    for each in levels:
        cells[each.group, each.method].append(each.mean)
    means = {cell: float(np.mean(found)) for cell, found in cells.items()}
    clear, hidden = "hotel/hidden 0", "hotel/hidden 0.3"
    if (clear, JUDGED) not in means:
        return
    yield Goal(name="hotel, mean over separations, px", value=means[clear, JUDGED], most=1.0, form="{:.3f}")
    rivals = [means[hidden, name] for name in RIVAL_METHODS if (hidden, name) in means]
    if rivals:
        best = min(rivals)
        yield Goal(
            name="hotel, 30 % hidden, px",
            value=means[hidden, JUDGED],
            most=np.nextafter(best, 0.0),
            form="{:.3f}",
            peer=f"best CPD {best:.3f}",
        )


def time_goals(rows: Sequence[TrialRow]) -> Iterator[Goal]:
    """Median times at 105 x 105, 1,000 x 1,000 and 1,000 x 4,000."""
    for group, level, limit in (
        ("speed/points", "105", 0.12),
        ("texture/outliers", "1000", 1.0),
        ("texture/outliers", "4000", 3.0),
    ):
        own = [row.seconds for row in rows if (row.group, row.level, row.method) == (group, level, JUDGED)]
        if own:
            first = "105" if level == "105" else str(TEXTURE_POINTS)
            yield Goal(name=f"{first} x {level} points, s", value=statistics.median(own), most=limit, form="{:.3f}")


def growth(rows: Sequence[TrialRow]) -> list[list[str]]:
    """Median time of each method at each number of points, and the exponent from 200 points on."""
    speed = [row for row in rows if row.group == "speed/points"]
    lines = []
    for method in dict.fromkeys(row.method for row in speed):
        middle = {
            size: statistics.median(row.seconds for row in speed if row.method == method and row.level == str(size))
            for size in SPEED_POINTS
        }
        sizes = [size for size in SPEED_POINTS if size >= 200]
        times = [f"{1000 * middle[size]:,.0f} ms" for size in SPEED_POINTS]
        lines.append([method, *times, f"{exponent(sizes, [middle[size] for size in sizes]):.2f}"])
    return lines


def line(each: TrialSummary) -> list[str]:
    """A summary as cells."""
    ratio = "-" if each.ratio is None else f"{each.ratio.value:.2f} [{each.ratio.low:.2f}, {each.ratio.high:.2f}]"
    return [
        f"{each.group} {each.level}".strip(),
        each.method,
        str(each.trials),
        f"{each.median:.4f}",
        f"{each.mean:.4f}",
        f"{each.failures:.0%}",
        "-" if each.unannounced is None else f"{each.unannounced:.0%}",
        "-" if each.withheld is None else f"{each.withheld:.0%}",
        ratio,
        f"{1000 * each.seconds:,.0f} ms",
    ]


HEADS = (
    "trials",
    "method",
    "number",
    "median",
    "mean",
    "failed",
    "silent",
    "withheld",
    "mean over best CPD [95 %]",
    "time",
)


def main() -> int:
    """Measure and print."""
    bench = Bench(
        __doc__, data=DATA, trials=10, methods=",".join((*OWN_METHODS, *PEERS)), only=Several(PARTS), rows=Path
    )
    data = bench.data if bench.data.is_dir() else None
    named = {name: BenchmarkMethod(name=name) for name in bench.methods.split(",")}
    present = {name: each for name, each in named.items() if not each.absent()}
    parts = bench.only or PARTS
    rows: list[TrialRow] = []
    for part in parts:
        trials, chosen = _part(part, data, bench.trials), present
        if part in ("textures", "speed"):
            chosen = {name: each for name, each in present.items() if name not in SLOW}
        rows += run_trials(trials, chosen, file=bench.rows)
    absent = [f"{name}: {each.absent()}" for name, each in named.items() if each.absent()]
    return bench.end(report(bench, rows, data=data, absent=absent))


def _part(part: str, data: Path | None, count: int) -> list[Trial]:
    if part == "distorted":
        return distorted_set(data, count=count)
    if part == "hotel":
        return [] if data is None else hotel_set(data, count=count)
    return list(texture_trials(min(count, 3)) if part == "textures" else speed_trials(min(count, 3)))


def report(bench: Bench, rows: Sequence[TrialRow], *, data: Path | None, absent: Sequence[str]) -> list[Goal]:
    """Print every table, and what was left out; the goals."""
    distorted = [row for row in rows if row.trial.split("/")[0] not in ("hotel", "texture", "speed")]
    hotel = [row for row in rows if row.trial.startswith("hotel")]
    textures = [row for row in rows if row.trial.startswith("texture")]
    pooled = summarise_pooled(distorted, rivals=RIVAL_METHODS, failure=FAILURE_RMS)
    hotel_levels = summarise(hotel, rivals=RIVAL_METHODS, failure=HOTEL_FAILURE_PX)
    shown = [*pooled, *summarise_pooled(hotel, rivals=RIVAL_METHODS, failure=HOTEL_FAILURE_PX)]
    shown += summarise(textures, rivals=RIVAL_METHODS, failure=FAILURE_RMS)
    source = "generated shapes" if data is None else "public trials"
    bench.table(f"RMS errors, {source}; hidden: hotel, pixels", HEADS, map(line, shown))
    bench.table("Levels", HEADS, map(line, summarise(distorted, rivals=RIVAL_METHODS)))
    if any(row.group == "speed/points" for row in rows):
        heads = ("method", *(f"{size} x {size}" for size in SPEED_POINTS), "exponent from 200")
        bench.table("Time", heads, growth(rows))
    for name in absent:
        print(f"Left out: {name}.")
    return [*distorted_goals(pooled), *hotel_goals(hotel_levels), *time_goals(rows)]


if __name__ == "__main__":
    sys.exit(main())

"""Figure 6.23: the receiver operating characteristic of the study with eight inclusions and eight blank places.

The source prints one point, 6 of 8 inclusions found and 7 of 8 blank places called so, and an area of 0.735, and
neither score nor threshold. `studies.section_6_4` says what is assumed instead and repeats the study; here that is done
as in a search, the probe up to 5 mm beside the inclusion in uneven tissue, with one press a target and with a second
one on tissue nearby. Both ways meet the same targets.

Found: with one press about three quarters of the inclusions are found, as printed, with hardly a false alarm; with a
reference press more of them, and a quarter of the blanks. Either area is larger than the printed one, whose interval
holds 0.5: sixteen targets cannot tell.
"""

from __future__ import annotations

from copy import deepcopy
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from studies.section_6_4 import PLACES, PRINTED, PRINTED_AREA, TRUTH, Result, run
from studies.shown import Shown

from tsis.study.roc import Roc, newcombe_interval

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure

WAYS = {"flat-alone": "one press", "flat": "with a reference press"}
REPETITIONS = {"flat-alone": 12, "flat": 8}
COLOURS = {"flat-alone": "#0072b2", "flat": "#009e73"}


def studies(rng: np.random.Generator, *, repetitions: Mapping[str, int]) -> list[Result]:
    """Repeat the study in each way, with the same probes and targets."""
    return [
        run(deepcopy(rng), repetitions=number, protocol=protocol, place=PLACES[1])
        for protocol, number in repetitions.items()
    ]


def values(results: Sequence[Result]) -> dict[str, float]:
    """Shares in per cent and areas of each way, and what the printed numbers can mean."""
    out = {}
    for result in results:
        way = WAYS[result.protocol.name]
        decided = (result.scores >= 0.5) == TRUTH
        out[f"specificity, {way}"] = 100 * float(decided[:, ~TRUTH].mean())
        out[f"sensitivity, {way}"] = 100 * float(decided[:, TRUTH].mean())
        out[f"area of a study, mean, {way}"] = float(result.areas.mean())
    sensitivity, area = PRINTED.sensitivity.interval(), newcombe_interval(PRINTED_AREA, 8, 8)
    out["printed sensitivity, lower end of its 95 % interval"] = 100 * sensitivity.low
    out["printed area, lower end of its 95 % interval"] = area.low
    out["printed area, upper end of its 95 % interval"] = area.high
    return out


def draw(results: Sequence[Result], figure: Figure) -> None:
    """Curves of all studies of each way together, and the printed point with its intervals."""
    ax, areas = figure.subplots(1, 2)
    for result in results:
        curve = Roc.of(result.scores.ravel(), np.tile(TRUTH, len(result.scores)))
        colour = COLOURS[result.protocol.name]
        ax.step(curve.false_positive_rate, curve.true_positive_rate, where="post", color=colour,
                label=f"{WAYS[result.protocol.name]}, {len(result.scores)} studies")  # fmt: skip
    hit, empty = PRINTED.sensitivity, PRINTED.specificity
    low, high = hit.interval()
    left, right = 1 - empty.interval().high, 1 - empty.interval().low
    x, y = 1 - empty.value, hit.value
    ax.errorbar([x], [y], xerr=[[x - left], [right - x]], yerr=[[y - low], [high - y]], fmt="o", capsize=4,
                color="#d55e00", mfc="white", label="printed, with 95 % intervals")  # fmt: skip
    ax.plot([0, 1], [0, 1], ":", color="#999999")
    ax.set(xlabel="1 - specificity", ylabel="sensitivity", xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
    ax.legend(loc="lower right", fontsize=8)
    for row, result in enumerate(results):
        areas.plot(result.areas, [-row] * len(result.areas), "o", color=COLOURS[result.protocol.name], alpha=0.4)
    area = newcombe_interval(PRINTED_AREA, 8, 8)
    ends = [[PRINTED_AREA - area.low], [area.high - PRINTED_AREA]]
    areas.errorbar([PRINTED_AREA], [-len(results)], xerr=ends, fmt="o", color="#d55e00", mfc="white", capsize=4)
    names = [*(WAYS[result.protocol.name] for result in results), "printed, 95 %"]
    areas.set_yticks([-float(row) for row in range(len(names))], names)
    areas.axvline(0.5, color="#999999", linestyle=":")
    areas.set(xlabel="area under the curve of a study", xlim=(0.4, 1.03), ylim=(-len(results) - 0.5, 0.5))


SHOWN = (
    Shown(
        name="figure-6-23",
        run=partial(studies, repetitions=REPETITIONS),
        values=values,
        draw=draw,
        short=partial(studies, repetitions={}),  # what is printed, alone: presses take too long for every test run
    ),
)

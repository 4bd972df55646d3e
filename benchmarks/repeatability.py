"""Repeatability of the virtual instrument, and the same readings by an independent package.

    python -m benchmarks.repeatability --folder FOLDER --phantoms 20 --repeats 3 --seed 81

One virtual probe, two operators: each reads every phantom blind, `random_targets` of the seed, with errors of force,
pattern, stray light and reference site of its own in each reading. The study stays in FOLDER; ``tsis study
repeatability FOLDER`` writes its page. Beside the product's within-subject standard deviation, and that between
operators, stand those from the analysis of variance by statsmodels.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from benchmarks.harness import Bench, Choice
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm

import tsis
from tsis.cli.progress import progress_bar
from tsis.study.card import OPERATORS, analyse_precision, press_by_operators
from tsis.study.folder import new_study, open_study, random_targets
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from tsis.study.card import Precision
    from tsis.study.folder import Study

NAMES = ("A", "B")
HEADS = (
    "quantity",
    "phantoms",
    "within-subject sd",
    "statsmodels",
    "operators' sd",
    "statsmodels",
    "coefficient",
    "CV",
)


def read_study(folder: Path, *, phantoms: int, repeats: int, seed: int, probe: str, strain: str) -> Study:
    """The study in a folder, read and unblinded; what is there already is taken up."""
    if folder.exists():
        study = open_study(folder)
    else:
        targets = random_targets(phantoms, 0, rng=np.random.default_rng([seed, 1]))
        study = new_study(folder, targets, seed=seed, probe=probe, repeats=repeats, name="repeatability")
    if study.unblinded is not None:
        return study
    virtual = VirtualProbe(tsis.load_probe(probe), rng=np.random.default_rng([seed, 2]), strain=strain)
    with progress_bar("operators read") as progress:
        return press_by_operators(study, virtual=virtual, operators=NAMES, seed=seed, strain=strain, progress=progress)


def by_statsmodels(study: Study, found: Precision) -> tuple[float, float]:
    """Standard deviations within subjects and of operators, by a balanced analysis of variance of two factors."""
    rows = pd.DataFrame(
        [
            {"y": item.values[found.quantity], "target": item.code, "operator": item.operator}
            for item in study.readings
            if item.code in found.complete
        ]
    )
    square = anova_lm(ols("y ~ C(target) * C(operator)", rows).fit())["mean_sq"]
    readings = found.repeats * len(found.complete)
    operators = max((square["C(operator)"] - square["C(target):C(operator)"]) / readings, 0.0)
    return math.sqrt(square["Residual"]), math.sqrt(operators)


def main() -> int:
    """Read the phantoms and print the table."""
    bench = Bench(
        __doc__,
        folder=Path("repeatability"),
        phantoms=20,
        repeats=3,
        seed=1,
        probe="tsis-domed",
        strain=Choice(("finite", "small"), "small"),
    )
    study = read_study(
        bench.folder,
        phantoms=bench.phantoms,
        repeats=bench.repeats,
        seed=bench.seed,
        probe=bench.probe,
        strain=bench.strain,
    )
    analysis = analyse_precision(study)
    rows = []
    for found in (item for item in analysis.results if item.over == OPERATORS):
        within, operators = by_statsmodels(study, found)
        ours = math.nan if found.between is None else found.between.operator_sd
        numbers = (found.within.within_sd, within, ours, operators, found.within.coefficient)
        cv = math.nan if found.within.within_cv is None else found.within.within_cv
        rows.append(
            [found.quantity, str(len(found.complete)), *(f"{value:.6g}" for value in numbers), f"{100 * cv:.2f} %"]
        )
    title = f"{bench.phantoms} phantoms, 2 operators, {bench.repeats} repeats, {bench.probe}, seed {bench.seed}"
    bench.table(title, HEADS, rows)
    for (_, quantity), why in analysis.missing.items():
        print(f"{quantity}: {why}")
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())

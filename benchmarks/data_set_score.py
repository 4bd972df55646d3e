"""Answers of any program on a benchmark data set, beside its truths.

An answer is a row of a CSV file: ``case``, then of each quantity its value and the ends of a 90 % interval, and the
probability of an inclusion. Empty cells are no answer, and are counted.
"""

from __future__ import annotations

import csv
import math
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import FileInputError
from tsis.inclusion.prior import PARAMETERS
from tsis.study.probabilities import brier_score
from tsis.study.roc import Roc

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

COLUMNS = ("case", *(f"{name}{end}" for name in PARAMETERS for end in ("", "_low", "_high")), "presence")
HEADS = ("world", "quantity", "cases", "values", "median error", "RMSE", "intervals", "90 % holds", "interval score")
LEVEL = 0.9
NUMBERS = tuple(name for name in COLUMNS if name != "case")

Row = dict[str, float | str]


def read_rows(path: Path, numbers: Sequence[str]) -> dict[str, Row]:
    """Rows by case; missing columns and empty cells are NaN. `FileInputError` for what is no such table."""
    rows: dict[str, Row] = {}
    with path.open(encoding="utf-8-sig", newline="") as file:
        for line, cells in enumerate(csv.DictReader(file), start=2):
            case = (cells.get("case") or "").strip()
            if not case or case in rows:
                raise FileInputError(f"{path.name}, line {line}, must name a case once; got {case!r:.40}")
            row: Row = {name: _number(path, line, name, cells.get(name)) for name in numbers}
            rows[case] = row | {"world": cells.get("world") or ""}
    return rows


def _number(path: Path, line: int, name: str, cell: str | None) -> float:
    if not cell or not cell.strip():
        return math.nan
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FileInputError(f"{path.name}, line {line}, {name} must be a finite number or empty; got {cell!r:.40}")
    return value


def interval_score(
    low: NDArray[np.float64], high: NDArray[np.float64], truth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Width of a 90 % interval plus twenty times what the truth lies outside (Winkler 1972): smaller is better."""
    outside = np.maximum(low - truth, 0.0) + np.maximum(truth - high, 0.0)
    return np.asarray(high - low + 2 / (1 - LEVEL) * outside)


def scores(truths: Mapping[str, Row], answers: Mapping[str, Row]) -> list[tuple[str, ...]]:
    """Rows of the table: each quantity in each world, then the presence over all.

    `FileInputError` when an answer is of no case, an interval is empty, or a probability is none.
    """
    strange = sorted(set(answers) - set(truths))
    if strange:
        raise FileInputError(f"answers must be of this data set's cases; it has no {strange[0]!r:.40}")
    rows = []
    worlds = sorted({str(truth["world"]) for truth in truths.values()})
    for world in worlds:
        cases = [case for case, truth in truths.items() if truth["world"] == world]
        for name in PARAMETERS:
            inside = [case for case in cases if not math.isnan(float(truths[case][name]))]
            if inside:
                rows.append((world, name, *_quantity(inside, name, truths, answers)))
    return [*rows, ("all", "presence", *_presence(truths, answers))]


def _column(cases: Sequence[str], name: str, rows: Mapping[str, Row]) -> NDArray[np.float64]:
    return np.array([float(rows[case][name]) if case in rows else math.nan for case in cases])


def _quantity(
    cases: Sequence[str], name: str, truths: Mapping[str, Row], answers: Mapping[str, Row]
) -> tuple[str, ...]:
    truth = _column(cases, name, truths)
    value, low, high = (_column(cases, f"{name}{end}", answers) for end in ("", "_low", "_high"))
    given, bounded = np.isfinite(value), np.isfinite(low) & np.isfinite(high)
    if (low > high).any():
        case = cases[int(np.argmax(low > high))]
        raise FileInputError(f"{name}_low must be at most {name}_high; got {case} the other way round")
    error = value[given] - truth[given]
    held = (low[bounded] <= truth[bounded]) & (truth[bounded] <= high[bounded])
    return (
        str(len(cases)),
        str(int(given.sum())),
        f"{100 * np.median(np.abs(error) / truth[given]):.3g} %" if given.any() else "",
        f"{np.sqrt((error**2).mean()):.3g}" if given.any() else "",
        str(int(bounded.sum())),
        f"{100 * held.mean():.3g} %" if bounded.any() else "",
        f"{interval_score(low[bounded], high[bounded], truth[bounded]).mean():.3g}" if bounded.any() else "",
    )


def _presence(truths: Mapping[str, Row], answers: Mapping[str, Row]) -> tuple[str, ...]:
    cases = list(truths)
    present = np.isfinite(_column(cases, PARAMETERS[0], truths))
    chance = _column(cases, "presence", answers)
    given = np.isfinite(chance)
    if ((chance < 0) | (chance > 1)).any():
        raise FileInputError("presence must be a probability within [0, 1]")
    known = present[given]
    if not known.any() or known.all():
        return (str(len(cases)), str(int(given.sum())), "", "", "", "", "")
    area = Roc.of(chance[given], known).auc
    brier = brier_score(chance[given], known).score
    return (str(len(cases)), str(int(given.sum())), f"AUC {area:.3f}", f"Brier {brier:.3f}", "", "", "")

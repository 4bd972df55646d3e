"""Tables of a large study: areas, the detection limit, probabilities, nuisances, classes, and both ways to press."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from benchmarks.detection_judgement import (
    DEPTHS_MM,
    DIAMETERS_MM,
    SPECIFICITIES,
    WITHIN,
    Searched,
    areas_by,
    clipped,
    counted,
    detection_limit,
    reaches,
)
from benchmarks.harness import Goal, show

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import InputError
from tsis.inclusion.flags import NEARLY_CERTAIN, UNTRUSTED_FLAGS
from tsis.model.estimate import ABSENCE_FLAG
from tsis.model.phantom import Inclusion
from tsis.study.classifier import ClassifierSettings, ClassSplit, TargetEvidence, cross_validate
from tsis.study.probabilities import brier_interval, brier_score, recalibration, reliability_curve

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from benchmarks.detection_judgement import DetectionLimit

    from tsis.study.proportions import Proportion
    from tsis.study.roc import Roc


AREA = 0.95
SPLIT = ClassSplit(young_kpa=60.0, diameter_mm=5.0)
REACHED = 0.9
NUISANCES = ("uneven_sd", "offset_mm", "young_kpa", "tissue_kpa", "thickness_mm", "poisson")
MOST_CLASSED = 5000


class Table(Protocol):
    """Prints a table, as `benchmarks.harness.Bench.table` does."""

    def __call__(self, title: str, heads: Sequence[str], rows: Iterable[Sequence[str]], /) -> None:
        """Print it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What was found.

    Attributes
    ----------
    document
        Numbers for programs.
    goals
        The wanted area.
    limits, searched
        What the figure shows.
    """

    document: dict[str, Any]
    goals: list[Goal]
    limits: tuple[DetectionLimit, ...]
    searched: Searched


def report(lines: Sequence[Mapping[str, Any]], *, study: str, table: Table = show) -> Answer:
    """Print the tables of a study, and of the targets that were pressed in both ways."""
    every = [line for line in lines if line["protocol"] == study and line["way"] == "moved"]
    kept = [line for line in every if "refused" not in line]
    searched = Searched.of(kept)
    document: dict[str, Any] = {
        "notice": RESEARCH_USE_ONLY,
        "protocol": study,
        "targets": len(every),
        "present": int(searched.present.sum()),
    }
    document["refused"] = _refused(every, table)
    document["flags"] = {
        kind: counted(line["flags"] for line in kept if line["present"] == here)
        for kind, here in (("inclusions", True), ("blanks", False))
    }
    document["areas"] = _areas(searched, table)
    limits = tuple(detection_limit(searched, expected) for expected in SPECIFICITIES)
    document["limits"] = [_limit(one, table) for one in limits]
    document["reach"] = [
        {"diameter_mm": d, "depth_mm": h, "reach_mm": r}
        for d, h, r in reaches(searched, limits[0], probability=REACHED)
    ]
    document["probability"] = _probability(searched, table)
    document["bold_blanks"] = _bold_blanks(kept, table)
    document["nuisances"] = _nuisances(searched, table)
    document["classes"] = _classes(kept, table)
    document["both_ways"] = _both_ways(lines, table)
    least = f"area, d >= {WITHIN[0]:g} mm, h <= {WITHIN[1]:g} mm, by evidence"
    expected = [Goal(name=least, value=document["areas"]["wanted"]["auc"], least=AREA, form="{:.4f}")]
    return Answer(document=document, goals=expected, limits=limits, searched=searched)


def _refused(every: Sequence[Mapping[str, Any]], table: Table) -> dict[str, Any]:
    refused = [line for line in every if "refused" in line]
    print(f"refused: {len(refused)} of {len(every)}, {sum(line['present'] for line in refused)} of them inclusions")
    return {
        "inclusions": sum(line["present"] for line in refused),
        "blanks": sum(not line["present"] for line in refused),
        "first": refused[0]["refused"] if refused else None,
    }


def _areas(searched: Searched, table: Table) -> dict[str, Any]:
    found: dict[str, Any] = {
        "all": area(searched.curve()),
        "wanted": area(searched.curve(searched.wanted)),
        "all_by_presence": area(searched.curve(score=searched.presence)),
        "wanted_by_presence": area(searched.curve(searched.wanted, searched.presence)),
    }
    names = {
        "all": "all, by evidence",
        "wanted": f"d >= {WITHIN[0]:g} mm, h <= {WITHIN[1]:g} mm, by evidence",
        "all_by_presence": "all, by probability as it is told",
        "wanted_by_presence": f"d >= {WITHIN[0]:g} mm, h <= {WITHIN[1]:g} mm, by probability as it is told",
    }
    rows = [[names[key], *area_cells(one)] for key, one in found.items()]
    table("Area under the curve", ("targets", "inclusions, blanks", "area", "95 % interval", "method"), rows)
    for kind, here in (("inclusions", searched.present), ("blanks", ~searched.present)):
        found[f"{kind}_rounded_to_1"] = int(np.count_nonzero(searched.presence[here] == 1.0))
        print(f"{kind} whose probability is rounded to 1: {found[f'{kind}_rounded_to_1']} of {int(here.sum())}")
    return found


def _limit(limit: DetectionLimit, table: Table) -> dict[str, Any]:
    ends = limit.specificity.interval()
    title = (
        f"Sensitivity at a specificity of {limit.wanted:g} chosen on other blanks, where it was "
        f"{limit.specificity.value:.3f} ({ends.low:.3f} to {ends.high:.3f})"
    )
    heads = ["diameter / mm", *(f"h {low:g} to {high:g} mm" for low, high in pairs(DEPTHS_MM))]
    rows = [
        [f"{low:g} to {high:g}", *map(share, row)]
        for (low, high), row in zip(pairs(DIAMETERS_MM), limit.found, strict=True)
    ]
    table(title, heads, rows)
    return {
        "wanted": limit.wanted,
        "specificity": limit.specificity.value,
        "specificity_interval": list(ends),
        "diameters_mm": list(DIAMETERS_MM),
        "depths_mm": list(DEPTHS_MM),
        "found": [[None if one is None else [one.successes, one.trials] for one in row] for row in limit.found],
    }


def _probability(searched: Searched, table: Table) -> dict[str, Any]:
    """Brier score, reliability and slope of the logits."""
    said, there = searched.presence, searched.present
    within = brier_interval(said, there, rng=np.random.default_rng(0), draws=1000)
    curve = reliability_curve(said, there)
    rows = [
        [f"{one.probability:.3g}", f"{one.observed.value:.3f} ({one.observed.interval().low:.3f} to "
         f"{one.observed.interval().high:.3f})", str(one.observed.trials)]
        for one in curve.bins
    ]  # fmt: skip
    table("Of those told so probable, how many hold an inclusion", ("probability", "share", "targets"), rows)
    found: dict[str, Any] = {
        "brier": brier_score(said, there).score,
        "brier_interval": [within.low, within.high],
        "calibration_error": curve.expected_calibration_error,
        "bins": [[one.probability, one.observed.successes, one.observed.trials] for one in curve.bins],
    }
    print(f"Brier score {found['brier']:.4f} ({within.low:.4f} to {within.high:.4f})")
    try:
        fitted = recalibration(clipped(said), there)
    except InputError as error:
        print(f"no calibration slope: {error}")
        return found
    found |= {"slope": fitted.slope.value, "slope_interval": list(fitted.slope.interval())}
    found |= {"in_the_large": fitted.in_the_large.value}
    print(f"calibration slope {fitted.slope.value:.3f}, in the large {fitted.in_the_large.value:+.3f}")
    return found


def _bold_blanks(kept: Sequence[Mapping[str, Any]], table: Table) -> dict[str, int]:
    """Blanks that are told to hold an inclusion, and how many of them no flag doubts."""
    blanks = [line for line in kept if not line["present"]]
    bold = [line for line in blanks if line["presence"] > NEARLY_CERTAIN]
    undoubted = sum((UNTRUSTED_FLAGS - {ABSENCE_FLAG}).isdisjoint(line["flags"]) for line in bold)
    print(f"blanks told more than {NEARLY_CERTAIN:g}: {len(bold)} of {len(blanks)}, {undoubted} of them without a flag")
    return {"told": len(bold), "undoubted": undoubted, "blanks": len(blanks)}


def _nuisances(searched: Searched, table: Table) -> list[dict[str, Any]]:
    found, rows = [], []
    for name in NUISANCES:
        for label, curve in areas_by(searched, name):
            found.append({"part": label, **area(curve)})
            rows.append([label, *area_cells(found[-1])])
    table("Area by thirds of what was drawn", ("part", "inclusions, blanks", "area", "95 % interval", "method"), rows)
    return found


def _classes(kept: Sequence[Mapping[str, Any]], table: Table) -> dict[str, Any] | None:
    """Three classes by measured properties, out of fold."""
    used = kept[:MOST_CLASSED]
    readings = [TargetEvidence(samples=np.array(line["samples"]), log_ratio=line["evidence"]) for line in used]
    truth = [_inclusion(line["truth"]) if line["present"] else None for line in used]
    try:
        found = cross_validate(readings, truth, SPLIT, ClassifierSettings())
    except InputError as error:
        print(f"no classes: {error}")
        return None
    rows = [
        [SPLIT.names[row], *(share(found.proportion(row, column)) for column in range(3))] for row in range(3)
    ]  # fmt: skip
    table("Classes out of fold: truth by row, likeliest by column", ("", *SPLIT.names), rows)
    at_mean = float(-np.log(np.maximum(found.at_mean[np.arange(len(used)), found.labels], 1e-15)).mean())
    differences = np.abs(found.probabilities - found.at_mean).max(axis=1)
    print(
        f"log loss {found.log_loss:.3f} (of posteriors' means alone {at_mean:.3f}), Brier {found.brier:.3f}, right "
        f"{found.accuracy.value:.3f}; both probabilities differ by {np.median(differences):.3f} in the median"
    )
    some = Searched.of(used)
    of_none = {name: area(some.curve(among, 1 - found.probabilities[:, 0])) for name, among in
            (("all", None), ("wanted", some.wanted))}  # fmt: skip
    print(f"area by the class 'none': {of_none['all']['auc']:.4f}, where wanted {of_none['wanted']['auc']:.4f}")
    return {
        "names": SPLIT.names,
        "confusion": found.confusion.tolist(),
        "log_loss": found.log_loss,
        "log_loss_at_mean": at_mean,
        "brier": found.brier,
        "accuracy": found.accuracy.value,
        "median_difference": float(np.median(differences)),
        "areas_by_none": of_none,
    }


def _inclusion(truth: Sequence[float]) -> Inclusion:
    return Inclusion(diameter_mm=truth[0], depth_mm=truth[1], young_kpa=truth[2])


def _both_ways(lines: Sequence[Mapping[str, Any]], table: Table) -> dict[str, Any] | None:
    """Targets pressed by a flat probe in three dimensions and by moved changes, with the same errors."""
    by = {(line["way"], line["index"]): line for line in lines if "refused" not in line and line["protocol"] == "flat"}
    both = [(by["moved", index], by["solid", index]) for way, index in by if way == "solid" and ("moved", index) in by]
    if len({first["present"] for first, _ in both}) < 2:
        return None
    found: dict[str, Any] = {"targets": len(both)}
    rows = []
    for name, searched in (("moved", Searched.of([a for a, _ in both])), ("solid", Searched.of([b for _, b in both]))):
        found[name] = area(searched.curve())
        rows.append([name, *area_cells(found[name])])
    logs = np.array([[np.arcsinh(one["evidence"]) for one in pair] for pair in both])
    found["correlation"] = float(np.corrcoef(logs.T)[0, 1])
    found["same_side"] = int(np.count_nonzero((logs[:, 0] > 0) == (logs[:, 1] > 0)))
    heads = ("flat probe, pressed", "inclusions, blanks", "area", "95 % interval", "method")
    table("The same targets in three dimensions and by moved changes", heads, rows)
    print(
        f"evidence of both (its asinh) correlates by {found['correlation']:.3f}; {found['same_side']} of {len(both)} "
        "lie on the same side of even odds"
    )
    return found


__all__ = ["Answer", "report"]


def area(curve: Roc) -> dict[str, Any]:
    """Area with its interval, as plain values."""
    within = curve.auc_interval()
    return {
        "auc": curve.auc,
        "interval": [within.low, within.high],
        "method": within.method,
        "inclusions": curve.targets,
        "blanks": curve.blanks,
    }


def area_cells(one: Mapping[str, Any]) -> list[str]:
    """The same for a table."""
    low, high = one["interval"]
    return [f"{one['inclusions']}, {one['blanks']}", f"{one['auc']:.4f}", f"{low:.4f} to {high:.4f}", one["method"]]


def pairs(ends: tuple[float, ...]) -> list[tuple[float, float]]:
    """Ends of neighbouring cells."""
    return list(pairwise(ends))


def share(one: Proportion | None) -> str:
    """A share with Wilson's interval and the number of targets."""
    if one is None:
        return "-"
    low, high = one.interval()
    return f"{one.value:.2f} ({low:.2f}-{high:.2f}), {one.trials}"

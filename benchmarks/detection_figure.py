"""The figure of a large study, and its files: numbers, and the table of reaches that a scan plan takes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.detection_judgement import DEPTHS_MM, DIAMETERS_MM
from benchmarks.detection_report import pairs

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.study.probabilities import reliability_curve

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from benchmarks.detection_judgement import DetectionLimit
    from benchmarks.detection_report import Answer
    from numpy.typing import NDArray


def write_results(folder: Path, answer: Answer, document: Mapping[str, Any]) -> None:
    """Figure, numbers, and the table of reaches that a scan plan takes."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "detection.json").write_text(json.dumps(document, indent=1))
    rows = [f"{one['diameter_mm']:g},{one['depth_mm']:g},{one['reach_mm']:.3f}" for one in document["reach"]]
    (folder / "reach.csv").write_text("\n".join(["diameter_mm,depth_mm,reach_mm", *rows, ""]))
    _draw(answer).savefig(folder / "detection.png", dpi=130)


def _draw(answer: Answer) -> Any:
    from matplotlib.figure import Figure

    searched = answer.searched
    sheet = Figure(figsize=(13.0, 8.0), layout="constrained")
    ((limit, stricter), (curve, reliability)) = sheet.subplots(2, 2)
    for ax, one in zip((limit, stricter), answer.limits, strict=True):
        _map(sheet, ax, one)
    for label, among in (("all", None), ("d >= 5 mm, h <= 8 mm", searched.wanted)):
        found = searched.curve(among)
        curve.step(found.false_positive_rate, found.true_positive_rate, where="post", label=f"{label}: {found.auc:.3f}")
    curve.plot([0, 1], [0, 1], ":", color="#999999")
    curve.set(xlabel="1 - specificity", ylabel="sensitivity", title="curve and its area, by evidence")
    curve.legend(fontsize=8)
    bins = reliability_curve(searched.presence, searched.present).bins
    share = np.array([one.observed.value for one in bins])
    ends = np.array([list(one.observed.interval()) for one in bins])
    place = [one.probability for one in bins]
    reliability.errorbar(place, share, yerr=np.abs(ends - share[:, None]).T, fmt="o", capsize=3)
    reliability.plot([0, 1], [0, 1], ":", color="#999999")
    reliability.set(xlabel="probability as told", ylabel="share with an inclusion", title="reliability")
    sheet.supxlabel(RESEARCH_USE_ONLY, fontsize=8)
    return sheet


def _map(sheet: Any, ax: Any, limit: DetectionLimit) -> None:
    shares: NDArray[np.float64] = np.array(
        [[np.nan if one is None else one.value for one in row] for row in limit.found]
    )
    picture = ax.pcolormesh(DIAMETERS_MM, DEPTHS_MM, shares.T, vmin=0, vmax=1, cmap="cividis", edgecolors="white")
    sheet.colorbar(picture, ax=ax, label="sensitivity")
    for (left, right), row in zip(pairs(DIAMETERS_MM), limit.found, strict=True):
        for (low, high), one in zip(pairs(DEPTHS_MM), row, strict=True):
            if one is not None:
                colour = "black" if one.value > 0.5 else "white"
                text = f"{one.value:.2f}\nn {one.trials}"
                ax.text((left + right) / 2, (low + high) / 2, text, ha="center", va="center", color=colour, fontsize=7)
    ax.invert_yaxis()
    ax.set(xlabel="diameter / mm", ylabel="depth / mm")
    ax.set_title(f"specificity {limit.specificity.value:.3f} (wanted {limit.wanted:g}) on other blanks", fontsize=10)

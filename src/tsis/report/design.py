"""What designs would tell, as a document for programs and as parts of a page for people."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.plots import design_errors
from tsis.plots.posterior import LABELS
from tsis.report.design_question import PRIOR, SENSOR, design_calibration
from tsis.report.document import envelope
from tsis.report.page import Card, Page, Picture, Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from tsis.inclusion import Design, DesignOptimum
    from tsis.report.design_question import DesignAnswer

HEADINGS = ("design", "d / mm", "h / mm", "E / kPa", "known", "strain", "whole", "grey", "breaks")
SHORT = {"diameter_mm": ("Diameter", "mm", 2), "depth_mm": ("Depth", "mm", 2), "young_kpa": ("Modulus", "kPa", 1)}
CROSSES = "Nearer to the corner is better; crosses break a limit."


def design_document(answer: DesignAnswer) -> dict[str, Any]:
    """All of it, as plain values with the names of Python."""
    question, best = answer.question, answer.optimum
    return envelope(
        "design",
        planned=asdict(question.planned),
        criterion=question.criterion,
        designs=[_document(one) for one in answer.designs],
        optimum=None if best is None else _optimum_document(best),
        prior=asdict(PRIOR),
        calibration=asdict(design_calibration()),
        sensor=asdict(SENSOR),
        light="traced" if question.traced else "even",
    )


def design_rows(designs: Sequence[Design]) -> tuple[tuple[str, ...], ...]:
    """The designs under `HEADINGS`, in their order."""
    return tuple(_row(one) for one in designs)


def design_caption(designs: Sequence[Design]) -> str:
    """What the errors of `design_rows` are."""
    return (
        f"Expected errors over {len(designs[0].information.inclusions)} inclusions, best first; what breaks a limit "
        "comes last."
    )


def design_notes(answer: DesignAnswer) -> tuple[str, ...]:
    """What to know besides the table: before any press, what the columns mean, limits broken, what binds the best."""
    before = PRIOR.sd
    broken = {f"{one.protocol.name}: {said}" for one in answer.designs for said in one.limits.broken.values()}
    return (
        f"Before any press: d {before['diameter_mm']:.2f} mm, h {before['depth_mm']:.2f} mm, "
        f"E {before['young_kpa']:.1f} kPa.",
        "known: share of the inclusions whose modulus would be known to 20 kPa; whole: share on which the whole face "
        "touches in the weakest press; grey: the brightest place.",
        *sorted(broken),
        *(() if answer.optimum is None else _optimum_notes(answer.optimum)),
    )


def draw_errors(designs: Sequence[Design], figure: Figure) -> None:
    """Depth over diameter and modulus over depth, with a numbered point for each design."""
    left, right = figure.subplots(1, 2)
    design_errors(designs, ("diameter_mm", "depth_mm"), left)
    design_errors(designs, ("depth_mm", "young_kpa"), right)
    figure.legend(*left.get_legend_handles_labels(), loc="outside right upper", fontsize=8, markerscale=0.8)


def design_page(answer: DesignAnswer) -> Page:
    """The planned design's errors as cards with the prior beside them, the information plot, and all designs."""
    designs = answer.designs
    return Page(
        title="What it would tell",
        subtitle=answer.planned.protocol.described,
        cards=(*(_card(answer.planned, name) for name in SHORT), _best_card(answer)),
        notes=design_notes(answer),
        pictures=(
            Picture(
                title="Expected errors",
                draw=partial(draw_errors, designs),
                size=(11.0, 4.0),
                alt=f"Expected errors of {len(designs)} designs; the best is {answer.best.protocol.name}. The table "
                "below holds the numbers.",
                caption=CROSSES,
                wide=True,
            ),
        ),
        tables=(Table(title=design_caption(designs), headings=HEADINGS, rows=design_rows(designs)),),
    )


def _card(design: Design, name: str) -> Card:
    title, unit, digits = SHORT[name]
    error, before = design.information.rmse[name], PRIOR.sd[name]
    return Card(
        title=f"{title}, as planned",
        value=f"± {error:.{digits}f} {unit}",
        detail=f"before any press ± {before:.{digits}f} {unit}",
        doubtful=bool(design.limits.broken),
    )


def _best_card(answer: DesignAnswer) -> Card:
    best, criterion = answer.best, answer.question.criterion
    by = "all three together" if criterion == "all" else LABELS[criterion]
    return Card(
        title="Best of all",
        value=best.protocol.name,
        detail=f"by {by}" + ("; it breaks a limit, as all do" if best.limits.broken else ""),
        doubtful=bool(best.limits.broken),
    )


def _row(one: Design) -> tuple[str, ...]:
    errors, limits = one.information.rmse, one.limits
    return (
        one.protocol.name,
        f"{errors['diameter_mm']:.2f}",
        f"{errors['depth_mm']:.2f}",
        f"{errors['young_kpa']:.1f}",
        f"{one.information.identified_share:.0%}",
        f"{limits.strain:.2f}",
        f"{limits.whole_share:.0%}",
        f"{limits.brightest_grey:.0f}",
        ", ".join(limits.broken),
    )


def _document(one: Design) -> dict[str, Any]:
    told = one.information
    bound = told.cramer_rao_sd
    return {
        "name": one.protocol.name,
        "presses": one.protocol.described,
        "layers_young_kpa": [layer.young_kpa for layer in one.protocol.probe.layers],
        "face_curvature_mm": one.protocol.probe.face_curvature_mm,
        "expected_rmse": told.rmse,
        "modulus_identified_share": told.identified_share,
        "mean_log_narrowing": told.log_sd,
        "limits": asdict(one.limits),
        "broken": one.limits.broken,
        "inclusions": [
            {"inclusion": inclusion, "expected_sd": sd, "cramer_rao_sd": least if np.isfinite(least).all() else None}
            for inclusion, sd, least in zip(
                told.inclusions.tolist(), told.expected_sd.tolist(), bound.tolist(), strict=True
            )
        ],
    }


def _optimum_document(best: DesignOptimum) -> dict[str, Any]:
    return {
        "stiffening": best.stiffening,
        "gradient": best.gradient,
        "forces_n": list(best.best.protocol.forces_n),
        "binding": list(best.binding),
        "evaluations": best.evaluations,
    }


def _optimum_notes(best: DesignOptimum) -> tuple[str, ...]:
    layers = ", ".join(f"{layer.young_kpa:.3g}" for layer in best.best.protocol.probe.layers)
    forces = " and ".join(f"{force:.2g}" for force in best.best.protocol.forces_n)
    held = ", ".join(best.binding) or "nothing; it lies inside the search"
    return (
        f"Best found after {best.evaluations} stacks: layers of {layers} kPa from the tissue up, pressed at "
        f"{forces} N.",
        f"What binds it: {held}.",
    )

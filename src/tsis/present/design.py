"""Analysis of probe designs before a probe is built, and its report."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.inclusion.prior import PARAMETERS
from tsis.present.document import envelope
from tsis.present.figures import design_errors
from tsis.present.labels import quantity_of
from tsis.present.page import Card, Page, Picture, Table
from tsis.virtual.planned_probe import SENSOR, DesignAnalysis, design_calibration

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from tsis.inclusion.design.alternatives import Design
    from tsis.inclusion.design.search import DesignOptimum


HEADINGS = ("design", "d / mm", "h / mm", "E / kPa", "known", "strain", "whole", "grey", "breaks")
CROSSES = "Nearer to the corner is better; crosses break a limit."


def design_document(design: DesignAnalysis) -> dict[str, Any]:
    """The analysis as a JSON document."""
    question, best = design.question, design.optimum
    return envelope(
        "design",
        planned=asdict(question.planned),
        criterion=question.criterion,
        designs=[_document(design) for design in design.designs],
        optimum=None if best is None else _optimum_document(best),
        prior=asdict(question.prior),
        calibration=design_calibration().provenance(),
        sensor=asdict(SENSOR),
        light="traced" if question.traced else "even",
    )


def design_rows(designs: Sequence[Design]) -> tuple[tuple[str, ...], ...]:
    """The designs under `HEADINGS`, in their order."""
    return tuple(_row(design) for design in designs)


def design_caption(designs: Sequence[Design]) -> str:
    """Caption of `design_rows`."""
    return (
        f"Expected errors over {len(designs[0].information.inclusions)} inclusions, best first; what breaks a limit "
        "comes last."
    )


def design_notes(design: DesignAnalysis) -> tuple[str, ...]:
    """Notes on the table: prior errors, meaning of the columns, broken limits, the optimum."""
    before = design.question.prior.sd
    broken = {
        f"{design.protocol.name}: {message}" for design in design.designs for message in design.limits.broken.values()
    }
    return (
        f"Before any press: d {before['diameter_mm']:.2f} mm, h {before['depth_mm']:.2f} mm, "
        f"E {before['young_kpa']:.1f} kPa.",
        "known: fraction of the inclusions whose modulus would be known to 20 kPa; whole: fraction on which the whole "
        "face touches in the weakest press; grey: the brightest pixel.",
        *sorted(broken),
        *(() if design.optimum is None else _optimum_notes(design.optimum)),
    )


def draw_errors(designs: Sequence[Design], figure: Figure) -> None:
    """Draw errors of depth over diameter and of modulus over depth, with a numbered point for each design."""
    left, right = figure.subplots(1, 2)
    design_errors(designs, ("diameter_mm", "depth_mm"), left)
    design_errors(designs, ("depth_mm", "young_kpa"), right)
    figure.legend(*left.get_legend_handles_labels(), loc="outside right upper", fontsize=8, markerscale=0.8)


def design_page(design: DesignAnalysis) -> Page:
    """The report: errors of the planned design beside the prior, their plot, and all designs."""
    designs = design.designs
    return Page(
        title="Predicted performance",
        subtitle=design.planned.protocol.described,
        cards=(*(_card(design, name) for name in PARAMETERS), _best_card(design)),
        notes=design_notes(design),
        pictures=(
            Picture(
                title="Expected errors",
                draw=partial(draw_errors, designs),
                size=(11.0, 4.0),
                alt=f"Expected errors of {len(designs)} designs; the best is {design.best.protocol.name}. The table "
                "below holds the numbers.",
                caption=CROSSES,
                wide=True,
            ),
        ),
        tables=(Table(title=design_caption(designs), columns=HEADINGS, values=design_rows(designs)),),
    )


def _card(response: DesignAnalysis, name: str) -> Card:
    design = response.planned
    quantity = quantity_of(name)
    unit, digits = quantity.unit, quantity.decimals
    error, before = design.information.rmse[name], response.question.prior.sd[name]
    return Card(
        title=f"{quantity.label.capitalize()}, as planned",
        value=f"± {error:.{digits}f} {unit}",
        detail=f"before any press ± {before:.{digits}f} {unit}",
        doubtful=bool(design.limits.broken),
    )


def _best_card(design: DesignAnalysis) -> Card:
    best, criterion = design.best, design.question.criterion
    by = "all three together" if criterion == "all" else quantity_of(criterion).axis
    return Card(
        title="Best of all",
        value=best.protocol.name,
        detail=f"by {by}" + ("; it breaks a limit, as all do" if best.limits.broken else ""),
        doubtful=bool(best.limits.broken),
    )


def _row(design: Design) -> tuple[str, ...]:
    errors, limits = design.information.rmse, design.limits
    return (
        design.protocol.name,
        f"{errors['diameter_mm']:.2f}",
        f"{errors['depth_mm']:.2f}",
        f"{errors['young_kpa']:.1f}",
        f"{design.information.identified_fraction:.0%}",
        f"{limits.strain:.2f}",
        f"{limits.whole_fraction:.0%}",
        f"{limits.brightest_grey:.0f}",
        ", ".join(limits.broken),
    )


def _document(design: Design) -> dict[str, Any]:
    information = design.information
    bound = information.cramer_rao_sd
    return {
        "name": design.protocol.name,
        "presses": design.protocol.described,
        "layers_young_kpa": [layer.young_kpa for layer in design.protocol.probe.layers],
        "face_curvature_mm": design.protocol.probe.face_curvature_mm,
        "expected_rmse": information.rmse,
        "modulus_identified_share": information.identified_fraction,
        "mean_log_narrowing": information.log_sd,
        "limits": asdict(design.limits),
        "broken": design.limits.broken,
        "inclusions": [
            {"inclusion": inclusion, "expected_sd": sd, "cramer_rao_sd": least if np.isfinite(least).all() else None}
            for inclusion, sd, least in zip(
                information.inclusions.tolist(), information.expected_sd.tolist(), bound.tolist(), strict=True
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
    binding = ", ".join(best.binding) or "nothing; it lies inside the search"
    return (
        f"Best found after {best.evaluations} stacks: layers of {layers} kPa from the tissue up, pressed at "
        f"{forces} N.",
        f"What binds it: {binding}.",
    )

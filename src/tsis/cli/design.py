"""``tsis design``: what a probe and its presses would tell, before they are built."""

from __future__ import annotations

from dataclasses import asdict, replace
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from matplotlib.figure import Figure
from rich.box import SIMPLE_HEAD
from rich.table import Table

from tsis.cli.console_output import progress_bar
from tsis.cli.optics.output import Answer, Out, show
from tsis.cli.targets import AsJson, ProbeName
from tsis.imaging.sensor import Sensor
from tsis.inclusion import (
    InclusionPrior,
    alternatives,
    compare,
    optimise,
    protocol_of,
    ranked,
)
from tsis.inclusion.design_search import MOST_EVALUATIONS
from tsis.model import check, load_probe
from tsis.model.errors import InputError
from tsis.plots import design_errors
from tsis.report.document import envelope
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.inclusion import Design, Optimum

FLAT_N, DOMED_N = (1.0,), (0.5, 1.0)  # under a dome two forces load the tissue in two different ways


class Compared(StrEnum):
    """What is changed."""

    SOFTNESS = "softness"
    LAYERS = "layers"
    DOME = "dome"
    FORCES = "forces"
    FRAMES = "frames"
    REFERENCE = "reference"


class Criterion(StrEnum):
    """What a good design makes small."""

    ALL = "all"
    DIAMETER = "diameter_mm"
    DEPTH = "depth_mm"
    MODULUS = "young_kpa"


QUICK = [Compared.FORCES, Compared.FRAMES, Compared.REFERENCE]  # of one probe, whose press is solved once


def design(
    *,
    probe: ProbeName = "tsis-domed",
    force_n: Annotated[
        list[float] | None, typer.Option(help="Force of a press, N; may be repeated. 0.5 and 1 on a dome, else 1.")
    ] = None,
    no_reference: Annotated[bool, typer.Option("--no-reference", help="No presses on plain tissue.")] = False,
    frames: Annotated[int, typer.Option(help="How often each press is made.")] = 1,
    compared: Annotated[
        list[Compared] | None,
        typer.Option("--compare", help="What to change; may be repeated. Forces, frames and reference if left out."),
    ] = None,
    search: Annotated[
        bool, typer.Option("--optimise", help="Search the layers' moduli and the forces too; takes minutes.")
    ] = False,
    criterion: Annotated[
        Criterion, typer.Option(help="What to rank and search by: all three together, or one parameter's error.")
    ] = Criterion.ALL,
    evaluations: Annotated[
        int | None, typer.Option(help="Stacks of layers that the search may solve, 1 to 25; 25 if left out.")
    ] = None,
    traced_light: Annotated[
        bool, typer.Option("--traced-light", help="Light by the probe's lamps, traced; else even light.")
    ] = False,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Tell what a probe and its presses would say about inclusions, and how other designs compare.

    Expected errors are means over the prior's ranges of inclusions. Nothing is pressed: the numbers come from the
    model behind the estimates, with every error that a calibration states.
    """
    if evaluations is not None and not search:
        raise InputError("--evaluations needs --optimise: nothing is searched without it")
    most = MOST_EVALUATIONS if evaluations is None else evaluations
    check.whole("evaluations", most, 1, MOST_EVALUATIONS)  # before seconds of solving
    chosen, prior, sensor = load_probe(probe), InclusionPrior(), Sensor()
    forces = tuple(force_n or (FLAT_N if chosen.face_curvature_mm is None else DOMED_N))
    planned = replace(
        protocol_of(chosen, forces, with_reference=not no_reference), frames_each=frames, name="as planned"
    )
    calibration = nominal_calibration(sensor)
    changed = [other for aspect in compared or QUICK for other in alternatives(planned, aspect.value)]
    protocols = [planned, *{other.name: other for other in changed}.values()]
    with progress_bar("solving presses (kept for next time)") as progress:
        found = compare(
            protocols,
            of=chosen,
            prior=prior,
            calibration=calibration,
            sensor=sensor,
            traced=traced_light,
            progress=progress,
        )
    best = None
    if search:
        with progress_bar("searching layers and forces") as progress:
            best = optimise(
                planned,
                prior=prior,
                calibration=calibration,
                sensor=sensor,
                criterion=criterion.value,
                evaluations=most,
                traced=traced_light,
                progress=progress,
            )
    designs = ranked([*found, *([] if best is None else [best.best])], criterion.value)
    document = envelope(
        "design",
        planned=asdict(planned),
        criterion=criterion.value,
        designs=[_document(one) for one in designs],
        optimum=None if best is None else _optimum_document(best),
        prior=asdict(prior),
        calibration=asdict(calibration),
        sensor=asdict(sensor),
        light="traced" if traced_light else "even",
    )
    answer = Answer(
        document=document,
        tables=(_table(designs, planned.described),),
        notes=(*_notes(designs, prior), *([] if best is None else _optimum_notes(best))),
        figures={"errors": _figure(designs)},
    )
    show(answer, out, as_json=as_json)


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


def _optimum_document(best: Optimum) -> dict[str, Any]:
    return {
        "stiffening": best.stiffening,
        "gradient": best.gradient,
        "forces_n": list(best.best.protocol.forces_n),
        "binding": list(best.binding),
        "evaluations": best.evaluations,
    }


def _table(designs: Sequence[Design], title: str) -> Table:
    table = Table(
        title=title,
        caption=f"Expected errors over {len(designs[0].information.inclusions)} inclusions, best first; what breaks a "
        "limit comes last.",
        caption_justify="left",
        box=SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    table.add_column("design", min_width=14)
    for heading in ("d / mm", "h / mm", "E / kPa", "known", "strain", "whole", "grey"):
        table.add_column(heading, justify="right")
    table.add_column("breaks", min_width=10)
    for one in designs:
        errors, limits = one.information.rmse, one.limits
        table.add_row(
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
    return table


def _notes(designs: Sequence[Design], prior: InclusionPrior) -> list[str]:
    before = prior.sd
    said = [
        f"Before any press: d {before['diameter_mm']:.2f} mm, h {before['depth_mm']:.2f} mm, "
        f"E {before['young_kpa']:.1f} kPa.",
        "known: share of the inclusions whose modulus would be known to 20 kPa; whole: share on which the whole face "
        "touches in the weakest press; grey: the brightest place.",
    ]
    broken = {f"{one.protocol.name}: {sentence}" for one in designs for sentence in one.limits.broken.values()}
    return [*said, *sorted(broken)]


def _optimum_notes(best: Optimum) -> list[str]:
    layers = ", ".join(f"{layer.young_kpa:.3g}" for layer in best.best.protocol.probe.layers)
    forces = " and ".join(f"{force:.2g}" for force in best.best.protocol.forces_n)
    held = ", ".join(best.binding) or "nothing; it lies inside the search"
    return [
        f"Best found after {best.evaluations} stacks: layers of {layers} kPa from the tissue up, pressed at "
        f"{forces} N.",
        f"What binds it: {held}.",
    ]


def _figure(designs: Sequence[Design]) -> Callable[[], Figure]:
    return partial(_draw, designs)


def _draw(designs: Sequence[Design]) -> Figure:
    figure = Figure(figsize=(11.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    design_errors(designs, ("diameter_mm", "depth_mm"), left)
    design_errors(designs, ("depth_mm", "young_kpa"), right)
    figure.legend(*left.get_legend_handles_labels(), loc="outside right upper", fontsize=8, markerscale=0.8)
    figure.supxlabel("Research use only. Crosses break a limit.", fontsize=8)
    return figure

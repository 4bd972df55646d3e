"""``tsis design``: expected errors of a probe before it is built."""

from __future__ import annotations

from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.cli.options import AsJson, InclusionPriorChoice, ProbeOption, ShowPrior, chosen_prior, chosen_probe
from tsis.cli.output import CommandResult, Out, show_result
from tsis.cli.progress import progress_bar
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from tsis.inclusion.design.alternatives import Design


class Compared(StrEnum):
    """The design variable."""

    SOFTNESS = "softness"
    LAYERS = "layers"
    DOME = "dome"
    FORCES = "forces"
    FRAMES = "frames"
    REFERENCE = "reference"


class Criterion(StrEnum):
    """What a search minimises."""

    ALL = "all"
    DIAMETER = "diameter_mm"
    DEPTH = "depth_mm"
    MODULUS = "young_kpa"


def design(
    *,
    probe: ProbeOption = "tsis-domed",
    force_n: Annotated[
        list[float] | None, typer.Option(help="Force of a press, N; may be repeated. 0.5 and 1 on a dome, else 1.")
    ] = None,
    no_reference: Annotated[bool, typer.Option("--no-reference", help="No reference presses.")] = False,
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
    prior: InclusionPriorChoice = None,
    show_prior: ShowPrior = False,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Predict how well a probe and its presses estimate inclusions, and compare other designs.

    Expected errors are means over the prior's ranges. Nothing is pressed: the numbers come from the
    model of the estimates, with all errors of a calibration.
    """
    if evaluations is not None and not search:
        raise InputError("--evaluations needs --optimise, the search that it limits")
    question = tsis.virtual.planned_probe.DesignQuestion(
        probe=chosen_probe(probe),
        forces_n=tuple(force_n or ()),
        with_reference=not no_reference,
        frames_per_press=frames,
        compared=tuple(aspect.value for aspect in compared) if compared else tsis.virtual.planned_probe.QUICK_DEGREES,
        criterion=criterion.value,
        traced=traced_light,
        prior=chosen_prior(prior),
        evaluations=None
        if not search
        else tsis.inclusion.design.search.MOST_EVALUATIONS
        if evaluations is None
        else evaluations,
    )
    with progress_bar("solving presses (cached for next time)") as progress:
        result = tsis.virtual.planned_probe.compared_designs(question, progress=progress)
    best = None
    if search:
        with progress_bar("searching layers and forces") as progress:
            best = tsis.virtual.planned_probe.searched_design(question, progress=progress)
    response = tsis.virtual.planned_probe.analyse_designs(question, result, best)
    show_result(
        CommandResult(
            document=tsis.present.design.design_document(response),
            tables=tsis.present.design.design_page(response).tables,
            notes=tsis.present.design.design_notes(response),
            figures={"errors": partial(_draw, response.designs)},
        ),
        out,
        as_json=as_json,
    )


def _draw(designs: Sequence[Design]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.0), layout="constrained")
    tsis.present.design.draw_errors(designs, figure)
    figure.supxlabel("Research use only. Crosses break a limit.", fontsize=8)
    return figure

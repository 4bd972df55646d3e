"""``tsis design``: expected errors of a probe and its presses; ``tsis protocol``: the forces for a tissue."""

from __future__ import annotations

from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

import tsis
from tsis.cli._options import (
    AsJson,
    InclusionPriorChoice,
    ProbeOption,
    ShowPrior,
    calibrated_probe,
    chosen_prior,
    chosen_probe,
    chosen_scale,
    read_frames,
)
from tsis.cli._output import CommandResult, Out, show_result
from tsis.cli._progress import progress_bar
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from tsis.inclusion import TissueModulus
    from tsis.inclusion.design import Design
    from tsis.model import Probe
    from tsis.report import DesignAnalysis


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
    question = tsis.report.DesignQuestion(
        probe=chosen_probe(probe),
        forces_n=tuple(force_n or ()),
        with_reference=not no_reference,
        frames_per_press=frames,
        compared=tuple(aspect.value for aspect in compared) if compared else tsis.report.QUICK_DEGREES,
        criterion=criterion.value,
        traced=traced_light,
        prior=chosen_prior(prior),
        evaluations=None
        if not search
        else tsis.inclusion.design.MOST_EVALUATIONS
        if evaluations is None
        else evaluations,
    )
    with progress_bar("solving presses (cached for next time)") as progress:
        result = tsis.report.compared_designs(question, progress=progress)
    best = None
    if search:
        with progress_bar("searching layers and forces") as progress:
            best = tsis.report.searched_design(question, progress=progress)
    response = tsis.report.analyse_designs(question, result, best)
    show_result(
        CommandResult(
            document=tsis.report.design_document(response),
            tables=(_table(response),),
            notes=tsis.report.design_notes(response),
            figures={"errors": partial(_draw, response.designs)},
        ),
        out,
        as_json=as_json,
    )


def _table(analysis: DesignAnalysis) -> Table:
    table = Table(
        title=analysis.question.planned.described,
        caption=tsis.report.design_caption(analysis.designs),
        caption_justify="left",
        box=SIMPLE_HEAD,
        show_edge=False,
        padding=(0, 1, 0, 0),
    )
    table.add_column(tsis.report.HEADINGS[0], min_width=14)
    for heading in tsis.report.HEADINGS[1:-1]:
        table.add_column(heading, justify="right")
    table.add_column(tsis.report.HEADINGS[-1], min_width=10)
    for row in tsis.report.design_rows(analysis.designs):
        table.add_row(*row)
    return table


def _draw(designs: Sequence[Design]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.0), layout="constrained")
    tsis.report.draw_errors(designs, figure)
    figure.supxlabel("Research use only. Crosses break a limit.", fontsize=8)
    return figure


NOT_ON_TISSUE = (
    "The press does not look like one on even tissue without an inclusion: press another place lightly, or give the "
    "modulus as --tissue-kpa."
)


def protocol(
    image: Annotated[
        Path | None, typer.Argument(help="Frame of a light press on tissue without an inclusion, 0.2 N or so.")
    ] = None,
    *,
    calibration: Annotated[Path | None, typer.Option(help="Calibration file of the probe.")] = None,
    force_n: Annotated[float | None, typer.Option(help="Force of the light press in newtons.")] = None,
    scale_mm: Annotated[
        str | None, typer.Option(help="Millimetres per pixel on the face: one number, or x,y when they differ.")
    ] = None,
    tissue_kpa: Annotated[
        float | None, typer.Option(help="Modulus of the tissue where it is known, kPa; instead of a frame.")
    ] = None,
    thickness_mm: Annotated[float, typer.Option(help="Thickness of the tissue, mm.")] = 30.0,
    probe: Annotated[
        str | None,
        typer.Option(
            help="Name in the catalog, or a file of your own.", show_default="the calibration's, else tsis-domed"
        ),
    ] = None,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Choose the forces of an examination by the tissue: from one light press, or from a known modulus."""
    if (image is None) == (tissue_kpa is None):
        raise InputError("tsis protocol needs either the frame of a light press or --tissue-kpa")
    if image is None:
        used, tissue = chosen_probe(probe or DOMED), None
    else:
        used, tissue = _light_press(image, calibration, force_n, scale_mm, thickness_mm=thickness_mm, probe=probe)
    young_kpa = tissue_kpa if tissue is None else tissue.young_kpa if tissue.trusted else None
    forces: tuple[float, ...] = ()
    if young_kpa is not None:
        forces = tsis.inclusion.design.protocol_forces(used, tissue_young_kpa=young_kpa, thickness_mm=thickness_mm)
    document = tsis.report.envelope(
        "protocol",
        probe=used.name,
        thickness_mm=thickness_mm,
        tissue=None
        if young_kpa is None
        else {"young_kpa": young_kpa, "interval_kpa": None if tissue is None else list(tissue.interval_kpa)},
        trusted=young_kpa is not None,
        forces_n=list(forces),
    )
    result = CommandResult(document=document, tables=(), notes=_protocol_notes(young_kpa, tissue, forces))
    show_result(result, out, as_json=as_json, trusted=young_kpa is not None)


DOMED = "tsis-domed"


def _light_press(
    image: Path,
    calibration: Path | None,
    force_n: float | None,
    scale_mm: str | None,
    *,
    thickness_mm: float,
    probe: str | None,
) -> tuple[Probe, TissueModulus]:
    if calibration is None:
        raise InputError("a light press needs --calibration, that of the probe")
    usable = tsis.calibration.read_usable_calibration(calibration)
    scale = chosen_scale(usable, scale_mm)
    by_line = force_n is None and usable.calibration.force_line is not None
    if scale is None or not (force_n or by_line):
        raise InputError(
            "a light press needs --scale-mm and --force-n, where the calibration contains neither scale nor force line"
        )
    (pressed,), response = usable.pressed(read_frames([image], [force_n], scale), on_tissue=True)
    used = calibrated_probe(response.probe, unnamed=DOMED) if probe is None else chosen_probe(probe)
    found = tsis.inclusion.tissue_modulus(pressed, probe=used, calibration=response, thickness_mm=thickness_mm)
    return used, found


def _protocol_notes(young_kpa: float | None, tissue: TissueModulus | None, forces: Sequence[float]) -> tuple[str, ...]:
    if young_kpa is None:
        return (NOT_ON_TISSUE,)
    between = (
        "" if tissue is None else f", 90 % interval {tissue.interval_kpa[0]:.3g} to {tissue.interval_kpa[1]:.3g} kPa"
    )
    shown = " and ".join(f"{force:g} N" for force in forces)
    return (
        f"Tissue: {young_kpa:.3g} kPa{between}.",
        f"Press at {shown}, on the target and on tissue without an inclusion.",
        f"Then estimate with: tsis examine FRAME... --tissue-kpa {young_kpa:.3g}",
    )

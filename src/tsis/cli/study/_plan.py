"""``tsis study plan``: presses that search an area, and the inclusions that they do not miss."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli._options import AsJson, ProbeName
from tsis.cli._output import CommandResult, Out, show_result
from tsis.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tsis.study.search import DetectionRangeTable, ScanPlan


def plan(
    *,
    width_mm: Annotated[float, typer.Option(help="Width of the area, across the strips, mm.")],
    height_mm: Annotated[float, typer.Option(help="Height of the area, along the strips, mm.")],
    probe: ProbeName = "tsis-domed",
    spacing_mm: Annotated[float | None, typer.Option(help="Largest distance of neighbouring presses, mm.")] = None,
    overlap: Annotated[
        float | None, typer.Option(help="Or by how much of the face's diameter neighbours overlap, 0 to 0.95.")
    ] = None,
    detection_range_mm: Annotated[
        float | None, typer.Option(help="Or the largest distance from the axis at which the inclusion is detected, mm.")
    ] = None,
    detection_range: Annotated[
        Path | None,
        typer.Option(
            help="CSV of diameter_mm, depth_mm, reach_mm: detection range of inclusions. By default the range "
            "measured for this probe on the virtual rig."
        ),
    ] = None,
    diameter_mm: Annotated[
        float | None, typer.Option(help="Or the diameter of the inclusion that must not be missed, mm.")
    ] = None,
    depth_mm: Annotated[float | None, typer.Option(help="With --diameter-mm: its depth, mm.")] = None,
    press_s: Annotated[float, typer.Option(help="Time of one press, settling included, s.")] = 5.0,
    speed_mm_s: Annotated[float, typer.Option(help="Speed of the probe between presses, mm/s.")] = 20.0,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Plan presses over a rectangle, in strips as in palpation, and the smallest inclusion that they do not miss."""
    from tsis.study.search import (
        measured_detection_range,
        read_detection_range,
        scan_plan,
        smallest_found_mm,
        widest_plan,
    )

    requested = diameter_mm is not None or depth_mm is not None
    if sum((spacing_mm is not None, overlap is not None, detection_range_mm is not None, requested)) != 1:
        raise InputError(
            "exactly one of --spacing-mm, --overlap, --detection-range-mm, and --diameter-mm with --depth-mm must be "
            "given"
        )
    table = measured_detection_range(probe) if detection_range is None else read_detection_range(detection_range)
    if requested and (table is None or diameter_mm is None or depth_mm is None):
        raise InputError(
            f"--diameter-mm and --depth-mm must be given together, and with --detection-range where none is known for "
            f"the probe; got the probe {probe!r:.60}"
        )
    if table is not None and diameter_mm is not None and depth_mm is not None:
        detection_range_mm = _range_mm(table, diameter_mm, depth_mm)
    radius = tsis.catalog.load_probe(probe).radius_mm
    if detection_range_mm is not None:
        result = widest_plan(width_mm, height_mm, radius_mm=radius, extent_mm=detection_range_mm)
    else:
        result = scan_plan(width_mm, height_mm, radius_mm=radius, spacing_mm=spacing_mm, overlap=overlap)
    seconds = result.duration_s(press_s=press_s, speed_mm_s=speed_mm_s)
    smallest = {} if table is None else {float(h): smallest_found_mm(result, table, float(h)) for h in table.depth_mm}
    show_result(
        CommandResult(
            document=_document(result, seconds, smallest, table),
            tables=(_table(result, seconds), *_limits(smallest)),
            notes=_notes(table, measured=detection_range is None),
            figures={"plan": partial(_draw, result, detection_range_mm)},
        ),
        out,
        as_json=as_json,
    )


def _range_mm(table: DetectionRangeTable, diameter_mm: float, depth_mm: float) -> float:
    extent = table(diameter_mm, depth_mm)
    if extent == 0:
        raise InputError(
            f"--detection-range must exceed 0 for an inclusion of {diameter_mm:g} mm, {depth_mm:g} mm deep; got 0: "
            "choose a larger or a shallower one"
        )
    return extent


def _document(
    plan: ScanPlan, seconds: float, smallest: dict[float, float | None], table: DetectionRangeTable | None
) -> dict[str, object]:
    return tsis.report.envelope(
        "study plan",
        strips=plan.strips,
        presses_a_strip=plan.presses_a_strip,
        presses=plan.presses,
        strip_spacing_mm=plan.strip_spacing_mm,
        press_spacing_mm=plan.press_spacing_mm,
        overlap=list(plan.overlap),
        overhang_mm=list(plan.overhang_mm),
        travel_mm=plan.travel_mm,
        duration_s=seconds,
        worst_distance_mm=plan.worst_distance_mm,
        probability=None if table is None else table.probability,
        smallest_found=[{"depth_mm": depth, "diameter_mm": size} for depth, size in smallest.items()],
        positions_mm=plan.positions_mm.tolist(),
    )


def _table(plan: ScanPlan, seconds: float) -> Table:
    table = Table(title=f"{plan.width_mm:g} mm x {plan.height_mm:g} mm, face of {2 * plan.radius_mm:g} mm")
    for head in ("", "across", "along"):
        table.add_column(head)
    span, along = plan.overlap
    table.add_row("strips; presses a strip", str(plan.strips), str(plan.presses_a_strip))
    table.add_row("spacing / mm", f"{plan.strip_spacing_mm:.2f}", f"{plan.press_spacing_mm:.2f}")
    table.add_row("overlap of neighbours", f"{span:.0%}", f"{along:.0%}")
    table.add_row("face beyond the area / mm", *(f"{item:.1f}" for item in plan.overhang_mm))
    table.add_row("presses", str(plan.presses), "")
    table.add_row("time", f"{seconds / 60:.1f} min", "")
    table.add_row("farthest from any press / mm", f"{plan.worst_distance_mm:.2f}", "")
    return table


def _limits(smallest: dict[float, float | None]) -> tuple[Table, ...]:
    if not smallest:
        return ()
    table = Table(title="Smallest diameter that is not missed")
    table.add_column("depth / mm")
    table.add_column("diameter / mm")
    for depth, size in smallest.items():
        table.add_row(f"{depth:g}", "none up to 15" if size is None else f"{size:.1f}")
    return (table,)


def _notes(table: DetectionRangeTable | None, *, measured: bool) -> tuple[str, ...]:
    if table is None:
        return ("The detection between presses is unknown: give --detection-range, a table of detection ranges.",)
    whose = "of this probe on the virtual rig, in uneven tissue, with one false call in ten blanks," if measured else ""
    return (
        f"Not missed means: detected with a probability of at least {table.probability:g} by the nearest press, if "
        f"the table of detection ranges {whose + ' ' if whose else ''}is valid for this tissue.",
    )


def _draw(plan: ScanPlan, detection_range_mm: float | None) -> Figure:
    from matplotlib.figure import Figure

    from tsis.plots import draw_scan_plan as draw_plan

    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    ax = draw_plan(plan, figure.subplots(), extent_mm=detection_range_mm)
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8)
    figure.suptitle(f"{plan.presses} presses in {plan.strips} strips. {RESEARCH_USE_ONLY}", fontsize=8)
    return figure

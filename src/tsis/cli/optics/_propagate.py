"""``tsis optics propagate``: light in a thin guide under dents."""

from __future__ import annotations

from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

import tsis
from tsis.cli._options import AsJson, numbers
from tsis.cli._output import CommandResult, Out, show_result
from tsis.cli._progress import progress_bar

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from tsis.optics.propagation import Propagation, ThinGuide


FRACTIONS = ("guided", "reflected", "top", "bottom")


class PropagationMethod(StrEnum):
    """The wave solver."""

    BPM = "bpm"
    FDFD = "fdfd"


def propagate_command(
    *,
    dent_um: Annotated[str, typer.Option(help="Depths of the dent in micrometres, with commas between.")] = "0,2,4,6",
    method: Annotated[
        PropagationMethod,
        typer.Option(help="bpm: one way, a tenth of a second a depth; fdfd: all directions, seconds."),
    ] = PropagationMethod.BPM,
    tip_radius_um: Annotated[float, typer.Option(help="Radius of the round tip in micrometres.")] = 10.0,
    preset: Annotated[
        str, typer.Option(help="dissertation: n 1.16 to 1.13; realistic: PDMS 1.41 on glass 1.515.")
    ] = "dissertation",
    wavelength_um: Annotated[float, typer.Option(help="Vacuum wavelength in micrometres.")] = 0.55,
    modes: Annotated[int, typer.Option(help="How many guided modes to launch, the lowest first.")] = 12,
    length_um: Annotated[float, typer.Option(help="Length of guide on the grid in micrometres.")] = 40.0,
    step_um: Annotated[float | None, typer.Option(help="Size of a cell in micrometres; automatic if left out.")] = None,
    memory_gib: Annotated[float, typer.Option(help="Memory that the grid may take in GiB.")] = 2.0,
    as_json: AsJson = False,
    out: Out = None,
) -> None:
    """Propagate the modes of a thin guide under a dent: power that stays guided or leaves on either side."""
    guide = tsis.optics.propagation.thin_guide(preset)
    dents = [
        tsis.optics.propagation.Dent(depth_um=depth, tip_radius_um=tip_radius_um)
        for depth in numbers("--dent-um", dent_um)
    ]
    for dent in dents:
        tsis.optics.propagation.interfaces_um(guide, dent, [0.0])  # refuses a dent that is too deep
    results: list[Propagation] = []
    with progress_bar(f"waves by {method}") as advance:
        for dent in dents:
            advance(len(results), len(dents))
            result = tsis.optics.propagation.propagate(
                guide,
                dent,
                method=method.value,
                wavelength_um=wavelength_um,
                modes=modes,
                length_um=length_um,
                step_um=step_um,
                memory_gib=memory_gib,
            )
            results.append(result)
    response = CommandResult(
        document=_document(preset, guide, results),
        tables=(_table(preset, results),),
        notes=tuple(_notes(guide, results)),
        figures=_figures(results),
    )
    show_result(response, out, as_json=as_json)


def _document(preset: str, guide: ThinGuide, results: list[Propagation]) -> dict[str, Any]:
    first = results[0]
    return tsis.report.envelope(
        "optics propagate",
        preset=preset,
        index=guide.index,
        thickness_um=guide.thickness_um,
        method=first.method,
        wavelength_um=first.wavelength_um,
        n_eff=first.n_eff,
        clear_of_cut_off=first.clear,
        dents=[
            {
                "depth_um": result.dent.depth_um,
                "tip_radius_um": result.dent.tip_radius_um,
                "mean": {fraction: float(getattr(result.powers, fraction).mean()) for fraction in FRACTIONS},
                "modes": {fraction: getattr(result.powers, fraction) for fraction in FRACTIONS},
                "balance_error": result.powers.balance_error,
                "z_um": result.z_um,
                "top_per_um": result.top_per_um.mean(axis=1),
            }
            for result in results
        ],
    )


def _table(preset: str, results: list[Propagation]) -> Table:
    first = results[0]
    title = f"{preset} guide, {first.wavelength_um:g} um, mean of {len(first.n_eff)} modes by {first.method}"
    table = Table(title=title)
    for heading in ("dent / um", *(f"{fraction} / %" for fraction in FRACTIONS), "missing / %"):
        table.add_column(heading, justify="right")
    for result in results:
        means = [float(getattr(result.powers, fraction).mean()) for fraction in FRACTIONS]
        missing = abs(1 - sum(means))
        cells = (f"{round(100 * mean, 2) + 0.0:.2f}" for mean in means)  # no minus before nothing
        table.add_row(f"{result.dent.depth_um:g}", *cells, f"{100 * missing:.2g}")
    return table


def _notes(guide: ThinGuide, results: list[Propagation]) -> list[str]:
    first = results[0]
    notes = [
        "lengths are micrometres: the dissertation's mm of figures 3.4 to 3.6 belong to a guide of about 10 um",
        "layers under the dent are squeezed in one proportion, the plate stays, air fills the dent",
    ]
    if first.method == "bpm":
        notes.append(
            "bpm conserves the squared field, not exactly the power: the missing power measures its error; see fdfd"
        )
    near = [str(number) for number, clear in enumerate(first.clear) if not clear]
    if near:
        notes.append(f"near cut-off, so less exact: mode {', '.join(near)}")
    soft = guide.index[: len(guide.index) - guide.rigid_layers].max()
    stored = int((first.n_eff > soft).sum())
    if stored:
        notes.append(f"{stored} of {len(first.n_eff)} launched modes run only in the plate and sense little of a dent")
    return notes


def _figures(results: list[Propagation]) -> dict[str, Callable[[], Figure]]:
    sides: dict[str, Callable[[], Figure]] = {
        f"guide-{result.dent.depth_um:g}-um": partial(_side_view, result) for result in results
    }
    return {**sides, "light-out-of-the-top": partial(_series, results)}


def _side_view(result: Propagation) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    tsis.plots.guide_index(result, above).set(title=f"dent {result.dent.depth_um:g} µm deep", xlabel="")
    tsis.plots.guide_light(result, below)
    return figure


def _series(results: list[Propagation]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    tsis.plots.light_out_of_the_top(results, figure.subplots())
    return figure

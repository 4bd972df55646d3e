"""``tsis optics modes|propagate``: guided modes of a layered slab, and light in a thin guide under dents."""

from __future__ import annotations

from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.cli._options import AsJson, numbers
from tsis.cli._output import CommandResult, Out, show_result
from tsis.cli._progress import progress_bar, waiting
from tsis.errors import InputError
from tsis.present.page import Column, Table

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.optics import GuidedModes
    from tsis.optics.propagation import Propagation, ThinGuide


MOST_ROWS, MOST_CURVES = 50, 12


class Polarization(StrEnum):
    """The field along the layers: electric (TE) or magnetic (TM)."""

    TE = "TE"
    TM = "TM"


def modes(
    *,
    preset: Annotated[
        str, typer.Option(help="realistic: PDMS on glass; dissertation: the printed indices; both 10 µm thick.")
    ] = "realistic",
    index: Annotated[
        str | None, typer.Option(help="Refractive indices instead, from the pressed face up, with commas.")
    ] = None,
    thickness_um: Annotated[str | None, typer.Option(help="Thicknesses of these layers in µm, with commas.")] = None,
    index_below: Annotated[float, typer.Option(help="Index below the pressed face.")] = 1.0,
    index_above: Annotated[float, typer.Option(help="Index above the last layer.")] = 1.0,
    wavelength_um: Annotated[float, typer.Option(help="Wavelength in vacuum, µm.")] = 0.55,
    polarization: Polarization = Polarization.TE,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """All guided modes of a stack of layers, and the number that never reach the pressed face."""
    if (index is None) != (thickness_um is None):
        raise InputError("--index and --thickness-um must be given together; got one of them")
    if index is not None and thickness_um is not None:
        indices, thicknesses = numbers("--index", index), numbers("--thickness-um", thickness_um)
    else:
        guide = tsis.optics.propagation.thin_guide(preset)
        indices, thicknesses = guide.index.tolist(), guide.thickness_um.tolist()
    with waiting("finding modes"):
        result = tsis.optics.guided_modes(
            indices,
            thicknesses,
            wavelength_um=wavelength_um,
            index_below=index_below,
            index_above=index_above,
            polarization=polarization.value,
        )
    blind = result.above(indices[0])
    document = tsis.present.document.envelope(
        "optics modes",
        index=indices,
        thickness_um=thicknesses,
        index_below=index_below,
        index_above=index_above,
        wavelength_um=wavelength_um,
        polarization=polarization.value,
        count=len(result),
        never_sensing=blind,
        n_eff=result.n_eff,
    )
    response = CommandResult(
        document=document,
        tables=(_modes_table(result, indices[0]),) if len(result) else (),
        notes=tuple(_modes_notes(result, indices[0], blind)),
        figures={"modes": lambda: _figure(result)} if len(result) else {},
    )
    show_result(response, out, as_json=as_json)


def _evenly(count: int, most: int) -> list[int]:
    """At most ``most`` of the numbers below ``count``, including the first and last."""
    import numpy as np

    picked: list[int] = np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)).tolist()
    return picked


def _parted(guided: GuidedModes) -> NDArray[np.bool]:
    """Modes that decay between the pressed face and a layer that guides them."""
    import numpy as np

    index, n_eff = guided.layers.index[1:-1], guided.n_eff
    difference = [(n_eff < index[layer]) & (n_eff > index[:layer].min()) for layer in range(1, len(index))]
    return np.any(difference, axis=0) if difference else np.zeros(len(n_eff), dtype=bool)


def _modes_table(guided: GuidedModes, face: float) -> Table:
    parted = _parted(guided)
    shown = _evenly(len(guided), MOST_ROWS)
    part = "" if len(shown) == len(guided) else f" ({len(shown)} of them shown)"
    rows = []
    for mode in shown:
        n_eff = guided.n_eff[mode]
        extents = "fades away" if n_eff > face else "see its profile" if parted[mode] else "reaches it"
        rows.append((mode, n_eff, extents))
    return Table(
        title=f"{len(guided)} guided {guided.layers.polarization} modes{part}",
        columns=(Column(label="mode"), Column(label="n_eff", form=".15f"), "at the pressed face"),
        values=tuple(rows),
    )


def _modes_notes(guided: GuidedModes, face: float, blind: int) -> list[str]:
    if not len(guided):
        factor = tsis.optics.slab.thickness_factor(guided.layers)
        return [
            "Nothing is guided: the stack is below cut-off. "
            f"Layers {factor:.4g} times as thick, or a wavelength shorter by that factor, would guide a mode; "
            "so would equal indices below and above."
        ]
    surroundings = guided.layers.surroundings
    notes = [f"Every mode lies between {surroundings:g} and {guided.layers.index.max():g}; none is missed."]
    if blind:
        notes.append(
            f"{blind} of {len(guided)} modes ({blind / len(guided):.1%}) have n_eff above the face layer's {face:g}: "
            "they decay in it, only the layers above guide them, and they do not sense the pressed face."
        )
    difference = int(_parted(guided).sum()) - blind
    if difference > 0:
        notes.append(
            f"{difference} of {len(guided)} modes decay in a layer between the face and another guiding layer: "
            "those beyond it do not sense. Their profiles show which."
        )
    elif not blind:
        notes.append("Every mode reaches the pressed face: no barrier separates it from a guiding layer.")
    if len(guided) > MOST_CURVES:
        notes.append(f"A figure shows {MOST_CURVES} or fewer of the {len(guided)} modes.")
    return notes


def _figure(guided: GuidedModes) -> Figure:
    import numpy as np
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    levels = np.linspace(guided.n_eff[0], guided.n_eff[-1], MOST_CURVES)
    nearest = np.abs(guided.n_eff - levels[:, np.newaxis]).argmin(axis=1)
    shown: list[int] = np.unique(nearest).tolist()
    ax = tsis.present.figures.mode_profiles(guided, figure.subplots(), shown=shown)
    layers = guided.layers
    ax.set_title(
        f"{len(shown)} of {len(guided)} {layers.polarization} modes at {layers.wavelength_um:g} µm; "
        "the pressed face is on the left"
    )
    return figure


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
    return tsis.present.document.envelope(
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
    rows = []
    for result in results:
        means = [float(getattr(result.powers, fraction).mean()) for fraction in FRACTIONS]
        shares = (round(100 * mean, 2) + 0.0 for mean in means)  # no minus before nothing
        rows.append((result.dent.depth_um, *shares, 100 * abs(1 - sum(means))))
    return Table(
        title=title,
        columns=(
            Column(label="dent", unit="um"),
            *(Column(label=fraction, unit="%", form=".2f") for fraction in FRACTIONS),
            Column(label="missing", unit="%", form=".2g"),
        ),
        values=tuple(rows),
    )


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
    tsis.present.figures.guide_index(result, above).set(title=f"dent {result.dent.depth_um:g} µm deep", xlabel="")
    tsis.present.figures.guide_light(result, below)
    return figure


def _series(results: list[Propagation]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    tsis.present.figures.light_out_of_the_top(results, figure.subplots())
    return figure

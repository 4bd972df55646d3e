"""``tsis optics modes``: guided modes of a layered slab."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

import tsis
from tsis.cli._options import AsJson, numbers
from tsis.cli._output import CommandResult, Out, show_result
from tsis.cli._progress import waiting
from tsis.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.optics import GuidedModes


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
    document = tsis.report.envelope(
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
        tables=(_table(result, indices[0]),) if len(result) else (),
        notes=tuple(_notes(result, indices[0], blind)),
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


def _table(guided: GuidedModes, face: float) -> Table:
    parted = _parted(guided)
    shown = _evenly(len(guided), MOST_ROWS)
    part = "" if len(shown) == len(guided) else f" ({len(shown)} of them shown)"
    table = Table(title=f"{len(guided)} guided {guided.layers.polarization} modes{part}")
    table.add_column("mode", justify="right")
    table.add_column("n_eff", justify="right")
    table.add_column("at the pressed face")
    for mode in shown:
        n_eff = guided.n_eff[mode]
        extents = "fades away" if n_eff > face else "see its profile" if parted[mode] else "reaches it"
        table.add_row(str(mode), f"{n_eff:.15f}", extents)
    return table


def _notes(guided: GuidedModes, face: float, blind: int) -> list[str]:
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
    ax = tsis.plots.mode_profiles(guided, figure.subplots(), shown=shown)
    layers = guided.layers
    ax.set_title(
        f"{len(shown)} of {len(guided)} {layers.polarization} modes at {layers.wavelength_um:g} µm; "
        "the pressed face is on the left"
    )
    return figure

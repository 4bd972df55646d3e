"""``tsis optics``: light in the probe."""

from __future__ import annotations

from dataclasses import asdict
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.cli.options import (
    AimDeg,
    AsJson,
    HalfAngleDeg,
    LampHeightMm,
    ProbeOption,
    chosen_lit_probe,
    numbers,
    typed_options,
)
from tsis.cli.output import CommandResult, Out, show_result
from tsis.cli.progress import progress_bar, waiting
from tsis.errors import InputError, MechanicsError
from tsis.present.page import Column, Table

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.model.press import PressField
    from tsis.model.probe import Led, Probe
    from tsis.optics import GuidedModes
    from tsis.optics.angles import Acceptance
    from tsis.optics.propagation import Propagation, ThinGuide
    from tsis.optics.rays.tracing import TracedLight


def angles(
    *,
    probe: ProbeOption = "tsis-2011",
    half_angle_deg: HalfAngleDeg = None,
    height_mm: LampHeightMm = None,
    aim_deg: AimDeg = None,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Critical and acceptance angles of the probe's layers, beside the angles of its lamps."""
    chosen = chosen_lit_probe(probe, half_angle_deg, height_mm, aim_deg)
    result = tsis.optics.angles.acceptance(
        [layer.refractive_index for layer in chosen.layers] + [chosen.glass.refractive_index]
    )
    faced = [(led, tsis.optics.angles.layer_facing_lamp(chosen, led)) for led in chosen.leds if led.power > 0]
    lamps = [
        {**asdict(led), "height_mm": chosen.led_height_mm(led), "layer": layer, "widest_deg": _widest(led)}
        for led, layer in faced
    ]
    notes = (*_limits(result), *_lamps(result, faced))
    document = tsis.present.document.envelope("optics angles", probe=asdict(chosen), layers=asdict(result), leds=lamps)
    show_result(
        CommandResult(document=document, tables=(_angles_table(chosen, result),), notes=notes), out, as_json=as_json
    )


def _widest(led: Led) -> float:
    """Angle from the side wall's normal of the outermost ray of half intensity that meets the wall."""
    return min(abs(led.aim_deg) + led.half_angle_deg, 90.0)


def _name(layer: int, count: int) -> str:
    return "glass" if layer == count - 1 else "layer 1, at the face" if layer == 0 else f"layer {layer + 1}"


def _angles_table(probe: Probe, acceptance: Acceptance) -> Table:
    rows = []
    for layer, index in enumerate(acceptance.index):
        blind = acceptance.blind_deg[layer]
        rows.append((
            _name(layer, len(acceptance.index)),
            index,
            acceptance.critical_deg[layer],
            f"{acceptance.acceptance_deg[layer]:.2f}" + (" (all)" if acceptance.unlimited[layer] else ""),
            blind or None,
            acceptance.blind_fraction[layer] if blind else None,
        ))  # fmt: skip
    angles = ("critical", "acceptance", "never reaches the face below")
    return Table(
        title=f"{probe.name}: light through the side wall, from air; angles in degrees",
        columns=(
            "layer",
            Column(label="n", form=".4g"),
            *(Column(label=name, form=".2f") for name in angles),
            Column(label="of its angles", form=".0%"),
        ),
        values=tuple(rows),
    )


def _limits(acceptance: Acceptance) -> list[str]:
    import numpy as np

    low, high = acceptance.acceptance_deg.min(), acceptance.acceptance_deg.max()
    count = len(acceptance.index)
    notes = []
    if acceptance.unlimited.any():
        which = ", ".join(_name(layer, count) for layer in range(count) if acceptance.unlimited[layer])
        notes.append(f"n exceeds the square root of 2 in {which}: every ray that enters there from air stays.")
    if high > 75:
        notes.append(f"Acceptance is {low:.1f} to {high:.1f} degrees: it hardly limits the choice of a lamp.")
    else:
        notes.append(f"Acceptance is {low:.2f} to {high:.2f} degrees: lamps must stay within {low:.2f}.")
    notes.extend(
        f"Rays of n_eff between {acceptance.index[:layer].min():g} and {acceptance.index[layer]:g} never sense: light "
        f"that enters {_name(layer, count)} within {acceptance.blind_deg[layer]:.1f} degrees of the wall's normal "
        f"never reaches the pressed face, {acceptance.blind_fraction[layer]:.0%} of the angles of rays that stay in it."
        for layer in np.flatnonzero(acceptance.blind_deg).tolist()
    )
    return notes


def _lamps(acceptance: Acceptance, faced: list[tuple[Led, int]]) -> list[str]:
    """One note for lamps that differ only in their position around the probe."""
    correlation: dict[tuple[float, int], int] = {}
    for led, layer in faced:
        correlation[_widest(led), layer] = correlation.get((_widest(led), layer), 0) + 1
    notes = []
    for (widest, layer), count in correlation.items():
        accepts, name = acceptance.acceptance_deg[layer], _name(layer, len(acceptance.index))
        verdict = (
            f"within its acceptance of {accepts:.2f}: that cone stays in the probe."
            if widest <= accepts
            else f"beyond its acceptance of {accepts:.2f}: what enters further out leaks away."
        )
        blind = acceptance.blind_deg[layer]
        if widest <= blind:
            verdict += (
                f" But it lies within {blind:.1f} degrees and never reaches the face: change its aim or position."
            )
        notes.append(f"{count} lamp{'s' * (count > 1)} before {name}, half intensity at {widest:g} degrees, {verdict}")
    return notes


MOST_ROWS, MOST_CURVES = 50, 12


class Polarization(StrEnum):
    """The field along the layers: electric (TE) or magnetic (TM)."""

    TE = "TE"
    TM = "TM"


def modes(
    context: typer.Context,
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
    if index is not None and typed_options(context, ("preset",)):
        raise InputError("--preset must be left out with --index and --thickness-um, layers of your own")
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
        document=_propagation_document(preset, guide, results),
        tables=(_propagation_table(preset, results),),
        notes=tuple(_propagation_notes(guide, results)),
        figures=_propagation_figures(results),
    )
    show_result(response, out, as_json=as_json)


def _propagation_document(preset: str, guide: ThinGuide, results: list[Propagation]) -> dict[str, Any]:
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


def _propagation_table(preset: str, results: list[Propagation]) -> Table:
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


def _propagation_notes(guide: ThinGuide, results: list[Propagation]) -> list[str]:
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


def _propagation_figures(results: list[Propagation]) -> dict[str, Callable[[], Figure]]:
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


LIGHTEST_N, HEAVIEST_N = 1e-3, 50.0  # range of the search for the force of a depth
DEPTH_TOLERANCE = 0.02
PICTURED_RAYS = 36
WAYS = {
    "missed": "misses the probe",
    "reflected": "reflected at the side wall from outside",
    "side": "out through the side wall",
    "glass": "out through the glass, to the camera's side",
    "face": "out of the face into air, lost by curvature",
    "contact": "out through real contact",
    "absorbed": "absorbed",
    "cut_off": "in rays cut off, balance",
}


def trace(
    *,
    probe: ProbeOption = "tsis-2011",
    rays: Annotated[float, typer.Option(help="Rays to trace.")] = 1e6,
    seed: Annotated[int, typer.Option(help="Seed of their starts.")] = 1,
    tip_radius_mm: Annotated[
        float | None, typer.Option(help="Press a rigid sphere of this radius; untouched if left out.")
    ] = None,
    force_n: Annotated[float | None, typer.Option(help="Force of the sphere in newtons; 1 if left out.")] = None,
    depth_mm: Annotated[float | None, typer.Option(help="How deep the sphere sinks in mm, instead of a force.")] = None,
    half_angle_deg: HalfAngleDeg = None,
    height_mm: LampHeightMm = None,
    aim_deg: AimDeg = None,
    as_json: AsJson = False,
    out: Out = None,
) -> None:
    """Trace the lamps' light through layers and glass: where it goes, and maps of it on the face."""
    lit = chosen_lit_probe(probe, half_angle_deg, height_mm, aim_deg)
    pressed = _pressed(lit, tip_radius_mm, force_n, depth_mm)
    with progress_bar("tracing rays") as progress:
        result = tsis.optics.rays.tracing.trace_rays(lit, pressed, rays=rays, seed=seed, progress=progress)
    response = CommandResult(
        document=_trace_document(lit, pressed, result, seed),
        tables=(_trace_table(lit, pressed, result),),
        notes=_trace_notes(lit, result),
        figures=_trace_figures(lit, pressed, result, seed),
    )
    show_result(response, out, as_json=as_json)


def _pressed(
    probe: Probe, tip_radius_mm: float | None, force_n: float | None, depth_mm: float | None
) -> PressField | None:
    """Press of a sphere with a given force or depth."""
    if tip_radius_mm is None:
        if force_n is not None or depth_mm is not None:
            raise InputError("--tip-radius-mm must be given with --force-n or --depth-mm; got none")
        return None
    if force_n is not None and depth_mm is not None:
        raise InputError(f"--force-n or --depth-mm must be given, not both; got {force_n:g} N and {depth_mm:g} mm")
    with waiting("pressing the sphere"):
        if depth_mm is not None:
            force_n = _force_for(probe, tip_radius_mm, depth_mm)
        result = tsis.mechanics.small_strain.rigid_ball.indent(
            probe, sphere_radius_mm=tip_radius_mm, force_n=1.0 if force_n is None else force_n
        )
    return tsis.optics.rays.geometry.tip_press(
        result.radius_mm,
        result.face_displacement_mm,
        contact_radius_mm=result.contact_radius_mm,
        force_n=result.force_n,
    )


def _force_for(probe: Probe, tip_radius_mm: float, depth_mm: float) -> float:
    """The force that presses a sphere to the given depth."""
    import numpy as np
    from scipy.optimize import brentq

    tsis.model.require.require_number(
        "depth_mm", depth_mm, 1e-3, probe.thickness_mm, hint="millimetres, less than the layers"
    )

    def depth(log_force: float) -> float | None:
        """None where the force strains the probe beyond what the model describes."""
        try:
            return tsis.mechanics.small_strain.rigid_ball.indent(
                probe, sphere_radius_mm=tip_radius_mm, force_n=float(np.exp(log_force))
            ).depth_mm
        except MechanicsError:
            return None

    def too_deep(log_force: float) -> float:
        result = depth(log_force)
        return probe.thickness_mm if result is None else result - depth_mm

    lightest = depth(float(np.log(LIGHTEST_N)))
    if lightest is None or lightest > depth_mm:
        least = "more" if lightest is None else f"at least {lightest:.3g}, which {LIGHTEST_N:g} N give"
        raise InputError(f"depth_mm must be {least} for this sphere; got {depth_mm:g} (give --force-n instead)")
    force = brentq(too_deep, np.log(LIGHTEST_N), np.log(HEAVIEST_N), xtol=1e-4)
    reached = depth(force - 1e-3)
    if reached is None or abs(reached - depth_mm) > DEPTH_TOLERANCE * depth_mm:
        most = "less" if reached is None else f"at most {reached:.3g}"
        raise InputError(f"depth_mm must be {most} for this sphere, where small strain ends; got {depth_mm:g}")
    return float(np.exp(force))


def _trace_table(probe: Probe, pressed: PressField | None, traced: TracedLight) -> Table:
    state = "untouched"
    if pressed is not None:
        state = f"under {pressed.force_n:.3g} N, {pressed.face_displacement_mm[0]:.3g} mm deep"
    return Table(
        title=f"{probe.name}, {state}: {traced.rays:,} rays, {traced.meetings:.2f} meetings each",
        columns=(
            "where the light goes",
            Column(label="share", form=".4%"),
            Column(label="standard error", form=".4%"),
        ),
        values=tuple(
            (label, getattr(traced.tally, name), getattr(traced.standard_error, name)) for name, label in WAYS.items()
        ),
    )


def _trace_notes(probe: Probe, traced: TracedLight) -> tuple[str, ...]:
    entered = 1 - traced.tally.missed - traced.tally.reflected
    fraction = traced.out_of_range / entered if entered > 0 else 0.0
    observed = f"{traced.into_camera:.1e} of the light leaves" if traced.into_camera > 0 else "No ray left"
    return (
        f"{float(traced.arriving.sum()):.2%} of the light meets the face from inside, counted at every meeting.",
        *_reflected(probe),
        f"{fraction:.2%} of what enters can never reach an undented face: it entered above a layer whose "
        "index is below "
        "n sin(angle from the axis), as in glass above silicone.",
        f"{observed} the glass within a numerical aperture of {tsis.optics.rays.geometry.APERTURE:g}: a camera that "
        "looks along "
        "the axis sees what tissue scatters where light leaves through contact, not what a dent's curvature turns.",
    )


def _reflected(probe: Probe) -> tuple[str, ...]:
    """What a flat face keeps in; a dome lets light out even where nothing dents it."""
    if probe.face_curvature_mm is not None:
        return ()
    indices = [layer.refractive_index for layer in probe.layers] + [probe.glass.refractive_index]
    limit = float(tsis.optics.angles.acceptance(indices).acceptance_deg.min())
    return (f"Light up to {limit:.1f} degrees from the horizontal, in air, is totally reflected by an undented face.",)


def _trace_document(probe: Probe, pressed: PressField | None, traced: TracedLight, seed: int) -> dict[str, object]:
    return tsis.present.document.envelope(
        "optics trace",
        probe=asdict(probe),
        seed=seed,
        rays=traced.rays,
        force_n=None if pressed is None else pressed.force_n,
        depth_mm=None if pressed is None else float(pressed.face_displacement_mm[0]),
        tally=asdict(traced.tally),
        standard_error=asdict(traced.standard_error),
        into_camera=traced.into_camera,
        out_of_reach=traced.out_of_range,
        meetings=traced.meetings,
        x_mm=traced.x_mm,
        y_mm=traced.y_mm,
        arriving=traced.arriving,
        lost=traced.lost,
        coupled=traced.coupled,
    )


def _trace_figures(
    probe: Probe, pressed: PressField | None, traced: TracedLight, seed: int
) -> dict[str, Callable[[], Figure]]:
    figures: dict[str, Callable[[], Figure]] = {"rays": partial(_picture, probe, pressed, seed)}
    for what in ("arriving",) if pressed is None else ("arriving", "lost", "coupled"):
        figures[f"light-{what}"] = partial(_map, traced, what)
    return figures


def _picture(probe: Probe, pressed: PressField | None, seed: int) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.6), layout="constrained")
    tsis.present.figures.ray_picture(
        probe,
        tsis.optics.rays.tracing.trace_paths(probe, pressed, rays=PICTURED_RAYS, seed=seed),
        figure.subplots(),
        pressed=pressed,
    )
    return figure


def _map(traced: TracedLight, what: str) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    tsis.present.figures.light_on_face(traced, figure.subplots(), what=what)
    return figure


app = typer.Typer(name="optics", no_args_is_help=True)
app.command("propagate", epilog="Example: tsis optics propagate --dent-um 0,2,4,6 --out pressed-guide")(
    propagate_command
)
app.command("angles", epilog="Example: tsis optics angles --probe tsis-2011-printed-indices --half-angle-deg 30")(
    angles
)
app.command("modes", epilog="Example: tsis optics modes --index 1.41,1.515 --thickness-um 9,1 --out modes")(modes)
app.command("trace", epilog="Example: tsis optics trace --tip-radius-mm 10 --force-n 0.8 --rays 1e5 --out rays")(trace)

"""``tsis optics trace``: paths of the lamps' light, and light on the face."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.cli._options import AimDeg, AsJson, HalfAngleDeg, LampHeightMm, ProbeOption, chosen_lit_probe
from tsis.cli._output import CommandResult, Out, show_result
from tsis.cli._progress import progress_bar, waiting
from tsis.errors import InputError, MechanicsError
from tsis.present.page import Column, Table

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from tsis.model.press import PressField
    from tsis.model.probe import Probe
    from tsis.optics.rays.tracing import TracedLight


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
        document=_document(lit, pressed, result, seed),
        tables=(_table(lit, pressed, result),),
        notes=_notes(lit, result),
        figures=_figures(lit, pressed, result, seed),
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


def _table(probe: Probe, pressed: PressField | None, traced: TracedLight) -> Table:
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


def _notes(probe: Probe, traced: TracedLight) -> tuple[str, ...]:
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


def _document(probe: Probe, pressed: PressField | None, traced: TracedLight, seed: int) -> dict[str, object]:
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


def _figures(
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

"""Phantoms as the command line names them: a catalog entry, with values replaced one by one."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

import typer

from tsis.model import Inclusion, Phantom, Probe, load_phantom, load_probe

PhantomName = Annotated[str, typer.Option("--phantom", help="Name in the catalog; tsis simulate --list shows all.")]
ProbeName = Annotated[str, typer.Option("--probe", help="Name in the catalog; tsis simulate --list shows all.")]
ForceN = Annotated[float, typer.Option("--force-n", help="Force of the press in newtons.")]
ForcesN = Annotated[
    list[float],
    typer.Option(
        "--force-n",
        help="Force of a press in newtons; repeat it for several presses.",
        default_factory=lambda: [0.5, 1.0],
        show_default="0.5 and 1",
    ),
]
DiameterMm = Annotated[float | None, typer.Option("--diameter-mm", help="Diameter of the inclusion instead.")]
DepthMm = Annotated[float | None, typer.Option("--depth-mm", help="Depth of its top below the skin instead.")]
YoungKpa = Annotated[float | None, typer.Option("--young-kpa", help="Young's modulus of the inclusion instead.")]
HalfAngleDeg = Annotated[
    float | None, typer.Option("--half-angle-deg", help="Half-intensity angle of all lamps instead, degrees.")
]
LampHeightMm = Annotated[
    float | None, typer.Option("--height-mm", help="Height of all lamps above the face instead, mm.")
]
AimDeg = Annotated[
    float | None, typer.Option("--aim-deg", help="Aim of all lamps above the horizontal instead, degrees.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON and nothing else.")]


def chosen_phantom(name: str, diameter_mm: float | None, depth_mm: float | None, young_kpa: float | None) -> Phantom:
    """The catalog's phantom with the given values of its inclusion replaced."""
    phantom = load_phantom(name)
    if diameter_mm is None and depth_mm is None and young_kpa is None:
        return phantom
    start = phantom.inclusion or Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
    inclusion = replace(
        start,
        diameter_mm=start.diameter_mm if diameter_mm is None else diameter_mm,
        depth_mm=start.depth_mm if depth_mm is None else depth_mm,
        young_kpa=start.young_kpa if young_kpa is None else young_kpa,
    )
    # A changed phantom is no longer the catalog's, so it may not carry the catalog's name alone.
    return replace(phantom, name=f"{name} (changed)", inclusion=inclusion)


def chosen_probe(name: str, half_angle_deg: float | None, height_mm: float | None, aim_deg: float | None) -> Probe:
    """The catalog's probe with the given values of all its lamps replaced."""
    probe = load_probe(name)
    changes = {"half_angle_deg": half_angle_deg, "height_mm": height_mm, "aim_deg": aim_deg}
    given: dict[str, Any] = {what: value for what, value in changes.items() if value is not None}
    if not given:
        return probe
    leds = tuple(replace(led, **given) for led in probe.leds)
    return replace(probe, name=f"{name} (lamps changed)", leds=leds)

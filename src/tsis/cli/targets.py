"""Options by which commands name a phantom or a probe of the catalog, and values to replace in it."""

from __future__ import annotations

from typing import Annotated

import typer

PhantomName = Annotated[str, typer.Option("--phantom", help="Name in the catalog; tsis simulate --list shows all.")]
ProbeGiven = Annotated[
    str,
    typer.Option("--probe", help="Name in the catalog (tsis simulate --list), or a file of your own, as mine.toml."),
]
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

"""``tsis calibrate``: create, show and seal the calibration of a probe."""

from __future__ import annotations

import typer

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli._groups import DefaultCommand
from tsis.cli.calibrate._guide import guide, light
from tsis.cli.calibrate._make import make, seal, show

app = typer.Typer(
    name="calibrate",
    cls=DefaultCommand.named("guide"),
    help=(
        "Calibrate a probe, step by step; without --camera the virtual rig demonstrates it. "
        f"Its options: tsis calibrate guide --help. {RESEARCH_USE_ONLY}"
    ),
    epilog="Example: tsis calibrate --camera aravis: --gauge /dev/ttyUSB0 --probe tsis-2011 --name bench-2",
)
app.command("guide", epilog="Example: tsis calibrate guide --seed 3 --tip-mm 2 --tip-mm 10 --pad-kpa 5 --out first")(
    guide
)
app.command("make", epilog="Example: tsis calibrate make tsis-calibration-frames --days 90")(make)
app.command("light", epilog="Example: tsis calibrate light tsis-calibration-frames")(light)
app.command("show", epilog="Example: tsis calibrate show tsis-calibration/calibration.json")(show)
app.command("seal", epilog="Example: tsis calibrate seal values.json --out calibration.json")(seal)

__all__ = ["app"]

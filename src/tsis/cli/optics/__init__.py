"""``tsis optics``: light in the probe."""

from __future__ import annotations

import typer

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.cli.optics._angles import angles
from tsis.cli.optics._propagate import modes, propagate_command
from tsis.cli.optics._trace import trace

app = typer.Typer(name="optics", help=f"Light in the probe. {RESEARCH_USE_ONLY}", no_args_is_help=True)
app.command("propagate", epilog="Example: tsis optics propagate --dent-um 0,2,4,6 --out pressed-guide")(
    propagate_command
)
app.command("angles", epilog="Example: tsis optics angles --probe tsis-2011-printed-indices --half-angle-deg 30")(
    angles
)
app.command("modes", epilog="Example: tsis optics modes --index 1.41,1.515 --thickness-um 9,1 --out modes")(modes)
app.command("trace", epilog="Example: tsis optics trace --tip-radius-mm 10 --force-n 0.8 --rays 1e5 --out rays")(trace)

"""The program ``tsis``: its commands, and errors as one sentence."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.cli.demo import demo
from tsis.cli.examine import examine
from tsis.cli.simulate import simulate
from tsis.model.errors import TsisError

BAD_INPUT, INTERRUPTED = 2, 130

app = typer.Typer(
    name="tsis",
    help=f"Open software for optical tactile imaging. {RESEARCH_USE_ONLY}",
    epilog="Start with: tsis demo",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command(epilog="Example: tsis demo --phantom size-8 --seed 3 --out first-press")(demo)
app.command(epilog="Example: tsis examine press.png --reference untouched.png --scale-mm 0.051 --invert")(examine)
app.command(epilog="Example: tsis simulate --phantom depth-8 --force-n 0.7 --json")(simulate)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"tsis {__version__}")
        raise typer.Exit


@app.callback()
def root(
    *,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and stop.", is_eager=True, callback=_show_version)
    ] = False,
) -> None:
    """Read the options that come before the command."""


def main() -> None:
    """Run the program; wrong input ends with one sentence and the exit code 2, never with a traceback."""
    try:
        app()
    except TsisError as error:
        typer.echo(f"Error: {error}", err=True)
        sys.exit(BAD_INPUT)
    except KeyboardInterrupt:
        typer.echo("Interrupted; nothing was written.", err=True)
        sys.exit(INTERRUPTED)

"""The program ``tsis``: its commands, and errors as one sentence."""

from __future__ import annotations

import io
import os
import sys
import warnings
from functools import cache
from typing import Annotated, Any, NoReturn, TextIO

import typer

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.cli._console import console, login
from tsis.cli._demo import demo
from tsis.cli._design import design
from tsis.cli._examine import examine
from tsis.cli._exit_codes import BAD_INPUT, INTERRUPTED
from tsis.cli._hardness import hardness
from tsis.cli._serve import serve
from tsis.cli._simulate import simulate
from tsis.cli._sweep import app as sweep
from tsis.cli.acquire import acquire
from tsis.cli.calibrate import app as calibrate
from tsis.cli.match import app as match
from tsis.cli.optics import app as optics
from tsis.cli.records import app as records
from tsis.cli.study import app as study
from tsis.errors import TsisError, TsisWarning

_show_python_warning = warnings.showwarning

app = typer.Typer(
    name="tsis",
    help=f"Open software for optical tactile imaging. {RESEARCH_USE_ONLY}",
    epilog="Start with: tsis demo",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command(epilog="Example: tsis demo --phantom size-8 --seed 3 --out first-press")(demo)
app.command(epilog="Example: tsis console --phantom size-8")(console)
app.command(epilog="Example: tsis acquire --camera aravis: --target 3 --set exposure_ms=10")(acquire)
app.command(epilog="Example: tsis examine press.png --reference untouched.png --scale-mm 0.051 --invert")(examine)
app.command(epilog="Example: tsis simulate --phantom depth-8 --force-n 0.7 --json")(simulate)
app.command(epilog="Example: tsis design --probe tsis-domed --compare dome --compare forces --out design")(design)
app.command(epilog="Example: tsis hardness --demo --out first-touch")(hardness)
app.command(epilog="Example: tsis serve --phantom size-8 --force-n 0.7")(serve)
app.add_typer(calibrate)
app.add_typer(login)
app.add_typer(match)
app.add_typer(optics)
app.add_typer(records)
app.add_typer(study)
app.add_typer(sweep)


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


def run() -> None:
    """Run the program; wrong input ends with one sentence and the exit code 2, never with a traceback."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal of few letters shows the others by their number
            stream.reconfigure(errors="backslashreplace")
    warnings.showwarning = _show_warning
    try:
        code = _program()(args=sys.argv[1:] or ["--help"], standalone_mode=False)
    except TsisError as error:
        _stop(f"Error: {error}", BAD_INPUT)
    except BrokenPipeError:
        # Whoever read the output has gone; Python would complain once more while it closes the stream.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except OSError as error:
        _stop(f"Error: the result could not be printed or read: {error.strerror or error}", BAD_INPUT)
    except Exception as error:
        # What the parser says of a wrong option. Its class is private to typer in some versions and click's in others.
        message = getattr(error, "format_message", None)
        if message is None:
            raise
        _stop(f"Error: {message().strip()} (see --help)", BAD_INPUT)
    if code == INTERRUPTED:  # typer turns Ctrl-C into this code
        raise KeyboardInterrupt
    sys.exit(code if isinstance(code, int) else 0)


@cache
def _program() -> Any:
    """The parser of all commands, built once a process."""
    return typer.main.get_command(app)


def _show_warning(  # the signature of warnings.showwarning
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning of tsis as one sentence, any other as Python does."""
    if issubclass(category, TsisWarning):
        typer.echo(f"Warning: {message}", err=True)
    else:
        _show_python_warning(message, category, filename, lineno, file, line)


def _stop(sentence: str, code: int) -> NoReturn:
    typer.echo(sentence, err=True)
    sys.exit(code)

"""The program ``tsis``: its commands, and errors as one-line messages."""

from __future__ import annotations

import io
import logging
import os
import sys
import traceback
import warnings
from functools import cache
from typing import Annotated, Any, NoReturn, TextIO

import typer

import tsis
from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.cli.commands import CommandEntry, LazyCommands
from tsis.cli.progress import BAD_INPUT, FAILED, INTERRUPTED, exit_code_of, verbosity
from tsis.errors import TsisError, TsisWarning

_show_python_warning = warnings.showwarning

COMMANDS = {
    "demo": CommandEntry("tsis.cli.demo", "demo", example="tsis demo --phantom size-8 --seed 3 --out first-press"),
    "console": CommandEntry("tsis.cli.console", "console", example="tsis console --phantom size-8"),
    "acquire": CommandEntry(
        "tsis.cli.acquire",
        "acquire",
        example="tsis acquire --camera virtual --probe tsis-domed --phantom size-8 --frames 12 --out press-1",
    ),
    "examine": CommandEntry("tsis.cli.examine", "examine", example="tsis examine first-press"),
    "session": CommandEntry("tsis.cli.session", "session", example="tsis session gel-frames --yes"),
    "contacts": CommandEntry(
        "tsis.cli.contacts",
        "contacts",
        example="tsis contacts gel-frames/press-1.png --sensor gelsight-mini --reference gel-frames/untouched.png",
    ),
    "compare": CommandEntry("tsis.cli.compare", "compare", example="tsis compare first-press"),
    "depth": CommandEntry("tsis.cli.depth", "app", summary="Depth maps of a gel sensor: tsis depth FRAME..."),
    "track": CommandEntry(
        "tsis.cli.track",
        "track",
        example="tsis track press-1 --reference first-press/untouched.png --scale-mm 0.0336,0.0392",
    ),
    "simulate": CommandEntry(
        "tsis.cli.simulate", "simulate", example="tsis simulate --scan scan --lump 3,-2,5,9,40 --places 3 --json"
    ),
    "design": CommandEntry(
        "tsis.cli.design",
        "design",
        example="tsis design --probe tsis-domed --compare forces --compare frames --out design",
    ),
    "protocol": CommandEntry("tsis.cli.protocol", "protocol", example="tsis protocol --tissue-kpa 10"),
    "hardness": CommandEntry("tsis.cli.hardness", "hardness", example="tsis hardness --demo --out first-touch"),
    "indent": CommandEntry(
        "tsis.cli.indent", "indent", example="tsis indent press.csv --radius-mm 3 --thickness-mm 20"
    ),
    "sensor": CommandEntry(
        "tsis.cli.sensor", "app", summary="Files of gel sensors: GelSight, DIGIT, 9DTact, your own."
    ),
    "force": CommandEntry(
        "tsis.cli.force", "force", example="tsis force --demo --sensor gelsight-mini --out first-force"
    ),
    "serve": CommandEntry("tsis.cli.console", "serve", example="tsis serve --phantom size-8 --force-n 0.7"),
    "calibrate": CommandEntry(
        "tsis.cli.calibrate",
        "app",
        summary="Calibrate a probe, step by step; without --camera the virtual rig demonstrates it. "
        "Its options: tsis calibrate guide --help.",
    ),
    "login": CommandEntry(
        "tsis.cli.console", "login", summary="Names and passwords for a console that listens on a network."
    ),
    "map": CommandEntry("tsis.cli.map", "map_lumps", example="tsis map scan --tissue-kpa 5 --steps 6000 --out map"),
    "match": CommandEntry(
        "tsis.cli.match", "match", example="tsis match before.csv after.ply --out moved.csv --figure moved.png"
    ),
    "detect": CommandEntry(
        "tsis.cli.detect",
        "app",
        summary="Classify targets of a store by measured properties: none, and two kinds of inclusions.",
    ),
    "network": CommandEntry(
        "tsis.cli.network",
        "app",
        summary="Estimate inclusions by networks trained on simulated presses, as the dissertation does.",
    ),
    "optics": CommandEntry("tsis.cli.optics", "app", summary="Light in the probe."),
    "records": CommandEntry(
        "tsis.cli.records",
        "app",
        summary="Targets with their presses and estimates: list, verify, back up, recompute, export.",
    ),
    "study": CommandEntry(
        "tsis.cli.study", "app", summary="Blinded studies, performance cards, daily checks, validation; scan plans."
    ),
    "doctor": CommandEntry("tsis.cli.doctor", "doctor", example="tsis doctor"),
    "sweep": CommandEntry(
        "tsis.cli.sweep", "app", summary="Press many phantoms and write the results as one data set of Parquet files."
    ),
}

HELP = f"""Usage: tsis COMMAND [ARGUMENTS] [OPTIONS]        Start with: tsis demo

Open software for optical tactile imaging.
{RESEARCH_USE_ONLY}

  measure    acquire, examine, map, contacts, compare, hardness, indent, depth, force, track, match, detect, network
             Frames from a camera; inclusions and hardness with intervals; point matching.
  calibrate  calibrate, sensor
             The calibration of a probe: step by step, from saved frames, or sealed; files of gel sensors.
  simulate   demo, simulate, design, protocol, optics, sweep, serve
             The virtual probe, its mechanics and its light; a probe's design, its forces; many presses.
  records    records, session, study
             Targets with their presses and estimates; blinded studies.
  console    console, login, doctor
             The instrument in a browser; who may use it; what is installed.

tsis COMMAND --help shows an example and the options. Every command has --quiet and --verbose.
tsis --version prints the version; tsis --install-completion completes commands in your shell.
Exit codes: 0 done, 1 failed, 2 wrong input, 3 untrusted or refused, 130 interrupted.
"""

app = typer.Typer(
    name="tsis",
    cls=LazyCommands.of(COMMANDS, HELP),
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(requested: bool) -> None:
    if requested:
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
    """Run the program; an error gives one message and an exit code, never a traceback unless ``--verbose`` asks."""
    verbosity.quiet = verbosity.verbose = False
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # characters outside the terminal's encoding are escaped
            stream.reconfigure(errors="backslashreplace")
    warnings.showwarning = _show_warning
    logging.getLogger("tsis").addHandler(_TERMINAL)
    logging.getLogger("tsis").setLevel(logging.INFO)
    try:
        code = _program()(args=sys.argv[1:] or ["--help"], standalone_mode=False)
    except TsisError as error:
        if verbosity.verbose:
            traceback.print_exc()
        _stop(f"Error: {error}", exit_code_of(error))
    except BrokenPipeError:
        # The reader closed the pipe. Without this, Python reports it again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(FAILED)
    except OSError as error:
        _stop(f"Error: the result could not be printed or read: {error.strerror or error}", FAILED)
    except Exception as error:
        # An error of the parser. Its class is private to typer in some versions and click's in others.
        message = getattr(error, "format_message", None)
        if message is None:
            if verbosity.verbose:
                raise
            _stop(
                f"Error: a defect of tsis, {type(error).__name__}: {tsis.files.reading.one_line(error):.200} "
                "(repeat the command with --verbose and report what it prints)",
                FAILED,
            )
        _stop(f"Error: {message().strip()} (see --help)", BAD_INPUT)
    if code == INTERRUPTED:  # typer turns Ctrl-C into this code
        raise KeyboardInterrupt
    sys.exit(code if isinstance(code, int) else 0)


class _Terminal(logging.Handler):
    """Shows what the library logs to people on a terminal."""

    def emit(self, record: logging.LogRecord) -> None:
        if sys.stderr.isatty() and not verbosity.quiet:
            typer.echo(f"{record.getMessage()} ...", err=True)


_TERMINAL = _Terminal()


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
    """Print a warning of tsis as one line, any other as Python does."""
    if issubclass(category, TsisWarning):
        if not verbosity.quiet:
            typer.echo(f"Warning: {message}", err=True)
    else:
        _show_python_warning(message, category, filename, lineno, file, line)


def _stop(message: str, code: int) -> NoReturn:
    typer.echo(message, err=True)
    sys.exit(code)

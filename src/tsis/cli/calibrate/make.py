"""``tsis calibrate make``: the calibration of frames that were taken before."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tsis.calibration.session import SessionFolder
from tsis.calibration.session.result import DAYS
from tsis.cli.calibrate.outcome import made
from tsis.cli.console_output import publish
from tsis.cli.targets import AsJson

Days = Annotated[float, typer.Option(help="For how many days it will be good.")]
Out = Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")]
OUT = Path("tsis-calibration")


def make(
    session: Annotated[Path, typer.Argument(help="Folder of a session, with the frames of each step.")],
    *,
    days: Days = DAYS,
    out: Out = OUT,
    as_json: AsJson = False,
) -> None:
    """Make the calibration file from the frames of a session."""
    publish(made(SessionFolder(session), days=days), out, as_json=as_json)

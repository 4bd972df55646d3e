"""``tsis session``: any folder of frames becomes a session folder."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

import tsis
from tsis.cli.options import AsJson, ScaleMm, scale_of
from tsis.cli.output import print_json
from tsis.errors import InputError
from tsis.present.page import Table
from tsis.present.terminal import print_tables


def session(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Frames, with a table or JSON files of forces.")],
    *,
    scale_mm: ScaleMm = None,
    probe: Annotated[str, typer.Option(help="Name of the probe that pressed; left out: that of the calibration.")] = "",
    yes: Annotated[bool, typer.Option("--yes", help="Write what was guessed without asking.")] = False,
    as_json: AsJson = False,
) -> None:
    """Turn a folder of frames into a session folder: guess forces and roles, ask, and write presses.csv beside them.

    Forces come from a table (names of files and a force with its unit), JSON files beside the frames, or file names.
    """
    guessed = tsis.calibration.foreign_folder.guess_session(folder)
    scale = None if scale_mm is None else scale_of(scale_mm)
    unknown = [frame.file for frame in guessed if frame.force_n is None]
    rows = tuple(
        (frame.file, frame.role, "" if frame.force_n is None else f"{frame.force_n:g}", frame.source)
        for frame in guessed
    )
    notes = [] if not unknown else [f"No force of {len(unknown)} frames, as {unknown[0]}: a force line can read them."]
    if not as_json:
        print_tables([Table(title="Guessed", columns=("frame", "role", "force / N", "told by"), values=rows)], notes)
    if not yes and not _confirmed():
        raise InputError(f"{folder} stays as it is; correct its table or names, and repeat")
    written = tsis.calibration.foreign_folder.write_session(folder, guessed, mm_per_pixel=scale, probe=probe)
    if as_json:
        names = ("file", "role", "force_n", "source")
        frames = [{name: getattr(frame, name) for name in names} for frame in guessed]
        print_json(tsis.present.document.envelope("session", frames=frames, file=str(written)))
        return
    print_tables([], [], where=f"Session: {written}")


def _confirmed() -> bool:
    if not sys.stdin.isatty():
        raise InputError("guesses must be confirmed; there is no terminal to ask at: give --yes to accept them")
    return typer.confirm("Is this right?", err=True)

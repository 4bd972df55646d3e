"""``tsis calibrate seal``: a calibration file from values measured elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import tsis
from tsis.__about__ import CALIBRATION_FILE, VALID_DAYS
from tsis.cli._options import AsJson
from tsis.cli._output import people, print_json, print_notice
from tsis.cli.calibrate._make import Days


def seal(
    values: Annotated[Path, typer.Argument(help="JSON file with name, probe, response and further values.")],
    *,
    days: Days = VALID_DAYS,
    out: Annotated[Path, typer.Option(help="Calibration file to write; it must not exist.")] = Path(CALIBRATION_FILE),
    as_json: AsJson = False,
) -> None:
    """Check values written by hand, and write them as a calibration file with date, expiry and hash."""
    tsis.model.require_number("--days", days, 1, 3650)
    handwritten_calibration = tsis.calibration.file.read_handwritten_calibration(values, days)
    cited = tsis.calibration.file.write_calibration(handwritten_calibration, out)
    if as_json:
        print_json(tsis.report.envelope("calibrate seal", file=str(out.resolve()), sha256=cited))
        return
    console = people()
    console.print(f"Calibration: {out.resolve()}", markup=False, soft_wrap=True)
    console.print(f"Good until {handwritten_calibration.expires:%Y-%m-%d}; cited as {cited[:12]}")
    print_notice(console)

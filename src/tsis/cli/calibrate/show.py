"""``tsis calibrate show``: what a calibration file holds, and whether it may be used."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from tsis.calibration.file import calibration_sha256, read_calibration
from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.targets import AsJson
from tsis.model.errors import CalibrationError
from tsis.report.calibration import held_rows, measured_values, specification_notes, specification_rows
from tsis.report.document import envelope

SHEET = ("quantity", "measured", "fingertip", "printed")


def show(
    calibration: Annotated[Path, typer.Argument(help="Calibration file.")],
    *,
    as_json: AsJson = False,
) -> None:
    """Show a calibration file; one that was changed since it was written is refused."""
    known = read_calibration(calibration)
    try:
        known.require_usable(datetime.now(UTC))
        refusal = ""
    except CalibrationError as error:
        refusal = str(error)
    rows, sheet = held_rows(known), specification_rows(known)
    if as_json:
        print_json(
            envelope(
                "calibrate show",
                sha256=calibration_sha256(known),
                usable=not refusal,
                refusal=refusal,
                values=measured_values(known),
                specification=[dict(zip(SHEET, row, strict=True)) for row in sheet],
            )
        )
        return
    console = people()
    table = Table("quantity", "value", "95 % interval", title=escape(f"Calibration {known.name}"))
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    console.print(table)
    if sheet:
        printed = Table("quantity", "measured", "fingertip", "printed in the source", title="Specification sheet")
        for line in sheet:
            printed.add_row(*(escape(cell) for cell in line))
        console.print(printed)
        for note in specification_notes(known):
            console.print(f"- {note}", markup=False)
    console.print(refusal or "It may be used today.", markup=False)
    print_notice(console)

"""The light on dents, from the soft pads of a calibration session."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import people, print_json, print_notice
from tsis.cli._progress import progress_bar
from tsis.errors import CalibrationError


def light(
    session: Annotated[Path, typer.Argument(help="Folder of a session with pads (tsis calibrate --pad-kpa 5).")],
    *,
    as_json: AsJson = False,
) -> None:
    """Show what a dent does to the light, fitted with the gain to a session's pads and tips."""
    folder = tsis.calibration.session.SessionFolder(session)
    if not any(step.pad_kpa is not None and folder.done(step) for step in folder.plan()):
        raise CalibrationError(
            f"the session in {tsis.files.printable_path(folder.path)} must hold presses on soft flat pads; it holds "
            "none (tsis calibrate --pad-kpa 5 --pad-kpa 10)"
        )
    with progress_bar("reading the frames") as advance:
        stored, findings = tsis.calibration.session.calibrate(folder, progress=advance)
    dents = findings.dents
    assert dents is not None  # of every session with pads
    line = stored.force_line
    ratio = None if line is None else line.soft_ratio
    rows = tsis.report.light_rows(dents)
    if as_json:
        print_json(
            tsis.report.envelope(
                "calibrate light",
                gain_ratio=dents.gain_ratio,
                gain_sd=dents.gain_sd,
                product_sd=dents.product_sd,
                displacement_mm=dents.displacement_mm,
                presses=dents.presses,
                misfit=dents.misfit,
                force_ratio=None if ratio is None else {"value": ratio.value, "sd": ratio.sd},
                tissue=dents.response.provenance(),
            )
        )
        return
    console = people()
    table = Table("quantity", "value", "uncertainty", title=escape(f"Light on dents, {stored.name}"))
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    if ratio is not None:
        table.add_row("force by the line of the tips over that on pads", f"{ratio.value:.3f}", f"sd {ratio.sd:.3f}")
    console.print(table)
    print_notice(console)

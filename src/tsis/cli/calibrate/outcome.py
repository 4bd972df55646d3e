"""What every way to a calibration ends in: the file, a page, and the numbers on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from tsis.calibration.file import CALIBRATION_FILE, calibration_bytes, calibration_sha256
from tsis.calibration.file.plain_values import to_plain
from tsis.calibration.session import calibrate
from tsis.cli.console_output import CommandOutcome
from tsis.cli.progress import progress_bar
from tsis.report.calibration import calibration_document, calibration_notes, calibration_report, calibration_rows

if TYPE_CHECKING:
    from tsis.calibration.session import SessionFolder


def made(session: SessionFolder, *, days: float) -> CommandOutcome:
    """Make the calibration of a session."""
    with progress_bar("reading the frames") as advance:
        known, findings = calibrate(session, days=days, progress=advance)
    rows = calibration_rows(known, findings)
    table = Table("quantity", "value", "95 % interval", title=escape(f"Calibration {known.name} of {known.probe}"))
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    provenance = {"session": str(session.path), "terms": to_plain(session.terms()), "sha256": calibration_sha256(known)}
    return CommandOutcome(
        document=calibration_document(known, findings, provenance=provenance),
        page=calibration_report(known, findings, provenance=provenance),
        tables=(table,),
        notes=calibration_notes(known, findings),
        files={CALIBRATION_FILE: calibration_bytes(known)},
    )

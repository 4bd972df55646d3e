"""A calibration from the frames of a session, or from values measured elsewhere: file, page, and numbers."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.__about__ import CALIBRATION_FILE, VALID_DAYS
from tsis.cli._options import AsJson
from tsis.cli._output import CommandOutcome, print_json, publish
from tsis.cli._progress import progress_bar
from tsis.errors import CalibrationError
from tsis.present.terminal import people, print_notice, print_tables

if TYPE_CHECKING:
    from tsis.calibration.session import SessionFolder


def make_outcome(session: SessionFolder, *, days: float) -> CommandOutcome:
    """Compute the calibration of a session."""
    with progress_bar("reading the frames") as advance:
        stored, findings = tsis.calibration.session.calibrate(session, days=days, progress=advance)
    provenance = {
        "session": str(session.path),
        "terms": tsis.files.json_values.to_json_value(session.terms()),
        "sha256": tsis.calibration.file.calibration_sha256(stored),
    }
    return CommandOutcome(
        document=tsis.present.calibration.calibration_document(stored, findings, provenance=provenance),
        page=tsis.present.calibration.calibration_page(stored, findings, provenance=provenance),
        files={CALIBRATION_FILE: tsis.calibration.file.calibration_bytes(stored)},
    )


Days = Annotated[float, typer.Option(help="Days until it expires.")]
Out = Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")]
OUT = Path("tsis-calibration")


def make(
    session: Annotated[Path, typer.Argument(help="Folder of a session, with the frames of each step.")],
    *,
    days: Days = VALID_DAYS,
    out: Out = OUT,
    as_json: AsJson = False,
) -> None:
    """Compute the calibration file from the frames of a session."""
    publish(make_outcome(tsis.calibration.session.SessionFolder(session), days=days), out, as_json=as_json)


SHEET = ("quantity", "measured", "fingertip", "printed")


def show(
    calibration: Annotated[Path, typer.Argument(help="Calibration file.")],
    *,
    as_json: AsJson = False,
) -> None:
    """Show a calibration file; a file changed since it was written is refused."""
    stored = tsis.calibration.file.read_calibration(calibration)
    try:
        stored.require_usable(datetime.now(UTC))
        refusal = ""
    except CalibrationError as error:
        refusal = str(error)
    sheet = tsis.present.calibration.specification_rows(stored)
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "calibrate show",
                sha256=tsis.calibration.file.calibration_sha256(stored),
                usable=not refusal,
                refusal=refusal,
                values=tsis.present.calibration.measured_values(stored),
                specification=[dict(zip(SHEET, row, strict=True)) for row in sheet],
            )
        )
        return
    notes = (*tsis.present.calibration.specification_notes(stored), refusal or "It may be used today.")
    print_tables(tsis.present.calibration.content_tables(stored), notes)


def seal(
    values: Annotated[Path, typer.Argument(help="JSON file with name, probe, response and further values.")],
    *,
    days: Days = VALID_DAYS,
    out: Annotated[Path, typer.Option(help="Calibration file to write; it must not exist.")] = Path(CALIBRATION_FILE),
    as_json: AsJson = False,
) -> None:
    """Check values written by hand, and write them as a calibration file with date, expiry and hash."""
    tsis.model.require.require_number("--days", days, 1, 3650)
    handwritten_calibration = tsis.calibration.file.read_handwritten_calibration(values, days)
    cited = tsis.calibration.file.write_calibration(handwritten_calibration, out)
    if as_json:
        print_json(tsis.present.document.envelope("calibrate seal", file=str(out.resolve()), sha256=cited))
        return
    console = people()
    console.print(f"Calibration: {out.resolve()}", markup=False, soft_wrap=True)
    console.print(f"Good until {handwritten_calibration.expires:%Y-%m-%d}; cited as {cited[:12]}")
    print_notice(console)

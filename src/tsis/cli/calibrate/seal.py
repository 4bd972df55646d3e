"""``tsis calibrate seal``: values that a laboratory measured otherwise become a calibration file."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated, Any

import typer

from tsis.calibration.file import CALIBRATION_FILE, ProbeCalibration, write_calibration
from tsis.calibration.file.plain_values import from_plain
from tsis.calibration.session.result import DAYS
from tsis.cli.calibrate.make import Days
from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.targets import AsJson
from tsis.instrument import printable_path
from tsis.instrument.file_bytes import read_object
from tsis.model.check import require_number
from tsis.model.errors import FileInputError, InputError
from tsis.report.document import envelope

LARGEST_VALUES_BYTES = 2**20
BY_HAND = ("response", "scale")  # parts that a person can write down
FROM_FRAMES = ("reference", "force_line", "specification", "made", "expires")


def seal(
    values: Annotated[Path, typer.Argument(help="JSON file with name, probe, response and what else is known.")],
    *,
    days: Days = DAYS,
    out: Annotated[Path, typer.Option(help="Calibration file to write; it must not exist.")] = Path(CALIBRATION_FILE),
    as_json: AsJson = False,
) -> None:
    """Check values written by hand, and write them as a calibration file with date, expiry and hash."""
    require_number("--days", days, 1, 3650)
    known = read_values_to_seal(values, days)
    cited = write_calibration(known, out)
    if as_json:
        print_json(envelope("calibrate seal", file=str(out.resolve()), sha256=cited))
        return
    console = people()
    console.print(f"Calibration: {out.resolve()}", markup=False, soft_wrap=True)
    console.print(f"Good until {known.expires:%Y-%m-%d}; cited as {cited[:12]}")
    print_notice(console)


def read_values_to_seal(path: Path, days: float) -> ProbeCalibration:
    content = read_object(path, most=LARGEST_VALUES_BYTES)
    if measured := [name for name in FROM_FRAMES if content.get(name) is not None]:
        raise FileInputError(
            f"{printable_path(path)} must hold values written by hand (name, probe, camera, settings, response, scale); got "
            f"{', '.join(measured)}, which a session's frames give and whose date cannot be renewed (tsis calibrate)"
        )
    now = datetime.now(UTC).replace(microsecond=0)
    dated: dict[str, Any] = {**content, "made": now.isoformat(), "expires": (now + timedelta(days=days)).isoformat()}
    try:
        known: ProbeCalibration = from_plain(ProbeCalibration, dated, "calibration")
    except InputError as error:
        raise FileInputError(f"{printable_path(path)}: {error}") from error
    if all(getattr(known, part) is None for part in BY_HAND):
        raise FileInputError(f"{printable_path(path)} must hold at least one of {', '.join(BY_HAND)}; got none")
    return known

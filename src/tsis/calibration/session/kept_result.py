"""The calibration that was made from a session, in the session's folder: always that of the frames as they are."""

from __future__ import annotations

import secrets
from typing import TYPE_CHECKING

from tsis.calibration.file import CALIBRATION_FILE, calibration_bytes, calibration_sha256, read_calibration
from tsis.instrument import printable_path
from tsis.model.durable import write_durably
from tsis.model.errors import FileInputError, TsisError

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.calibration.session.folder import SessionFolder

SHORT = 12  # characters of an identity in names


def saved_calibration(session: SessionFolder) -> Path | None:
    """The file of the calibration that was made from the frames as they are; None before it was made."""
    file = session.path / CALIBRATION_FILE
    return file if file.exists() else None


def save_calibration(session: SessionFolder, known: ProbeCalibration) -> Path:
    """Write the calibration of the session's frames into its folder, over an earlier one, and return its file.

    Raises
    ------
    FileInputError
        When it cannot be written.
    """
    file = session.path / CALIBRATION_FILE
    content = calibration_bytes(known)
    try:
        write_durably(file, content)
    except OSError as error:
        raise _refused(file, error) from error
    return file


def archive_calibration(session: SessionFolder) -> Path | None:
    """Rename the calibration after its identity, because its frames change; its new name, or None where there is none.

    Results may cite it, so it is never removed; one that is damaged gets a name of its own.

    Raises
    ------
    FileInputError
        When it cannot be renamed.
    """
    file = saved_calibration(session)
    if file is None:
        return None
    aside = file.with_name(f"calibration-{_cited(file)}.json")
    try:
        file.replace(aside)
    except OSError as error:
        raise _refused(file, error) from error
    return aside


def _cited(file: Path) -> str:
    try:
        return calibration_sha256(read_calibration(file))[:SHORT]
    except TsisError:  # a damaged one may stand in nobody's way, and takes no other's place
        return f"damaged-{secrets.token_hex(SHORT // 2)}"


def _refused(file: Path, error: OSError) -> FileInputError:
    return FileInputError(f"{printable_path(file)} must be a file that can be written; got: {error.strerror or error}")

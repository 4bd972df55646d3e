"""The calibration that a file of ``tsis acquire`` cites, when it can be had."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sqlalchemy import select

from tsis.calibration.file import calibration_sha256
from tsis.instrument import printable_path
from tsis.model.errors import FileInputError, InputError
from tsis.records import tables

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.calibration import ProbeCalibration
    from tsis.records.importing.found import ImportOptions
    from tsis.records.store import Store


def stored_calibration(store: Store, cited: str) -> ProbeCalibration | None:
    """The calibration of that identity in a store; None where it is not in it, `RecordsError` when it is damaged."""
    with store.database.reading() as connection:
        found = connection.execute(select(tables.calibrations.c.id).where(tables.calibrations.c.id == cited)).first()
    return None if found is None else store.calibration(cited)


def cited_calibration(
    source: Path, citation: Any, given: ImportOptions
) -> tuple[ProbeCalibration | None, tuple[str, ...]]:
    """The calibration, and what to know when it is not to be had.

    Raises
    ------
    FileInputError
        When the citation is none.
    InputError
        When another calibration was given than the files cite.
    """
    if citation is None:
        return given.calibration, ()
    if not isinstance(citation, dict) or not isinstance(citation.get("sha256"), str):
        raise FileInputError(f"{printable_path(source)} must cite its calibration by its SHA-256; got {citation!r:.80}")
    wanted = citation["sha256"]
    if given.calibration is not None:
        if calibration_sha256(given.calibration) != wanted:
            raise InputError(
                f"--calibration must be the one that {printable_path(source)} cites, {wanted[:12]}; got "
                f"{calibration_sha256(given.calibration)[:12]} (leave it out, or find the other)"
            )
        return given.calibration, ()
    found = given.calibration_of(wanted)
    if found is not None:
        return found, ()
    name = str(citation.get("name", ""))[:60]
    return None, (f"the calibration {name!r} ({wanted[:12]}) is not in this store: give its file by --calibration",)

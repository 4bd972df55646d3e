"""The end of blindness, entered once, and the analyses after it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.__about__ import __version__
from tsis.errors import RecordsError
from tsis.files import LogDraft
from tsis.study._folder import ANALYSED, UNBLINDED, open_study, read_seal
from tsis.study._log import append_log
from tsis.study._values import require_short_name
from tsis.study._verification import verify_study

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.files import LogChain
    from tsis.study._folder import Study


def unblind(study: Study, *, by: str) -> Study:
    """Enter that the truth is read from now on; where it was entered before, nothing changes.

    What does not fit at this moment is entered with it, so that a later edit is told from an earlier one.

    Parameters
    ----------
    study
        Which one, with at least one reading.
    by
        Who unblinds it.

    Returns
    -------
    Study
        As it is then.

    Raises
    ------
    InputError
        When ``by`` is no name.
    RecordsError
        When there is no reading, or the truth cannot be read.
    """
    require_short_name("by", by)
    read_seal(study)
    if not open_study(study.folder).readings:
        raise RecordsError("a study must have a reading before it is unblinded; this one has none (tsis study run)")
    result = verify_study(study.folder)

    def drafts(chain: LogChain) -> list[LogDraft]:
        if any(entry.action == UNBLINDED for entry in chain.entries):
            return []
        faults = [fault.key for fault in result.faults]
        return [LogDraft(actor=by, action=UNBLINDED, content={"faults": faults, "tsis": __version__})]

    append_log(study.folder, drafts, damaged=True)
    return open_study(study.folder)


def enter_analysis(study: Study, *, by: str, folder: str, files: Mapping[str, str]) -> Study:
    """Enter an analysis by the hashes of its files.

    Parameters
    ----------
    study
        Unblinded.
    by
        Who made it.
    folder
        Its name below the study's folder; empty where it lies elsewhere.
    files
        SHA-256 by name.

    Raises
    ------
    RecordsError
        When the study is blind.
    """
    if study.unblinded is None:
        raise RecordsError("a study must be unblinded before it is analysed; this one is blind")
    entries = {"folder": folder, "files": dict(files), "tsis": __version__}
    append_log(
        study.folder,
        lambda _chain: [LogDraft(actor=require_short_name("by", by), action=ANALYSED, content=entries)],
        damaged=True,
    )
    return open_study(study.folder)

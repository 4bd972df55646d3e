"""The unblinding, entered once, and the analyses after it."""

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
    """Enter the unblinding of a study with readings and return the updated study; a second call changes nothing.

    The entry includes the faults at this time, so that earlier and later changes differ.

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
    verification = verify_study(study.folder)

    def drafts(chain: LogChain) -> list[LogDraft]:
        if any(entry.action == UNBLINDED for entry in chain.entries):
            return []
        faults = [fault.key for fault in verification.faults]
        return [LogDraft(actor=by, action=UNBLINDED, content={"faults": faults, "tsis": __version__})]

    append_log(study.folder, drafts, damaged=True)
    return open_study(study.folder)


def enter_analysis(study: Study, *, by: str, folder: str, files: Mapping[str, str]) -> Study:
    """Enter an analysis of an unblinded study with the hashes of its files.

    ``folder`` is its name below the study's folder, empty elsewhere; ``files`` has the SHA-256 by name.

    `RecordsError` when the study is blind.
    """
    if study.unblinded is None:
        raise RecordsError("a study must be unblinded before it is analysed; this one is blind")
    entries = {"folder": folder, "files": dict(files), "tsis": __version__}
    draft = LogDraft(actor=require_short_name("by", by), action=ANALYSED, content=entries)
    append_log(study.folder, lambda _chain: [draft], damaged=True)
    return open_study(study.folder)

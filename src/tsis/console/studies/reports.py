"""The newest report of a study, as its log knows it."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from tsis.console.statuses import AbsentError
from tsis.instrument.file_bytes import read_bytes
from tsis.model.errors import RecordsError
from tsis.report.study import PAGE, PAPER
from tsis.study.folder import ANALYSED
from tsis.study.verification import is_one_name

if TYPE_CHECKING:
    from tsis.study import Study

FORMS = {"html": PAGE, "pdf": PAPER}
LARGEST_BYTES = 128 * 2**20


def has_report(study: Study) -> bool:
    """Whether a report of it was written into its folder."""
    return _newest(study) is not None


def report_bytes(study: Study, form: str) -> bytes:
    """A file of the newest report.

    Parameters
    ----------
    study
        Whose.
    form
        A name in `FORMS`.

    Raises
    ------
    AbsentError
        When there is no report.
    RecordsError
        When the file was changed since, so that it may hold anything.
    FileInputError
        When it cannot be read.
    """
    newest = _newest(study)
    if newest is None:
        raise AbsentError(f"study {study.plan.name} must be analysed before it has a report; it is not")
    folder, told = newest
    content = read_bytes(study.folder / folder / FORMS[form], most=LARGEST_BYTES)
    if told.get(FORMS[form]) != hashlib.sha256(content).hexdigest():
        raise RecordsError(
            f"{FORMS[form]} must be as it was written; it was changed (verify the study, and analyse it again)"
        )
    return content


def _newest(study: Study) -> tuple[str, dict[str, str]] | None:
    """Folder below the study's, and hashes of its files by their names."""
    if study.unblinded is None:
        return None
    for entry in reversed(study.chain.entries):
        folder, files = entry.content.get("folder"), entry.content.get("files")
        if entry.action == ANALYSED and is_one_name(folder) and isinstance(files, dict):
            return folder, files
    return None


__all__ = ["FORMS", "has_report", "report_bytes"]

"""The sealed truth of a study, its unblinding, entered once, and the analyses after it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import RecordsError
from tsis.files import LogDraft, json_bytes, parse_object
from tsis.study._folder import ANALYSED, UNBLINDED, open_study, read_seal
from tsis.study._log import append_log
from tsis.study._plan import require_study_format, study_file_errors
from tsis.study._values import TargetTruth, parse_target_truth, require_short_name
from tsis.study._verification import verify_study

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.files import LogChain
    from tsis.study._folder import Study


FORMAT, VERSION = "tsis-study-truth", 1


@dataclass(frozen=True, slots=True, kw_only=True)
class SealedTruth:
    """The targets of all codes."""

    salt: str  # random hexadecimal digits
    seed: int  # of codes, order and drawn targets
    truths: Mapping[str, TargetTruth]  # by code

    def content(self) -> bytes:
        """Content of the file."""
        document = {
            "format": FORMAT,
            "version": VERSION,
            "notice": RESEARCH_USE_ONLY,
            "salt": self.salt,
            "seed": self.seed,
            "targets": {code: truth.json_values() for code, truth in self.truths.items()},
        }
        return json_bytes(document, indent=1)


def commitment(content: bytes) -> str:
    """SHA-256 of the file, which reveals later changes."""
    return hashlib.sha256(content).hexdigest()


def parse_seal(content: bytes, name: str) -> SealedTruth:
    """Parse the content of a ``sealed.json``; ``name`` identifies it in errors.

    `RecordsError` when it is no truth of this version.
    """
    with study_file_errors(name, "salt, seed and targets"):
        document = parse_object(content, name, values=8_000_000)
        require_study_format(document, FORMAT, VERSION)
        truths = {str(code): parse_target_truth(item) for code, item in document["targets"].items()}
        return SealedTruth(salt=document["salt"], seed=document["seed"], truths=truths)


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

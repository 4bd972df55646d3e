"""Verification of a study, its files against its log; the unblinding, and the entry of analyses."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeGuard

from tsis.__about__ import __version__
from tsis.errors import InputError, RecordsError
from tsis.files import LogDraft, as_path, one_line, read_bytes
from tsis.study._folder import (
    ANALYSED,
    CREATED,
    IMPORTED,
    PLAN,
    READING,
    SEAL,
    UNBLINDED,
    no_study,
    open_study,
    read_seal,
)
from tsis.study._log import LOG_FILE, append_log, commitment, read_log
from tsis.study._plan import parse_study_plan
from tsis.study._values import parse_reading, require_short_name

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from tsis.files import LogChain, LogEntry
    from tsis.study._folder import Study
    from tsis.study._plan import StudyPlan


ACTIONS = (CREATED, READING, IMPORTED, UNBLINDED, ANALYSED)
LEAST_HEAD = 12  # digits that identify a head
BEFORE, AFTER = "before the unblinding", "after the unblinding"


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyFault:
    """A change of a study since it was written."""

    file: str
    line: int  # 0 for the whole file
    what: str  # the end of a message
    when: str = ""  # before or after the unblinding; empty while the study is blind

    @property
    def key(self) -> str:
        """Identity of the fault."""
        return f"{self.file}:{self.line}"

    def __str__(self) -> str:
        position = f"{self.file}, line {self.line}" if self.line else self.file
        return f"{position} {self.what}" + (f" ({self.when})" if self.when else "") + "."


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyVerification:
    """Result of a verification.

    Attributes
    ----------
    faults
        In the order of files and lines; empty without any.
    head
        Hash of the log's last line. A copy elsewhere can show later that the log was cut short.
    lines
        Of the log.
    unblinded
        Time and person of the unblinding, as text; empty while the study is blind.
    """

    faults: tuple[StudyFault, ...]
    head: str
    lines: int
    unblinded: str

    @property
    def sound(self) -> bool:
        """Whether there are no faults."""
        return not self.faults


def verify_study(folder: str | os.PathLike[str], *, head: str | None = None) -> StudyVerification:
    """Compare every file of a study with its log, and every line of the log with the one before.

    Parameters
    ----------
    folder
        Of the study.
    head
        Hash, or its first 12 digits or more, from a report or an earlier verification: the log must still contain
        that line. Without it a cut at the end or a completely rewritten log cannot be detected.

    Raises
    ------
    InputError
        When the head is no hash, or there is no log to read.
    RecordsError
        When the folder has no study.
    """
    root = as_path(folder)
    if not any(os.path.lexists(root / name) for name in (PLAN, LOG_FILE)):
        raise RecordsError(no_study(root))
    chain = read_log(root)
    faults = [StudyFault(file=LOG_FILE, line=line, what=what) for line, what in sorted(chain.breaks.items())]
    faults += _file_faults(root, chain)
    faults += _order_faults(chain, _plan(root))
    if head is not None and not _holds(chain, head):
        cut = f"lacks the line with the hash {head[:16]}...: it was cut short or written anew"
        faults.append(StudyFault(file=LOG_FILE, line=0, what=cut))
    by = next((entry for entry in chain.entries if entry.action == UNBLINDED), None)
    return StudyVerification(
        faults=tuple(replace(fault, when=_when(fault, by)) for fault in faults),
        head=chain.head,
        lines=chain.lines,
        unblinded="" if by is None else one_line(f"{by.moment} by {by.actor}"),
    )


def _when(fault: StudyFault, unblinded: LogEntry | None) -> str:
    """Whether the entry of the unblinding lists the fault already."""
    if unblinded is None:
        return ""
    faults = unblinded.content.get("faults")
    return BEFORE if isinstance(faults, list) and fault.key in faults else AFTER


def _plan(path: Path) -> StudyPlan | None:
    try:
        return parse_study_plan(read_bytes(path / PLAN), PLAN)
    except (InputError, RecordsError):  # its hash reveals the change
        return None


def _file_faults(path: Path, chain: LogChain) -> list[StudyFault]:
    first = chain.entries[0] if chain.entries and chain.entries[0].action == CREATED else None
    faults = [] if first is not None else [StudyFault(file=LOG_FILE, line=1, what="does not tell how the study began")]
    begun = {} if first is None else first.content
    faults += _changed(path / PLAN, begun.get("study_sha256"))
    plan = _plan(path)
    truth_sha256 = begun.get("truth_sha256") or (plan.commitment if plan else None)
    faults += _changed(path / SEAL, truth_sha256)
    for entry in chain.entries:
        folder, files = entry.content.get("folder"), entry.content.get("files")
        if entry.action != ANALYSED or not folder or not isinstance(files, dict):
            continue
        for name, digest in files.items():
            if is_file_name(folder) and is_file_name(name):
                faults += _changed(path / folder / name, digest, shown_as=f"{one_line(folder)}/{one_line(name)}")
    return faults


def is_file_name(name: object) -> TypeGuard[str]:
    """Whether a name stays within its folder."""
    return isinstance(name, str) and name not in ("", ".", "..") and not set(name) & set("/\\\0")


def _changed(path: Path, digest: object, *, shown_as: str = "") -> list[StudyFault]:
    name = shown_as or path.name
    try:
        content = read_bytes(path)
    except InputError:
        return [StudyFault(file=name, line=0, what="is missing or cannot be read")]
    if digest is None or commitment(content) == digest:
        return []
    return [StudyFault(file=name, line=0, what="was changed: its SHA-256 is not the one in the log")]


def _order_faults(chain: LogChain, plan: StudyPlan | None) -> list[StudyFault]:
    """Lines with correct hashes that no study writes."""
    faults: list[StudyFault] = []
    counts: Counter[tuple[str, str, str, int]] = Counter()
    blind = True
    for entry in chain.entries:
        what = ""
        if entry.action not in ACTIONS or (entry.action == CREATED) != (entry.number == 1):
            what = "holds what no study writes there"
        elif entry.action in (READING, IMPORTED) and not blind:
            what = "is a reading that came after the unblinding; it is not counted"
        elif entry.action == UNBLINDED and not blind:
            what = "unblinds a second time"
        elif entry.action == READING:
            what = _reading_fault(entry, plan, counts)
        blind = blind and entry.action != UNBLINDED
        if what and entry.number not in chain.breaks:
            faults.append(StudyFault(file=LOG_FILE, line=entry.number, what=what))
    return faults


def _reading_fault(entry: LogEntry, plan: StudyPlan | None, counts: Counter[tuple[str, str, str, int]]) -> str:
    try:
        reading = parse_reading(entry.content)
    except InputError:
        return "holds no reading that a study writes"
    counts[reading.key] += 1
    if plan is not None and reading.code not in plan.codes:
        return "is a reading of a code that is not in the plan"
    return "is a reading that is there already" if counts[reading.key] > 1 else ""


def _holds(chain: LogChain, head: str) -> bool:
    requested = head.strip().lower()
    if len(requested) < LEAST_HEAD or set(requested) - set("0123456789abcdef"):
        raise InputError(f"head must be a hash that a report printed, {LEAST_HEAD} digits or more; got {head!r:.80}")
    return any(entry.hash.startswith(requested) for entry in chain.entries)


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

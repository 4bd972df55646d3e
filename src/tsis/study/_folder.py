"""A study: a folder with its plan, the sealed truth, and the log of every action."""

from __future__ import annotations

import getpass
import os
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from tsis.errors import InputError, RecordsError
from tsis.files import LogChain, LogDraft, as_path, file_error, printable_path, read_bytes
from tsis.model import require_number
from tsis.study._log import LOG_FILE, SealedTruth, append_log, commitment, parse_seal, read_log
from tsis.study._plan import StudyPlan, parse_study_plan
from tsis.study._values import DeviceReading, parse_reading, require_short_name

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from tsis.files import LogEntry


PLAN, SEAL = "study.json", "sealed.json"
CREATED, READING, IMPORTED, UNBLINDED, ANALYSED = "created", "reading", "imported", "unblinded", "analysed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A study at the time of reading: folder, plan, log, and readings; `open_study` reads it again."""

    folder: Path
    plan: StudyPlan
    chain: LogChain
    readings: tuple[DeviceReading, ...]  # unique ones from before the unblinding, in the order of entry

    @property
    def unblinded(self) -> LogEntry | None:
        """The log entry of the unblinding; None while the study is blind."""
        return next((entry for entry in self.chain.entries if entry.action == UNBLINDED), None)

    @property
    def devices(self) -> tuple[str, ...]:
        """Devices with readings, in the order of their first reading."""
        return tuple(dict.fromkeys(reading.device for reading in self.readings))

    def threshold_of(self, device: str) -> float:
        """The threshold of a device, fixed before the unblinding."""
        for entry in before_unblinding(self.chain):
            if entry.action == IMPORTED and entry.content.get("device") == device:
                return _threshold(entry, device)
        return self.plan.threshold

    def missing(self, device: str, operator: str | None = None) -> tuple[tuple[str, int], ...]:
        """Codes and repeats still to be read, in order, by an operator or by the one with most readings."""
        own = [reading for reading in self.readings if reading.device == device]
        if operator is None:
            operator = next((name for name, _ in Counter(reading.operator for reading in own).most_common(1)), "")
        done = Counter(reading.code for reading in own if reading.operator == operator)
        repeats = range(1, self.plan.repeats + 1)
        return tuple((code, repeat) for repeat in repeats for code in self.plan.codes if done[code] < repeat)


def open_study(folder: str | os.PathLike[str]) -> Study:
    """Open the study in a folder, without its truth; `verify_study` checks its integrity.

    Raises
    ------
    RecordsError
        When the folder has no readable study.
    """
    root = as_path(folder)
    if not os.path.isfile(root / PLAN):  # noqa: PTH113 - Path.is_file raises for names that no file can have
        raise RecordsError(no_study(root))
    plan, chain = parse_study_plan(read_bytes(root / PLAN), PLAN), read_log(root)
    return Study(folder=root, plan=plan, chain=chain, readings=_readings(chain, plan))


def no_study(path: Path) -> str:
    """The message for a folder without a study."""
    return f"{printable_path(path)} must be the folder of a study; it holds no {PLAN} (tsis study new makes one)"


def read_seal(study: Study) -> tuple[SealedTruth, bool]:
    """The truth of a study, and whether its hash matches the sealed one.

    Raises
    ------
    RecordsError
        When it cannot be read, or lacks a code.
    """
    content = read_bytes(study.folder / SEAL)
    seal = parse_seal(content, SEAL)
    lost = [code for code in study.plan.codes if code not in seal.truths]
    if lost:
        raise RecordsError(f"{SEAL} must tell what every code stands for; it lacks {', '.join(lost[:5])}")
    return seal, commitment(content) == committed(study.chain, study.plan)


def committed(chain: LogChain, plan: StudyPlan) -> str:
    """SHA-256 of the truth from the log's first line, or from the plan where that is unreadable."""
    first = chain.entries[0] if chain.entries else None
    sha256 = first.content.get("truth_sha256") if first is not None and first.action == CREATED else None
    return sha256 if isinstance(sha256, str) else plan.commitment


def enter_readings(
    study: Study, readings: Sequence[DeviceReading], *, actor: str, imported: Mapping[str, object] | None = None
) -> Study:
    """Enter readings, all or none, and return the updated study.

    ``imported`` describes the file of the readings for the log, if they come from one.

    Raises
    ------
    InputError
        When a code is not of this study, or a reading exists already.
    RecordsError
        When the study is unblinded, or its files were changed.
    """
    require_short_name("actor", actor)

    def drafts(chain: LogChain) -> list[LogDraft]:
        if any(entry.action == UNBLINDED for entry in chain.entries):
            raise RecordsError(
                "readings must be entered before a study is unblinded; this one is unblinded, so nothing was entered"
            )
        require_plan_unchanged(study.folder, chain)
        codes = frozenset(study.plan.codes)
        entered = {reading.key for reading in _readings(chain, study.plan, study)}
        for reading in readings:
            if reading.code not in codes:
                raise InputError(f"code must be one of this study's; got {reading.code!r:.40}")
            if reading.key in entered:
                raise InputError(
                    f"a reading must be entered once; {reading.code} was read by {reading.operator!r:.60} with "
                    f"{reading.device!r:.60}, repeat {reading.repeat}, already"
                )
            entered.add(reading.key)
        head = [] if imported is None else [LogDraft(actor=actor, action=IMPORTED, content=imported)]
        return [*head, *(LogDraft(actor=actor, action=READING, content=reading.json_values()) for reading in readings)]

    chain = append_log(study.folder, drafts, log_chain=study.chain)
    return replace(study, chain=chain, readings=_readings(chain, study.plan, study))


def require_plan_unchanged(folder: Path, chain: LogChain) -> None:
    """Refuse a study whose plan differs from the log's first line."""
    first = chain.entries[0] if chain.entries else None
    if first is None or first.content.get("study_sha256") != commitment(read_bytes(folder / PLAN)):
        raise file_error(
            folder / PLAN, "must be as it was made; it was changed (tsis study verify tells more)", RecordsError
        )


def before_unblinding(chain: LogChain) -> tuple[LogEntry, ...]:
    """The entries up to the first unblinding."""
    lines = chain.entries
    end = next((index for index, entry in enumerate(lines) if entry.action == UNBLINDED), len(lines))
    return lines[:end]


def _threshold(entry: LogEntry, device: str) -> float:
    try:
        return require_number("threshold", entry.content.get("threshold"), -1e12, 1e12)
    except InputError as error:
        raise RecordsError(
            f"{LOG_FILE}, line {entry.number}, must hold the threshold of {device!r:.60}; {error} (tsis study verify "
            "tells more)"
        ) from error


def _readings(chain: LogChain, plan: StudyPlan, study: Study | None = None) -> tuple[DeviceReading, ...]:
    """Readings of a log; those of an earlier state ``study`` of the same log are not parsed again."""
    by_key: dict[tuple[str, str, str, int], DeviceReading] = {}
    codes, start = set(plan.codes), 0 if study is None else len(study.chain.entries)
    if study is not None and start and chain.entries[start - 1 : start] == study.chain.entries[-1:]:
        by_key = {reading.key: reading for reading in study.readings}
    else:
        start = 0
    for entry in before_unblinding(chain)[start:]:
        if entry.action == READING:
            try:
                reading = parse_reading(entry.content)
            except InputError:  # `verify_study` reports it
                continue
            if reading.code in codes:
                by_key.setdefault(reading.key, reading)
    return tuple(by_key.values())


def user() -> str:
    """Name of the user of this machine, ``"unknown"`` without one."""
    try:
        return require_short_name("user", getpass.getuser())
    except (OSError, KeyError, InputError):  # a container's user without a name
        return "unknown"

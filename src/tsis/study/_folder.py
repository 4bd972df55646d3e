"""A study: a folder that holds its plan, the sealed truth, and the log of everything that was done."""

from __future__ import annotations

import getpass
import os
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from tsis.errors import InputError, RecordsError
from tsis.files import LogChain, LogDraft, as_path, printable_path, read_bytes
from tsis.model import require_number
from tsis.study._log import LOG_FILE, append_log, read_log
from tsis.study._plan import StudyPlan, parse_study_plan
from tsis.study._seal import SealedTruth, commitment, parse_seal
from tsis.study._values import DeviceReading, parse_reading, require_short_name

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from tsis.files import LogEntry


PLAN, SEAL = "study.json", "sealed.json"
CREATED, READING, IMPORTED, UNBLINDED, ANALYSED = "created", "reading", "imported", "unblinded", "analysed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A study as it was when it was read; `open_study` reads it again.

    Attributes
    ----------
    folder
        Where it lies.
    plan
        What was fixed beforehand.
    chain
        Its log.
    readings
        Those from before the unblinding, each once, in the order in which they were entered.
    """

    folder: Path
    plan: StudyPlan
    chain: LogChain
    readings: tuple[DeviceReading, ...]

    @property
    def unblinded(self) -> LogEntry | None:
        """Who unblinded it and when; None while it is blind."""
        return next((entry for entry in self.chain.entries if entry.action == UNBLINDED), None)

    @property
    def devices(self) -> tuple[str, ...]:
        """Devices that read targets, in the order in which they came."""
        return tuple(dict.fromkeys(reading.device for reading in self.readings))

    def threshold_of(self, device: str) -> float:
        """The threshold that was fixed for a device before the unblinding."""
        for entry in before_unblinding(self.chain):
            if entry.action == IMPORTED and entry.content.get("device") == device:
                return _threshold(entry, device)
        return self.plan.threshold

    def missing(self, device: str, operator: str | None = None) -> tuple[tuple[str, int], ...]:
        """Codes and repeats that are still to be read, in their order; of an operator, or of whoever read most."""
        done: Counter[str] = Counter()
        if operator is None:
            by = Counter(reading.operator for reading in self.readings if reading.device == device)
            operator = by.most_common(1)[0][0] if by else ""
        done.update(
            reading.code for reading in self.readings if (reading.device, reading.operator) == (device, operator)
        )
        return tuple(
            (code, repeat)
            for repeat in range(1, self.plan.repeats + 1)
            for code in self.plan.codes
            if done[code] < repeat
        )


def open_study(folder: str | os.PathLike[str]) -> Study:
    """Read the study in a folder, without its truth; whether it is as it was written `verify` tells.

    Raises
    ------
    RecordsError
        When it holds no study that can be read.
    """
    position = as_path(folder)
    if not os.path.isfile(position / PLAN):  # noqa: PTH113 - Path.is_file raises for names that no file can have
        raise RecordsError(no_study(position))
    plan, chain = parse_study_plan(read_bytes(position / PLAN), PLAN), read_log(position)
    return Study(folder=position, plan=plan, chain=chain, readings=_readings(chain, plan))


def no_study(path: Path) -> str:
    """What to say of a folder that holds none."""
    return f"{printable_path(path)} must be the folder of a study; it holds no {PLAN} (tsis study new makes one)"


def read_seal(study: Study) -> tuple[SealedTruth, bool]:
    """The truth of a study, and whether it is the one that was sealed.

    Raises
    ------
    RecordsError
        When it cannot be read, or some code is missing in it.
    """
    content = read_bytes(study.folder / SEAL)
    seal = parse_seal(content, SEAL)
    lost = [code for code in study.plan.codes if code not in seal.truths]
    if lost:
        raise RecordsError(f"{SEAL} must tell what every code stands for; it lacks {', '.join(lost[:5])}")
    return seal, commitment(content) == committed(study.chain, study.plan)


def committed(chain: LogChain, plan: StudyPlan) -> str:
    """SHA-256 of the truth as the log's first line has it, where it can be read; else as the plan has it."""
    first = chain.entries[0] if chain.entries else None
    reported = first.content.get("truth_sha256") if first is not None and first.action == CREATED else None
    return reported if isinstance(reported, str) else plan.commitment


def enter_readings(
    study: Study, readings: Sequence[DeviceReading], *, actor: str, imported: Mapping[str, object] | None = None
) -> Study:
    """Enter readings, all or none, and return the study as it is then.

    Parameters
    ----------
    study
        Which one.
    readings
        Of its targets.
    actor
        Who enters them.
    imported
        Of readings that came from a file: what the log is told of it.

    Raises
    ------
    InputError
        When a code is not of this study, or a reading is there already.
    RecordsError
        When the study is unblinded, or its files are not as they were written.
    """
    require_short_name("actor", actor)

    def drafts(chain: LogChain) -> list[LogDraft]:
        if any(entry.action == UNBLINDED for entry in chain.entries):
            raise RecordsError("readings must come before a study is unblinded; this one is, so nothing was entered")
        require_plan_unchanged(study.folder, chain)
        codes = frozenset(study.plan.codes)
        given = {reading.key for reading in _readings(chain, study.plan, study)}
        for reading in readings:
            if reading.code not in codes:
                raise InputError(f"code must be one of this study's; got {reading.code!r:.40}")
            if reading.key in given:
                raise InputError(
                    f"a reading must be entered once; {reading.code} was read by {reading.operator!r:.60} with "
                    f"{reading.device!r:.60}, repeat {reading.repeat}, already"
                )
            given.add(reading.key)
        head = [] if imported is None else [LogDraft(actor=actor, action=IMPORTED, content=imported)]
        return [*head, *(LogDraft(actor=actor, action=READING, content=reading.plain()) for reading in readings)]

    chain = append_log(study.folder, drafts, log_chain=study.chain)
    return replace(study, chain=chain, readings=_readings(chain, study.plan, study))


def require_plan_unchanged(folder: Path, chain: LogChain) -> None:
    """Refuse a study whose plan is not the one that the log begins with."""
    first = chain.entries[0] if chain.entries else None
    if first is None or first.content.get("study_sha256") != commitment(read_bytes(folder / PLAN)):
        raise RecordsError(
            f"{printable_path(folder / PLAN)} must be as it was made; it was changed (tsis study verify tells more)"
        )


def before_unblinding(chain: LogChain) -> tuple[LogEntry, ...]:
    """The lines up to the first that unblinds."""
    lines = chain.entries
    end = next((index for index, entry in enumerate(lines) if entry.action == UNBLINDED), len(lines))
    return lines[:end]


def _threshold(entry: LogEntry, device: str) -> float:
    try:
        return require_number("threshold", entry.content.get("threshold"), -1e12, 1e12)
    except InputError as error:
        raise RecordsError(
            f"{LOG_FILE}, line {entry.number}, must hold the threshold of {device!r:.60}; {error} (tsis "
            f"study verify tells "
            "more)"
        ) from error


def _readings(chain: LogChain, plan: StudyPlan, study: Study | None = None) -> tuple[DeviceReading, ...]:
    """Readings of a log; those of a ``study`` study are not parsed again when the log continues that of the study."""
    document: dict[tuple[str, str, str, int], DeviceReading] = {}
    codes, start = set(plan.codes), 0 if study is None else len(study.chain.entries)
    if study is not None and start and chain.entries[start - 1 : start] == study.chain.entries[-1:]:
        document = {reading.key: reading for reading in study.readings}
    else:
        start = 0
    for entry in before_unblinding(chain)[start:]:
        if entry.action == READING:
            try:
                reading = parse_reading(entry.content)
            except InputError:  # which `verify` tells
                continue
            if reading.code in codes:
                document.setdefault(reading.key, reading)
    return tuple(document.values())


def user() -> str:
    """Name of who uses this machine, as far as it is one."""
    try:
        return require_short_name("user", getpass.getuser())
    except (OSError, KeyError, InputError):  # a container's user without a name
        return "unknown"

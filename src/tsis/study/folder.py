"""A study: a folder with its plan, the sealed truth, and the log of every action.

Creation with targets from the catalog or drawn at random, entry of readings, verification against the log, unblinding.
"""

from __future__ import annotations

import getpass
import os
import secrets
from collections import Counter
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from tsis.__about__ import LARGEST_SEED, __version__
from tsis.catalog.phantoms import load_phantom
from tsis.catalog.probes import load_probe
from tsis.errors import InputError, RecordsError
from tsis.files.atomic import atomic_folder
from tsis.files.hash_chain import EMPTY_CHAIN, LogChain, LogDraft, link_entries
from tsis.files.reading import as_path, file_error, one_line, printable_path, read_bytes
from tsis.inclusion import InclusionPrior
from tsis.inclusion.tissue import protocol_forces
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.require import require_integer, require_number, require_type
from tsis.study.log import LOG_FILE, SealedTruth, append_log, commitment, parse_seal, read_log
from tsis.study.plan import (
    DeviceReading,
    StudyPlan,
    TargetTruth,
    coded,
    parse_reading,
    parse_study_plan,
    require_short_name,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from tsis.files.hash_chain import LogEntry

PLAN, SEAL = "study.json", "sealed.json"
CREATED, READING, IMPORTED, UNBLINDED, ANALYSED = "created", "reading", "imported", "unblinded", "analysed"
ACTIONS = (CREATED, READING, IMPORTED, UNBLINDED, ANALYSED)
LEAST_HEAD = 12  # digits that identify a head
BEFORE, AFTER = "before the unblinding", "after the unblinding"
MOST_TARGETS = 100_000  # of one kind
PRINTED = 8  # inclusions of the catalog for studies of detection
DIAMETER_MM, DEPTH_MM, YOUNG_KPA = (2.0, 15.0), (4.0, 12.0), (40.0, 120.0)
LARGEST_POISSON = 0.4949
CLEARANCE = 0.97  # of the slab: deepest end of an inclusion
THRESHOLD = 0.5


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
        for entry in _before_unblinding(self.chain):
            if entry.action == IMPORTED and entry.content.get("device") == device:
                return _threshold(entry, device)
        return self.plan.threshold

    @property
    def tally(self) -> tuple[tuple[str, str, int, int], ...]:
        """Device, operator, readings, and how many of them are undecided."""
        counter = Counter((reading.device, reading.operator) for reading in self.readings)
        undecided = Counter((reading.device, reading.operator) for reading in self.readings if reading.undecided)
        return tuple((*by, count, undecided[by]) for by, count in counter.items())

    @property
    def unread(self) -> tuple[tuple[str, int], ...]:
        """Devices that have read some targets and not all, with the number of those they lack."""
        read = {(reading.device, reading.code) for reading in self.readings}
        lacking = ((device, sum((device, code) not in read for code in self.plan.codes)) for device in self.devices)
        return tuple((device, left) for device, left in lacking if left)

    def require_read(self, cure: str) -> None:
        """Refuse an unblinding while a device lacks targets, with `InputError` that names the cure."""
        for device, left in self.unread:
            raise InputError(
                f"every target must be read before a study is unblinded; {device!r:.60} lacks {left} of "
                f"{len(self.plan.codes)} ({cure})"
            )

    def missing(self, device: str, operator: str | None = None) -> tuple[tuple[str, int], ...]:
        """Codes and repeats still to be read, in order, by an operator or by the one with most readings."""
        own = [reading for reading in self.readings if reading.device == device]
        if operator is None:
            operator = next((name for name, _ in Counter(reading.operator for reading in own).most_common(1)), "")
        done = Counter(reading.code for reading in own if reading.operator == operator)
        repeats = range(1, self.plan.repeats + 1)
        return tuple((code, repeat) for repeat in repeats for code in self.plan.codes if done[code] < repeat)


def new_study(
    folder: str | os.PathLike[str],
    targets: Sequence[TargetTruth] | Callable[[int], Sequence[TargetTruth]],
    *,
    name: str = "",
    seed: int | None = None,
    probe: str = "tsis-domed",
    forces_n: Sequence[float] | None = None,
    with_reference: bool = True,
    repeats: int = 1,
    threshold: float = THRESHOLD,
    actor: str = "",
    progress: Callable[[int, int], None] = lambda _done, _all: None,
) -> Study:
    """Create a study atomically.

    Raises `InputError` when a value lies outside its range, or there is no target; `RecordsError` when the folder
    exists or cannot be created.

    Parameters
    ----------
    folder
        A new one.
    targets
        The targets in any order, or a function that draws them for a seed.
    name
        Of the study; that of the folder by default.
    seed
        Determines codes and order. Anyone with the seed can recreate the study and read its truth; None draws one
        and stores it in the seal.
    probe, forces_n, with_reference
        Protocol of the virtual probe: by default 0.5 and 1 N with a dome, else 1 N.
    repeats
        Readings of every target by an operator.
    threshold
        Least score of a target that is called one with an inclusion, in [0, 1]: the virtual probe's score is a
        probability. Other devices bring their own threshold (`import_readings`).
    actor
        Who creates it; the user of this machine by default.
    progress
        Called with (targets sealed, all): 100,000 take seconds.
    """
    root = as_path(folder)
    published_seed = seed
    seed = secrets.randbelow(LARGEST_SEED) if seed is None else require_integer("seed", seed, 0, LARGEST_SEED)
    listed = tuple(targets(seed) if callable(targets) else targets)
    if not listed:
        raise InputError("targets must be at least one; got none")
    for item in listed:
        require_type("targets", item, TargetTruth)
    truths = coded(listed, seed)
    sealed = SealedTruth(salt=secrets.token_hex(32), seed=seed, truths=truths).content(progress)
    if forces_n is None:
        forces_n = protocol_forces(load_probe(probe), tissue_young_kpa=InclusionPrior().tissue_young_kpa)
    plan = StudyPlan(
        name=name or root.absolute().name,  # to resolve fails at loops of links
        seed=published_seed,
        probe=probe,
        forces_n=tuple(forces_n),
        with_reference=with_reference,
        repeats=repeats,
        threshold=require_number("threshold", threshold, 0.0, 1.0, hint="probability of an inclusion"),
        codes=tuple(truths),
        commitment=commitment(sealed),
        made=datetime.now(UTC),
        tsis=__version__,
    )
    planned = plan.content()
    begun = {"study_sha256": commitment(planned), "truth_sha256": plan.commitment, "tsis": __version__}
    draft_entry = LogDraft(actor=require_short_name("actor", actor or user()), action=CREATED, content=begun)
    first = link_entries(EMPTY_CHAIN, [draft_entry], plan.made)
    try:
        with atomic_folder(root) as draft:
            (draft / PLAN).write_bytes(planned)
            handle = os.open(draft / SEAL, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "wb") as file:
                file.write(sealed)
            (draft / LOG_FILE).write_bytes(f"{first[0].line()}\n".encode())
    except FileExistsError as error:
        raise file_error(
            root, "must be a new name; there is such a file or folder (choose another)", RecordsError
        ) from error
    except (OSError, ValueError) as error:
        raise file_error(root, f"must be a folder that can be written; got: {one_line(error)}", RecordsError) from error
    return open_study(root)


def open_study(folder: str | os.PathLike[str]) -> Study:
    """Open the study in a folder, without its truth; `verify_study` checks its integrity.

    Raises `RecordsError` when the folder has no readable study.
    """
    root = as_path(folder)
    if not os.path.isfile(root / PLAN):  # noqa: PTH113 - Path.is_file raises for names that no file can have
        raise RecordsError(_no_study(root))
    plan, chain = parse_study_plan(read_bytes(root / PLAN), PLAN), read_log(root)
    return Study(folder=root, plan=plan, chain=chain, readings=_readings(chain, plan))


def _no_study(path: Path) -> str:
    """The message for a folder without a study."""
    return f"{printable_path(path)} must be the folder of a study; it holds no {PLAN} (tsis study new makes one)"


def read_seal(study: Study) -> tuple[SealedTruth, bool]:
    """The truth of a study, and whether its hash matches the sealed one.

    Raises `RecordsError` when it cannot be read, or lacks a code.
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

    Raises `InputError` when a code is not of this study, or a reading exists already; `RecordsError` when the study is
    unblinded, or its files were changed.
    """
    require_short_name("actor", actor)

    def drafts(chain: LogChain) -> list[LogDraft]:
        if any(entry.action == UNBLINDED for entry in chain.entries):
            raise RecordsError(
                "readings must be entered before a study is unblinded; this one is unblinded, so nothing was entered"
            )
        _require_plan_unchanged(study.folder, chain)
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


def _require_plan_unchanged(folder: Path, chain: LogChain) -> None:
    """Refuse a study whose plan differs from the log's first line."""
    first = chain.entries[0] if chain.entries else None
    if first is None or first.content.get("study_sha256") != commitment(read_bytes(folder / PLAN)):
        raise file_error(
            folder / PLAN, "must be as it was made; it was changed (tsis study verify tells more)", RecordsError
        )


def _before_unblinding(chain: LogChain) -> tuple[LogEntry, ...]:
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
    for entry in _before_unblinding(chain)[start:]:
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


def unblind(study: Study, *, by: str) -> Study:
    """Enter the unblinding of a study with readings and return the updated study; a second call changes nothing.

    The entry includes the faults at this time, so that earlier and later changes differ.

    Raises `InputError` when ``by`` is no name; `RecordsError` when there is no reading, or the truth cannot be read.
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
        place = f"{self.file}, line {self.line}" if self.line else self.file
        return f"{place} {self.what}" + (f" ({self.when})" if self.when else "") + "."


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyVerification:
    """Result of a verification."""

    faults: tuple[StudyFault, ...]  #: in the order of files and lines; empty without any
    head: str  #: Hash of the log's last line. A copy elsewhere can show later that the log was cut short.
    lines: int  #: of the log
    unblinded: str  #: time (UTC) and person of the unblinding, as text; empty while the study is blind

    @property
    def sound(self) -> bool:
        """Whether there are no faults."""
        return not self.faults


def verify_study(folder: str | os.PathLike[str], *, head: str | None = None) -> StudyVerification:
    """Compare every file of a study with its log, and every line of the log with the one before.

    With the ``head`` of a report or of an earlier verification, a hash or its first 12 digits or more, the log must
    still contain that line. Without it a cut at the end or a completely rewritten log cannot be detected. Raises
    `InputError` when the head is no hash, or there is no log to read, and `RecordsError` when the folder has no study.
    """
    root = as_path(folder)
    if not any(os.path.lexists(root / name) for name in (PLAN, LOG_FILE)):
        raise RecordsError(_no_study(root))
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
        unblinded="" if by is None else one_line(f"{by.moment[:19].replace('T', ' ')} UTC by {by.actor}"),
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
    digits = head.strip().lower()
    if len(digits) < LEAST_HEAD or set(digits) - set("0123456789abcdef"):
        raise InputError(f"head must be a hash that a report printed, {LEAST_HEAD} digits or more; got {head!r:.80}")
    return any(entry.hash.startswith(digits) for entry in chain.entries)


def printed_targets(present: int = PRINTED, blank: int = PRINTED) -> tuple[TargetTruth, ...]:
    """Phantoms ``detection-1`` to ``detection-8`` of the catalog in turn, and ``detection-blank``; at least one target.

    Raises `InputError` when a number is negative or too large, or both are 0.

    Examples
    --------
    >>> [target.has_inclusion for target in printed_targets(1, 2)]
    [True, False, False]
    """
    _check_numbers(present, blank)
    names = [f"detection-{1 + number % PRINTED}" for number in range(present)] + ["detection-blank"] * blank
    return tuple(TargetTruth(label=name, phantom=_unnamed(load_phantom(name))) for name in names)


def random_targets(present: int, blank: int, *, rng: np.random.Generator) -> tuple[TargetTruth, ...]:
    """Inclusions of 2 to 15 mm, 4 to 12 mm deep, of 40 to 120 kPa, and blanks, at least one target in all.

    Tissue of both is drawn from what the estimator assumes, `tsis.inclusion.InclusionPrior`; the slab's thickness is
    drawn again until the inclusion fits.

    Raises `InputError` when a number is negative or too large, or both are 0.
    """
    _check_numbers(present, blank)
    require_type("rng", rng, np.random.Generator)
    prior = InclusionPrior()
    drawn = {f"random-{number}": _drawn_with_inclusion(prior, rng) for number in range(1, present + 1)}
    drawn |= {f"blank-{number}": _drawn_tissue(prior, rng, at_least_mm=0.0) for number in range(1, blank + 1)}
    return tuple(TargetTruth(label=label, phantom=phantom) for label, phantom in drawn.items())


def _drawn_with_inclusion(prior: InclusionPrior, rng: np.random.Generator) -> Phantom:
    diameter, depth, young = (float(rng.uniform(*ends)) for ends in (DIAMETER_MM, DEPTH_MM, YOUNG_KPA))
    tissue = _drawn_tissue(prior, rng, at_least_mm=(diameter + depth) / CLEARANCE)
    lump = Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young, poisson=tissue.poisson)
    return replace(tissue, inclusion=lump)


def _drawn_tissue(prior: InclusionPrior, rng: np.random.Generator, *, at_least_mm: float) -> Phantom:
    young = prior.tissue_young_kpa * float(np.exp(prior.tissue_young_sd * rng.standard_normal()))
    poisson = min(prior.poisson + prior.poisson_sd * float(rng.standard_normal()), LARGEST_POISSON)
    while True:
        thickness = prior.thickness_mm * float(np.exp(prior.thickness_sd * rng.standard_normal()))
        if thickness > at_least_mm:
            return Phantom(young_kpa=young, thickness_mm=thickness, poisson=poisson)


def _check_numbers(present: int, blank: int) -> None:
    require_integer("present", present, 0, MOST_TARGETS)
    require_integer("blank", blank, 0 if present else 1, MOST_TARGETS, hint="a study needs a target")


def _unnamed(phantom: Phantom) -> Phantom:
    """The phantom without its name and note, which would identify it."""
    return replace(phantom, name="", assumed=())

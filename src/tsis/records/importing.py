"""Import into a store: frames, snapshots, bundles and results, each once and press by press."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

from sqlalchemy import select

from tsis.calibration.file import calibration_sha256
from tsis.errors import InputError, RecordsError, TsisError
from tsis.instrument.image_files import whole_levels
from tsis.records.blobs import frame_bytes
from tsis.records.places import press_inputs
from tsis.records.provenance import environment
from tsis.records.reader import MOST_AT_ONCE
from tsis.records.rows import press_of_row, press_query, target_of_row
from tsis.records.schema import press_table, target_table
from tsis.records.sources import ImportBatch, ImportOptions, IncomingPress, snapshots
from tsis.records.values import LONGEST_NAME

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.calibration.frames import UsableCalibration
    from tsis.mapping.lump_map import LumpMap
    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, StoredMap, StoredPress, Target, TargetRecord


def target_by_number(store: Store, number: int) -> Target | None:
    """The target of this number, or None."""
    return _target(store, target_table.c.number == number)


def stored_frames(store: Store, frames: Sequence[IncomingPress]) -> tuple[StoredPress, ...]:
    """Presses of any target with the same frame or the same source file.

    Another release of the PNG library may give the same levels another hash; the hash of the source file is the same.
    """
    same_levels = store.presses_of_frames([frame.frame for frame in frames])
    present = {press.frame for press in same_levels}
    missing = {frame.sha256: frame.name for frame in frames if frame.frame not in present}
    same_name = _presses_by_name(store, sorted(set(missing.values())))
    return (*same_levels, *(press for press in same_name if press.settings.get("sha256") in missing))


def match_presses(frames: Sequence[IncomingPress], presses: Iterable[StoredPress]) -> list[StoredPress | None]:
    """The press of each frame, each press at most once, or None.

    A press matches by levels or source file, and by name, else by time.
    """
    unmatched: dict[tuple[object, object], deque[StoredPress]] = {}
    for press in presses:
        for content in {press.frame, press.settings.get("sha256")} - {None}:
            for label in (press.name, press.taken):
                unmatched.setdefault((content, label), deque()).append(press)
    used: set[str] = set()
    matches: list[StoredPress | None] = []
    for frame in frames:
        keys = [(content, label) for label in (frame.name, frame.taken) for content in (frame.frame, frame.sha256)]
        match = next((item for key in keys if (item := _unused(unmatched.get(key), used)) is not None), None)
        if match is not None:
            used.add(match.id)
        matches.append(match)
    return matches


def target_with(store: Store, frames: Sequence[IncomingPress], presses: Sequence[StoredPress]) -> Target | None:
    """The target of these frames, or None for a new one; ``presses`` is the result of `stored_frames`.

    It is the target that has all their presses on a target, or whose presses are all among them, after an interrupted
    import. Frames of the untouched probe and reference presses may serve several targets, so they count only where
    there are no others.
    """
    decisive = [frame for frame in frames if frame.role == "target"] or list(frames)
    candidates: list[tuple[int, Target]] = []
    for identity in dict.fromkeys(press.target for press in presses):
        own = [press for press in presses if press.target == identity]
        decided = sum(press is not None for press in match_presses(decisive, own))
        if decided == 0:
            continue
        target = _target(store, target_table.c.id == identity)
        stored = sum(press is not None for press in match_presses(frames, own))
        if target is not None and (decided == len(decisive) or stored == store.press_count(target)):
            candidates.append((stored, target))
    return max(candidates, key=lambda item: (item[0], -item[1].number))[1] if candidates else None


def _unused(candidates: deque[StoredPress] | None, used: set[str]) -> StoredPress | None:
    while candidates and candidates[0].id in used:
        candidates.popleft()
    return candidates[0] if candidates else None


def _presses_by_name(store: Store, names: Sequence[str]) -> list[StoredPress]:
    presses: list[StoredPress] = []
    with store.database.reading() as connection:
        for at in range(0, len(names), MOST_AT_ONCE):
            some = press_table.c.name.in_(names[at : at + MOST_AT_ONCE])
            presses += [press_of_row(row._asdict()) for row in connection.execute(press_query().where(some))]
    return presses


def _target(store: Store, which: object) -> Target | None:
    with store.database.reading() as connection:
        row = connection.execute(select(target_table).where(which)).first()  # type: ignore[arg-type]
    return None if row is None else target_of_row(row._asdict())


def new_target(
    store: Store,
    first: Iterable[TactileImage],
    *,
    number: int | None = None,
    name: str = "",
    truth: Mapping[str, float] | None = None,
) -> Target:
    """Add a target after its first frames are on the disk, so that a full disk leaves no target without a press."""
    for image in first:
        store.blobs.put(frame_bytes(image), "png")
    return store.add_target(number=number, name=name, truth=truth)


def enter_estimate(
    store: Store,
    target: Target,
    estimate: Estimate,
    *,
    kind: str,
    presses: Sequence[StoredPress],
    probe: str,
    calibration: ProbeCalibration,
    options: Mapping[str, Any],
) -> StoredEstimate:
    """Store a new estimate of all presses except those of the untouched probe."""
    return store.add_estimate(
        target,
        estimate,
        kind=kind,
        presses=estimate_presses(presses),
        probe=probe,
        calibration=calibration,
        options=options,
        environment=environment(),
    )


def enter_map(
    store: Store,
    target: Target,
    found: LumpMap,
    *,
    presses: Sequence[StoredPress],
    probe: str,
    calibration: ProbeCalibration,
    options: Mapping[str, Any],
) -> StoredMap:
    """Store a new map of these presses, with what it rests on."""
    return store.add_map(
        target,
        replace(found, provenance={**found.provenance, "images": press_inputs(presses)}),
        presses=presses,
        probe=probe,
        calibration=calibration,
        options=options,
        environment=environment(),
    )


def estimate_presses(presses: Iterable[StoredPress]) -> tuple[StoredPress, ...]:
    """The presses of an estimate."""
    return tuple(press for press in presses if press.role != "untouched")


def save_snapshot_to_store(
    store: Store, sidecar: Path, *, role: str, probe: str, calibration: UsableCalibration | None
) -> dict[str, Any]:
    """Store the snapshot of a sidecar; return store, target, press and notes for the result document.

    The raw frame lies beside the sidecar. ``role`` is one of `tsis.records.values.ROLES`; ``probe`` is used where the
    calibration names none.

    Raises
    ------
    TsisError
        When it cannot be stored.
    """
    active = None if calibration is None else calibration.calibration
    name = probe if active is None or not active.probe else active.probe
    batches = snapshots([sidecar], ImportOptions(role=role, probe=name, calibration=active), lambda: None)
    (imported,) = import_batches(store, batches)
    (press,) = imported.presses
    return {
        "store": str(store.folder.resolve()),
        "target": imported.target.number,
        "press": press.id,
        "notes": list(imported.batch.notes),
    }


EDITABLE = ("role", "force_n")  # others cannot be edited


def differing_notes(
    frames: Sequence[IncomingPress], presses: Sequence[StoredPress | None], number: int
) -> tuple[str, ...]:
    """A note, with a cure, for each property in which frames differ from their stored presses (None for new ones)."""
    pairs = ((frame, press) for frame, press in zip(frames, presses, strict=True) if press is not None)
    counts = Counter(name for item, press in pairs for name in _differences(item, press))
    edit, anew = f"tsis records edit {number} --press", "tsis records import --target new"
    return tuple(
        f"{name} of {count} that {'was' if count == 1 else 'were'} there already is stored otherwise and stays so "
        f"(to have it as it is here: {edit if name in EDITABLE else anew})"
        for name, count in counts.items()
    )


def truth_note(truth: Mapping[str, float], target: Target) -> tuple[str, ...]:
    """A note where the truth of the frames differs from that of the target."""
    if not truth or dict(truth) == dict(target.truth):
        return ()
    return (
        f"target {target.number} has another truth than these frames came with (tsis records edit {target.number} "
        "--truth, or import them with --target new)",
    )


def _differences(frame: IncomingPress, press: StoredPress) -> Iterator[str]:
    """Names of the given properties that differ."""
    calibration = None if frame.calibration is None else calibration_sha256(frame.calibration)
    properties: Iterable[tuple[str, object, object]] = (
        ("role", frame.role, press.role),
        ("force_n", frame.force_n, press.force_n),
        ("mm_per_pixel", frame.mm_per_pixel, press.mm_per_pixel),
        ("calibration", calibration, press.calibration),
    )
    for name, now, stored in properties:
        if now is not None and now != stored:
            yield name


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportedBatch:
    """Result of the import of a batch, which may have further notes.

    ``added`` and ``present`` are the numbers of new presses and of those that were stored before, ``estimates`` that of
    added estimates. ``presses`` are the stored ones in the order of the batch; empty for a bundle.
    """

    batch: ImportBatch
    target: Target
    new: bool
    added: int
    present: int
    estimates: int
    presses: tuple[StoredPress, ...] = ()


@dataclass(slots=True, kw_only=True)
class ImportProgress:
    """Progress of an import, also for the message when it fails.

    Attributes
    ----------
    total, done, stored
        Number of presses: of all batches, processed, and stored.
    separate
        Whether every batch gets a separate target.
    targets
        Numbers of the targets so far.
    """

    total: int = 0
    done: int = 0
    stored: int = 0
    separate: bool = False
    targets: list[int] = field(default_factory=list)

    @property
    def message(self) -> str:
        """The number of stored presses, and how to continue."""
        text = f"{self.stored} of {self.total} presses are stored and stay"
        if not self.separate or not self.targets:
            return f"{text} (the same import goes on from there)"
        return f"{text}, the last in target {self.targets[-1]} (go on with --target {self.targets[-1]} for its files)"


def require_importable(batches: Iterable[ImportBatch], kind: str, target: int | None = None) -> None:
    """Raise `InputError` for batches that do not fit the kind of the store, or a bundle with a target number."""
    for batch in batches:
        if batch.record is not None and target is not None:
            raise InputError("--target is not used with a bundle, whose target keeps its identity; leave it out")
        own = "phantom" if batch.simulated else kind
        own = own if batch.record is None else batch.record.target.kind
        if own != kind:
            raise InputError(f"{batch.kind} must go into a store of {own}s; this one is of {kind}s (--kind {own})")


def import_batches(
    store: Store,
    batches: Sequence[ImportBatch],
    *,
    target: int | None = None,
    difference: bool = False,
    tally: ImportProgress | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[ImportedBatch, ...]:
    """Store the new presses of each batch, then compute its estimate.

    A press is not new when its target has the same frame of the same name or time. A stored press does not change;
    differences become notes.

    Parameters
    ----------
    store
        The destination.
    batches
        The result of `find_import_batches`.
    target
        Number of the target for all batches, created where missing; by default the number in the files, else the target
        that has all presses of a batch, else a new one for each batch.
    difference
        Whether to create a new target for each batch in any case.
    tally
        Updated during the import.
    progress
        Called with (done, all) presses.

    Raises
    ------
    RecordsError
        When it fails; the message tells how many presses are stored.
    InputError
        When a batch does not fit this store; nothing is stored then.
    """
    tally = tally or ImportProgress()
    tally.separate = difference
    tally.total = sum(_size(batch) for batch in batches)
    require_importable(batches, store.kind, target)
    try:
        return tuple(
            _import_batch(store, batch, target or (None if difference else batch.number), tally, progress)
            for batch in batches
        )
    except TsisError as error:
        raise RecordsError(f"{error}; {tally.message}") from error


def _import_batch(
    store: Store,
    batch: ImportBatch,
    number: int | None,
    tally: ImportProgress,
    progress: Callable[[int, int], None] | None,
) -> ImportedBatch:
    if batch.record is not None:
        return _import_record(store, batch, batch.record, tally, progress)
    stored = () if tally.separate else stored_frames(store, batch.presses)
    target = None
    if not tally.separate:
        target = target_with(store, batch.presses, stored) if number is None else target_by_number(store, number)
    new = target is None
    if target is None:
        first = [press.image() for press in batch.presses[:1]]
        target = new_target(store, first, number=number, name=batch.name, truth=batch.truth)
    tally.targets.append(target.number)
    matches = match_presses(batch.presses, [press for press in stored if press.target == target.id])
    presses = []
    for frame, there in zip(batch.presses, matches, strict=True):
        if there is None:
            presses.append(_add_press(store, target, frame))
            tally.stored += 1
        else:
            presses.append(there)
        tally.done += 1
        if progress is not None:
            progress(tally.done, tally.total)
    present = sum(press is not None for press in matches)
    notes = (*truth_note(batch.truth, target), *differing_notes(batch.presses, matches, target.number))
    return ImportedBatch(
        batch=replace(batch, notes=(*batch.notes, *notes)),
        target=target,
        new=new,
        added=len(presses) - present,
        present=present,
        estimates=_add_estimate(store, target, batch, presses),
        presses=tuple(presses),
    )


def _size(batch: ImportBatch) -> int:
    return len(batch.presses) if batch.record is None else len(batch.record.presses)


def _import_record(
    store: Store,
    batch: ImportBatch,
    record: TargetRecord,
    tally: ImportProgress,
    progress: Callable[[int, int], None] | None,
) -> ImportedBatch:
    before = tally.done

    def count(done: int, _all: int) -> None:
        tally.done = before + done
        if progress is not None:
            progress(tally.done, tally.total)

    imported = store.import_target(record, progress=count)
    tally.stored += imported.presses
    notes = batch.notes
    if imported.differing:
        notes += (f"{imported.differing} of what was there already says something else here, and stays as it is here",)
    if imported.target.number != record.target.number:
        notes += (f"number {record.target.number} is that of another target here",)
    return ImportedBatch(
        batch=replace(batch, notes=notes),
        target=imported.target,
        new=imported.new,
        added=imported.presses,
        present=len(record.presses) - imported.presses,
        estimates=imported.estimates,
    )


def _add_press(store: Store, target: Target, press: IncomingPress) -> StoredPress:
    return store.add_press(
        target,
        press.image(),
        role=press.role,
        taken=press.taken,
        probe=press.probe,
        calibration=press.calibration,
        flags=press.flags,
    )


def _add_estimate(store: Store, target: Target, batch: ImportBatch, presses: Sequence[StoredPress]) -> int:
    """Compute and store the estimate of a batch unless one of the same presses exists; return the number stored."""
    requested = batch.estimate
    if requested is None:
        return 0
    from tsis.records.recomputation import EstimationRequest, estimate_stored  # slow to import, rarely needed

    record = store.record(target)
    used = estimate_presses(presses)
    identities = {press.id for press in used}
    if any(set(estimate.presses) == identities and estimate.kind == requested.kind for estimate in record.estimates):
        return 0
    request = EstimationRequest(
        kind=requested.kind,
        probe=requested.probe,
        presses=used,
        calibration=calibration_sha256(requested.calibration),
        options=requested.options,
    )
    enter_estimate(
        store,
        target,
        estimate_stored(record, request),
        kind=requested.kind,
        presses=presses,
        probe=requested.probe,
        calibration=requested.calibration,
        options=requested.options,
    )
    return 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavableResult:
    """An estimate with its frames and calibration, ready to be saved.

    ``kind``, ``probe`` and ``options`` are as in `StoredEstimate`, ``name`` and ``truth`` those of a new target.
    ``frames`` has the camera frames by the role of their presses, those of the target first.
    """

    kind: str
    estimate: Estimate
    probe: str
    calibration: ProbeCalibration
    frames: Mapping[str, Sequence[TactileImage]]
    options: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""
    truth: Mapping[str, float] = field(default_factory=dict)


def require_savable(frames: Sequence[TactileImage]) -> None:
    """Refuse, before any computation, frames that a store cannot save exactly."""
    for frame in frames:
        if len(frame.name) > LONGEST_NAME:
            raise InputError(
                f"the name of a file must have at most {LONGEST_NAME} characters, to be saved; {frame.name[:40]!r}... "
                f"has {len(frame.name)} (give it a shorter one, or leave out --save)"
            )
        try:
            whole_levels(frame.grey, frame.full_scale)
        except InputError as error:
            raise InputError(
                f"{frame.name!r} must hold the grey levels that the camera gave, to be saved; got levels between them, "
                "as of a colour picture (save it as a grey PNG file and use that everywhere, or leave out --save)"
            ) from error


def save_results(store: Store, result: SavableResult, *, number: int | None = None) -> dict[str, Any]:
    """Save presses, calibration and estimate; return store, target, estimate and notes for the result document.

    A store of subjects ignores the truth. ``number`` is that of the target, which is entered where it is missing; by
    default a new one.

    Raises
    ------
    RecordsError
        When not everything could be saved; the message tells how many presses were.
    """
    frames = [(role, frame) for role, item in result.frames.items() for frame in item]
    truth = result.truth if store.kind == "phantom" else {}
    presses: list[StoredPress] = []
    target: Target | None = None
    try:
        target = None if number is None else target_by_number(store, number)
        if target is None:
            images = [frame for _, frame in frames]
            target = new_target(store, images, number=number, name=result.name, truth=truth)
        moment = datetime.now(UTC)
        for at, (role, frame) in enumerate(frames):
            taken = moment + timedelta(microseconds=at)  # preserves their order
            presses.append(
                store.add_press(
                    target, frame, role=role, taken=taken, probe=result.probe, calibration=result.calibration
                )
            )
        stored = enter_estimate(
            store,
            target,
            result.estimate,
            kind=result.kind,
            presses=presses,
            probe=result.probe,
            calibration=result.calibration,
            options=result.options,
        )
    except TsisError as error:
        where = "" if target is None else f" in target {target.number}"
        raise RecordsError(f"{error}; {len(presses)} of {len(frames)} presses are stored{where}") from error
    return {
        "store": str(store.folder.resolve()),
        "target": target.number,
        "estimate": stored.id,
        "notes": list(truth_note(truth, target)),
    }


def save_map(
    store: Store,
    number: int | None,
    *,
    found: LumpMap,
    scan: ImportBatch | Sequence[StoredPress],
    probe: str,
    calibration: ProbeCalibration,
    options: Mapping[str, Any],
) -> dict[str, Any]:
    """Save a map and the presses of its scan; return store, target, map and notes for the result document.

    ``scan`` has the frames of a folder, or presses that the target of this ``number`` has already; parameters as in
    `StoredMap` and `save_results`.

    Raises
    ------
    RecordsError
        When not everything could be saved; the message tells how many presses were.
    """
    if isinstance(scan, ImportBatch):
        (entered,) = import_batches(store, [scan], target=number, difference=number is None)
        target, presses, notes = entered.target, entered.presses, entered.batch.notes
    else:
        target, presses, notes = store.target(number or 0), tuple(scan), ()
    try:
        stored = enter_map(store, target, found, presses=presses, probe=probe, calibration=calibration, options=options)
    except TsisError as error:
        raise RecordsError(f"{error}; {len(presses)} presses are stored in target {target.number}") from error
    return {
        "store": str(store.folder.resolve()),
        "target": target.number,
        "map": stored.id,
        "notes": list(notes),
    }


def saved_notes(saved: Mapping[str, Any]) -> tuple[str, ...]:
    """Messages for the user."""
    return (f"Saved as target {saved['target']} in {saved['store']}.", *saved["notes"])

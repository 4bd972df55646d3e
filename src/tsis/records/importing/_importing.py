"""Import of checked batches into a store, and notes on differences from stored presses."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from tsis.calibration.file import calibration_sha256
from tsis.errors import InputError, RecordsError, TsisError
from tsis.records.importing._matching import match_presses, stored_frames, target_by_number, target_with
from tsis.records.importing._results import enter_estimate, estimate_presses, new_target

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredPress, Target
    from tsis.records.importing._batch import ImportBatch, IncomingPress
    from tsis.records.store import Store


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


def _differences(item: IncomingPress, press: StoredPress) -> Iterator[str]:
    """Names of the given properties that differ."""
    calibration = None if item.calibration is None else calibration_sha256(item.calibration)
    properties: Iterable[tuple[str, object, object]] = (
        ("role", item.role, press.role),
        ("force_n", item.force_n, press.force_n),
        ("mm_per_pixel", item.mm_per_pixel, press.mm_per_pixel),
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
    for item, there in zip(batch.presses, matches, strict=True):
        if there is None:
            presses.append(_add_press(store, target, item))
            tally.stored += 1
        else:
            presses.append(there)
        tally.done += 1
        if progress is not None:
            progress(tally.done, tally.total)
    present = sum(1 for item in matches if item is not None)
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

    taken = store.import_target(record, progress=count)
    tally.stored += taken.presses
    notes = batch.notes
    if taken.differing:
        notes += (f"{taken.differing} of what was there already says something else here, and stays as it is here",)
    if taken.target.number != record.target.number:
        notes += (f"number {record.target.number} is that of another target here",)
    return ImportedBatch(
        batch=replace(batch, notes=notes),
        target=taken.target,
        new=taken.new,
        added=taken.presses,
        present=len(record.presses) - taken.presses,
        estimates=taken.estimates,
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
    from tsis.records._estimation import EstimationRequest, estimate_stored  # slow to import, rarely needed

    record = store.record(target)
    rests_on = estimate_presses(presses)
    identities = {press.id for press in rests_on}
    if any(set(estimate.presses) == identities and estimate.kind == requested.kind for estimate in record.estimates):
        return 0
    request = EstimationRequest(
        kind=requested.kind,
        probe=requested.probe,
        presses=rests_on,
        calibration=calibration_sha256(requested.calibration),
        options=requested.options,
    )
    response = estimate_stored(record, request)
    enter_estimate(
        store,
        target,
        response.estimate,
        kind=requested.kind,
        presses=presses,
        probe=requested.probe,
        calibration=requested.calibration,
        options=response.options,
    )
    return 1

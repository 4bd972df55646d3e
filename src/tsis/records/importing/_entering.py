"""What a frame that is there already is said to be now, and is not in the store."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from tsis.calibration.file import calibration_sha256
from tsis.errors import InputError, RecordsError, TsisError
from tsis.records.importing._present import matched, numbered, stored_frames, target_with
from tsis.records.importing._results import enter_estimate, new_target, used

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredPress, Target
    from tsis.records.importing._found import ImportBatch, IncomingPress
    from tsis.records.store import Store


EDITABLE = ("role", "force_n")  # of these; the others are as they came


def differing_notes(
    frames: Sequence[IncomingPress], presses: Sequence[StoredPress | None], number: int
) -> tuple[str, ...]:
    """One sentence for each thing that is said of frames otherwise than it is stored, with what to do about it.

    Parameters
    ----------
    frames
        What was to be entered.
    presses
        The press of each that was there already; None for others.
    number
        Of the target.
    """
    pairs = ((frame, press) for frame, press in zip(frames, presses, strict=True) if press is not None)
    counts = Counter(name for item, press in pairs for name in _differences(item, press))
    edit, anew = f"tsis records edit {number} --press", "tsis records import --target new"
    return tuple(
        f"{name} of {count} that {'was' if count == 1 else 'were'} there already is stored otherwise and stays so "
        f"(to have it as it is here: {edit if name in EDITABLE else anew})"
        for name, count in counts.items()
    )


def truth_note(truth: Mapping[str, float], target: Target) -> tuple[str, ...]:
    """One sentence where frames come with another truth than their target has."""
    if not truth or dict(truth) == dict(target.truth):
        return ()
    return (
        f"target {target.number} has another truth than these frames came with (tsis records edit {target.number} "
        "--truth, or import them with --target new)",
    )


def _differences(item: IncomingPress, press: StoredPress) -> Iterator[str]:
    """Names of what was said and is not so; what nobody said is no difference."""
    given = None if item.calibration is None else calibration_sha256(item.calibration)
    message: Iterable[tuple[str, object, object]] = (
        ("role", item.role, press.role),
        ("force_n", item.force_n, press.force_n),
        ("mm_per_pixel", item.mm_per_pixel, press.mm_per_pixel),
        ("calibration", given, press.calibration),
    )
    for name, now, stored in message:
        if now is not None and now != stored:
            yield name


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Entered:
    """What became of a batch.

    Attributes
    ----------
    batch
        Itself.
    target
        Where its presses are now.
    new
        Whether that target was entered for it.
    added, present
        Presses that were stored, and that were there already.
    estimates
        How many estimates were added.
    presses
        Those of the batch as they are stored, in its order; none of a bundle.
    """

    batch: ImportBatch
    target: Target
    new: bool
    added: int
    present: int
    estimates: int
    presses: tuple[StoredPress, ...] = ()


@dataclass(slots=True, kw_only=True)
class Entering:
    """How far an import has come, for whoever is told when it ends early.

    Attributes
    ----------
    total, done, stored
        Presses: of all batches, looked at so far, and stored of them.
    separate
        Whether every batch gets a target of its own.
    targets
        Numbers of those that were begun.
    """

    total: int = 0
    done: int = 0
    stored: int = 0
    separate: bool = False
    targets: list[int] = field(default_factory=list)

    @property
    def message(self) -> str:
        """What is stored by now."""
        reported = f"{self.stored} of {self.total} presses are stored and stay"
        if not self.separate or not self.targets:
            return f"{reported} (the same import goes on from there)"
        return (
            f"{reported}, the last in target {self.targets[-1]} (go on with --target {self.targets[-1]} for its files)"
        )


def require_enterable(batches: Iterable[ImportBatch], kind: str, target: int | None = None) -> None:
    """Refuse, with `InputError`, batches that do not belong into a store of that kind, or under that number."""
    for batch in batches:
        if batch.record is not None and target is not None:
            raise InputError("--target is not used with a bundle, whose target keeps its identity; leave it out")
        own = "phantom" if batch.simulated else kind
        own = own if batch.record is None else batch.record.target.kind
        if own != kind:
            raise InputError(f"{batch.kind} must go into a store of {own}s; this one is of {kind}s (--kind {own})")


def enter(
    store: Store,
    batches: Sequence[ImportBatch],
    *,
    target: int | None = None,
    difference: bool = False,
    tally: Entering | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Entered, ...]:
    """Store every press that is not there yet, then estimate what is to be estimated.

    A press is there already when its target holds the same frame under the same name, or as taken at the same time.
    What is there stays as it is, and what is said of it otherwise now becomes a note.

    Parameters
    ----------
    store
        Where to.
    batches
        What was looked through.
    target
        Number of the target for all of them, entered where there is none; by default the one that the files name, else
        the one that holds all presses on the target of a batch already, else a new one for each.
    difference
        Whether to enter a new target for each, whatever number its files name and wherever its frames are.
    tally
        Kept up to date while it goes.
    progress
        Told (done, all) presses.

    Raises
    ------
    RecordsError
        When it could not go on; it says how much was stored.
    InputError
        When a batch does not belong into this store; nothing was stored then.
    """
    tally = tally or Entering()
    tally.separate = difference
    tally.total = sum(_size(batch) for batch in batches)
    require_enterable(batches, store.kind, target)
    try:
        return tuple(
            _entered(store, batch, target or (None if difference else batch.number), tally, progress)
            for batch in batches
        )
    except TsisError as error:
        raise RecordsError(f"{error}; {tally.message}") from error


def _entered(
    store: Store,
    batch: ImportBatch,
    number: int | None,
    tally: Entering,
    progress: Callable[[int, int], None] | None,
) -> Entered:
    if batch.record is not None:
        return _taken_in(store, batch, batch.record, tally, progress)
    stored = () if tally.separate else stored_frames(store, batch.presses)
    target = _target(store, batch, number, stored, difference=tally.separate)
    new = target is None
    if target is None:
        first = [press.image() for press in batch.presses[:1]]
        target = new_target(store, first, number=number, name=batch.name, truth=batch.truth)
    tally.targets.append(target.number)
    held = matched(batch.presses, [press for press in stored if press.target == target.id])
    presses = []
    for item, there in zip(batch.presses, held, strict=True):
        if there is None:
            presses.append(_stored(store, target, item))
            tally.stored += 1
        else:
            presses.append(there)
        tally.done += 1
        if progress is not None:
            progress(tally.done, tally.total)
    present = sum(1 for item in held if item is not None)
    notes = (*truth_note(batch.truth, target), *differing_notes(batch.presses, held, target.number))
    return Entered(
        batch=replace(batch, notes=(*batch.notes, *notes)),
        target=target,
        new=new,
        added=len(presses) - present,
        present=present,
        estimates=_estimated(store, target, batch, presses),
        presses=tuple(presses),
    )


def _target(
    store: Store, batch: ImportBatch, number: int | None, stored: Sequence[StoredPress], *, difference: bool
) -> Target | None:
    """Where a batch goes; None for a target that is yet to be entered."""
    if difference:
        return None
    return target_with(store, batch.presses, stored) if number is None else numbered(store, number)


def _size(batch: ImportBatch) -> int:
    return len(batch.presses) if batch.record is None else len(batch.record.presses)


def _taken_in(
    store: Store,
    batch: ImportBatch,
    record: TargetRecord,
    tally: Entering,
    progress: Callable[[int, int], None] | None,
) -> Entered:
    before = tally.done

    def count(done: int, _all: int) -> None:
        tally.done = before + done
        if progress is not None:
            progress(tally.done, tally.total)

    taken = store.take_in(record, progress=count)
    tally.stored += taken.presses
    notes = batch.notes
    if taken.differing:
        notes += (f"{taken.differing} of what was there already says something else here, and stays as it is here",)
    if taken.target.number != record.target.number:
        notes += (f"number {record.target.number} is that of another target here",)
    return Entered(
        batch=replace(batch, notes=notes),
        target=taken.target,
        new=taken.new,
        added=taken.presses,
        present=len(record.presses) - taken.presses,
        estimates=taken.estimates,
    )


def _stored(store: Store, target: Target, press: IncomingPress) -> StoredPress:
    return store.add_press(
        target,
        press.image(),
        role=press.role,
        taken=press.taken,
        probe=press.probe,
        calibration=press.calibration,
        flags=press.flags,
    )


def _estimated(store: Store, target: Target, batch: ImportBatch, presses: Sequence[StoredPress]) -> int:
    """Store the estimate of a batch, unless there is none or one of the same presses is there; how many were stored."""
    requested = batch.estimate
    if requested is None:
        return 0
    from tsis.records._estimation import EstimationRequest, estimate_stored  # heavy, and most imports estimate nothing

    record = store.record(target)
    rests_on = used(presses)
    identities = {press.id for press in rests_on}
    if any(set(estimate.presses) == identities and estimate.kind == requested.kind for estimate in record.estimates):
        return 0
    response = estimate_stored(
        record,
        EstimationRequest(
            kind=requested.kind,
            probe=requested.probe,
            presses=rests_on,
            calibration=calibration_sha256(requested.calibration),
            options=requested.options,
        ),
    )
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

"""Frames that were looked through get into a store: once each, press by press, and again from where it ended."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from tsis.calibration.file import identity
from tsis.model.errors import InputError, RecordsError, TsisError
from tsis.records.environment import environment

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.records.dossier import Dossier
    from tsis.records.importing.found import Batch, Incoming
    from tsis.records.store import Store
    from tsis.records.values import Press, Target


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
    """

    batch: Batch
    target: Target
    new: bool
    added: int
    present: int
    estimates: int


@dataclass(slots=True, kw_only=True)
class Entering:
    """How far an import has come, for whoever is told when it ends early."""

    total: int = 0
    done: int = 0
    stored: int = 0

    @property
    def sentence(self) -> str:
        """What is stored by now."""
        return f"{self.stored} of {self.total} presses are stored and stay (the same import goes on from there)"


def enter(
    store: Store,
    batches: Sequence[Batch],
    *,
    target: int | None = None,
    apart: bool = False,
    tally: Entering | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Entered, ...]:
    """Store every press that is not there yet, then estimate what is to be estimated.

    A press is there already when the same frame is stored under the same name, or as taken at the same time.

    Parameters
    ----------
    store
        Where to.
    batches
        What was looked through.
    target
        Number of the target for all of them, entered where there is none; by default the one that the files name, else
        a new one for each.
    apart
        Whether to enter a new target for each, whatever number its files name.
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
    tally.total = sum(_size(batch) for batch in batches)
    for batch in batches:
        if batch.dossier is not None and target is not None:
            raise InputError("--target is not used with a bundle, whose target keeps its identity; leave it out")
        if batch.truth and store.kind == "subject":
            raise InputError(f"{batch.kind} must go into a store of phantoms; this one is of subjects (--kind phantom)")
    try:
        return tuple(
            _entered(store, batch, target or (None if apart else batch.number), tally, progress) for batch in batches
        )
    except TsisError as error:
        raise RecordsError(f"{error}; {tally.sentence}") from error


def _entered(
    store: Store,
    batch: Batch,
    number: int | None,
    tally: Entering,
    progress: Callable[[int, int], None] | None,
) -> Entered:
    if batch.dossier is not None:
        return _taken_in(store, batch, batch.dossier, tally, progress)
    held = _held(store, batch, number)
    target, new = _target(store, batch, number, held)
    presses = []
    for each, there in zip(batch.presses, held, strict=True):
        press = there
        if press is None or press.target != target.id:
            press = _stored(store, target, each)
            tally.stored += 1
        presses.append(press)
        tally.done += 1
        if progress is not None:
            progress(tally.done, tally.total)
    present = sum(1 for one, other in zip(presses, held, strict=True) if one is other)
    return Entered(
        batch=batch,
        target=target,
        new=new,
        added=len(presses) - present,
        present=present,
        estimates=_estimated(store, target, batch, presses),
    )


def _size(batch: Batch) -> int:
    return len(batch.presses) if batch.dossier is None else len(batch.dossier.presses)


def _taken_in(
    store: Store,
    batch: Batch,
    dossier: Dossier,
    tally: Entering,
    progress: Callable[[int, int], None] | None,
) -> Entered:
    before = tally.done

    def count(done: int, _all: int) -> None:
        tally.done = before + done
        if progress is not None:
            progress(tally.done, tally.total)

    taken = store.take_in(dossier, progress=count)
    tally.stored += taken.presses
    notes = batch.notes
    if taken.differing:
        notes += (f"{taken.differing} of what was there already says something else here, and stays as it is here",)
    if taken.target.number != dossier.target.number:
        notes += (f"number {dossier.target.number} is that of another target here",)
    return Entered(
        batch=replace(batch, notes=notes),
        target=taken.target,
        new=taken.new,
        added=taken.presses,
        present=len(dossier.presses) - taken.presses,
        estimates=taken.estimates,
    )


def _held(store: Store, batch: Batch, number: int | None) -> list[Press | None]:
    """The stored press of each frame, of that target or of any; None where there is none."""
    found: dict[str, list[Press]] = {}
    own = None
    if number is not None:
        own = {each.target.number: each.target.id for each in store.targets()}.get(number, "")
    for press in store.presses_of_frames([each.frame for each in batch.presses]):
        if own is None or press.target == own:
            found.setdefault(press.frame, []).append(press)
    matched: list[Press | None] = []
    for each in batch.presses:
        candidates = found.get(each.frame, [])
        same = next((one for one in candidates if one.taken == each.taken or one.name == each.name), None)
        if same is not None:
            candidates.remove(same)  # two equal frames need two presses
        matched.append(same)
    return matched


def _target(store: Store, batch: Batch, number: int | None, held: Sequence[Press | None]) -> tuple[Target, bool]:
    numbers = {each.target.id: each.target for each in store.targets()}
    if number is not None:
        for target in numbers.values():
            if target.number == number:
                return target, False
        return store.add_target(number=number, name=batch.name, truth=batch.truth), True
    where = Counter(press.target for press in held if press is not None).most_common(1)
    if where:
        return numbers[where[0][0]], False
    return store.add_target(name=batch.name, truth=batch.truth), True


def _stored(store: Store, target: Target, each: Incoming) -> Press:
    return store.add_press(
        target,
        each.image(),
        role=each.role,
        taken=each.taken,
        probe=each.probe,
        calibration=each.calibration,
        flags=each.flags,
    )


def _estimated(store: Store, target: Target, batch: Batch, presses: Sequence[Press]) -> int:
    """Store the estimate of a batch, unless there is none or one of the same presses is there; how many were stored."""
    wanted = batch.estimate
    if wanted is None:
        return 0
    from tsis.records.estimation import Request, estimate_stored  # heavy, and most imports estimate nothing

    used = [press for press in presses if press.role != "untouched"]
    dossier = store.dossier(target)
    rests_on = {press.id for press in used}
    if any(set(each.presses) == rests_on and each.kind == wanted.kind for each in dossier.estimates):
        return 0
    answer = estimate_stored(
        dossier,
        Request(
            kind=wanted.kind,
            probe=wanted.probe,
            presses=tuple(used),
            calibration=identity(wanted.calibration),
            options=wanted.options,
        ),
    )
    store.add_estimate(
        target,
        answer.estimate,
        kind=wanted.kind,
        presses=used,
        probe=wanted.probe,
        calibration=wanted.calibration,
        options=answer.options,
        environment=environment(),
    )
    return 1

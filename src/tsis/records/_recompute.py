"""Stored estimates made again from the stored frames with the code of today, and what is different."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import CalibrationError, RecordsError
from tsis.model import INTERVAL_LEVEL
from tsis.records._estimate_json import estimate_to_json
from tsis.records._estimation import EstimationRequest, estimate_stored
from tsis.records._provenance import changes, comparison_message, environment

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from tsis.calibration.file import ProbeCalibration
    from tsis.model import Estimate
    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredEstimate, Target
    from tsis.records.store import Store


COMPARED = ("prior_sd", "cramer_rao_sd", "presence", "identifiability", "prior", "trusted", "flags", "notes")


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """How far one parameter moved, in units of its old standard deviation.

    Attributes
    ----------
    name
        Of the parameter.
    before, after
        Posterior means, in the unit that the name carries.
    interval_before, interval_after
        Of 90 %.
    shifted, low_shift, high_shift
        By how many old standard deviations the mean and the ends of the interval moved; positive is upwards.
    """

    name: str
    before: float
    after: float
    interval_before: tuple[float, float]
    interval_after: tuple[float, float]
    shifted: float
    low_shift: float
    high_shift: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recomputation:
    """An estimate made again.

    Attributes
    ----------
    before
        As it is stored.
    after
        As it was made again: with an identity where it was stored.
    same
        Whether every sample and every word of the result is as it was, bit for bit.
    shifts
        Of the parameters that both have.
    causes
        What else is not the same: code, libraries, frames, forces, options, calibration.
    notes
        What was done otherwise than then, and what to know of the calibration.
    stored
        Whether it was stored.
    """

    before: StoredEstimate
    after: StoredEstimate
    same: bool
    shifts: tuple[Shift, ...]
    causes: tuple[str, ...]
    notes: tuple[str, ...]
    stored: bool

    @property
    def flags_gained(self) -> tuple[str, ...]:
        """Flags that only the new one has."""
        return tuple(flag for flag in self.after.estimate.flags if flag not in self.before.estimate.flags)

    @property
    def flags_lost(self) -> tuple[str, ...]:
        """Flags that only the old one has."""
        return tuple(flag for flag in self.before.estimate.flags if flag not in self.after.estimate.flags)

    @property
    def message(self) -> str:
        """What became of the result, and why."""
        return comparison_message(self.same, self.causes)


def recompute(
    store: Store, target: Target, *, dry_run: bool = False, progress: Callable[[int, int], None] | None = None
) -> tuple[Recomputation, ...]:
    """Make the estimates in force of a target again, the last of each kind, and store those that came out otherwise.

    Parameters
    ----------
    store
        Where it is stored.
    target
        Whose they are.
    dry_run
        Whether to store nothing.
    progress
        Called with (done, all) while the mechanics of a new probe are solved.

    Raises
    ------
    RecordsError
        When the target has no estimate, or a frame or the calibration is damaged.
    InputError, CalibrationError
        When today's code does not take what was stored.
    """
    record = store.record(target)
    record.require_whole()
    in_force = list({stored.kind: stored for stored in record.estimates}.values())
    if not in_force:
        raise RecordsError(f"target {target.number} must have an estimate to be made again; it has none")
    last = {stored.kind: at for at, stored in enumerate(record.estimates)}
    in_force.sort(key=lambda stored: last[stored.kind])  # so that the one in force stays so
    return tuple(_recomputed(store, record, stored, dry_run=dry_run, progress=progress) for stored in in_force)


def _recomputed(
    store: Store,
    record: TargetRecord,
    before: StoredEstimate,
    *,
    dry_run: bool,
    progress: Callable[[int, int], None] | None,
) -> Recomputation:
    by_identity = {press.id: press for press in record.presses}
    if missing := [identity for identity in before.presses if identity not in by_identity]:
        raise RecordsError(f"an estimate must rest on stored presses; {missing[0]!r:.40} is none (tsis records verify)")
    presses = tuple(by_identity[identity] for identity in before.presses)
    response = estimate_stored(
        record,
        EstimationRequest(
            kind=before.kind,
            probe=before.probe,
            presses=presses,
            calibration=before.calibration,
            options=before.options,
        ),
        progress=progress,
    )
    given = record.calibrations[before.calibration]
    after = replace(
        before,
        estimate=response.estimate,
        made=datetime.now(UTC),
        options=response.options,
        environment=environment(),
        supersedes=before.id,
        id="",
    )
    same = _same(before, after)
    save = not same and not dry_run
    if save:
        after = store.add_estimate(
            record.target,
            response.estimate,
            kind=before.kind,
            presses=presses,
            probe=before.probe,
            calibration=given,
            options=response.options,
            environment=after.environment,
            supersedes=before,
        )
    return Recomputation(
        before=before,
        after=after,
        same=same,
        shifts=_shifts(before.estimate, after.estimate),
        causes=changes(before, after),
        notes=(*response.notes, *_of_the_calibration(given, before.made)),
        stored=save,
    )


def _same(before: StoredEstimate, after: StoredEstimate) -> bool:
    """Whether what was found is the same: samples bit for bit, and all that is said of them."""
    item, other = before.estimate, after.estimate
    if list(item.samples) != list(other.samples):
        return False
    entries: list[dict[str, Any]] = [estimate_to_json(item)["estimate"] for item in (before, after)]
    return all(np.array_equal(item.samples[name], other.samples[name]) for name in item.samples) and all(
        entries[0][name] == entries[1][name] for name in COMPARED
    )


def _shifts(before: Estimate, after: Estimate) -> tuple[Shift, ...]:
    sd = before.sd
    was, now = before.interval(INTERVAL_LEVEL), after.interval(INTERVAL_LEVEL)
    means = before.mean, after.mean
    return tuple(
        Shift(
            name=name,
            before=means[0][name],
            after=means[1][name],
            interval_before=was[name],
            interval_after=now[name],
            shifted=_in_sd(means[1][name] - means[0][name], sd[name]),
            low_shift=_in_sd(now[name][0] - was[name][0], sd[name]),
            high_shift=_in_sd(now[name][1] - was[name][1], sd[name]),
        )
        for name in before.samples
        if name in after.samples
    )


def _in_sd(transformed: float, sd: float) -> float:
    """A change over a standard deviation; of a posterior without any width 0 or infinite."""
    return transformed / sd if sd > 0 else float(np.copysign(np.inf, transformed)) if transformed else 0.0


def _of_the_calibration(calibration: ProbeCalibration, created: datetime) -> list[str]:
    try:
        calibration.require_usable(created)
    except CalibrationError as error:
        return [f"when the estimate was made the calibration was not to be used: {error}"]
    try:
        calibration.require_usable(datetime.now(UTC))
    except CalibrationError:
        until = "" if calibration.expires is None else f" (on {calibration.expires:%Y-%m-%d})"
        return [
            f"the calibration {calibration.name!r} has expired since{until}; it was good when the estimate was made"
        ]
    return []

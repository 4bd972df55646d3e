"""Estimates and maps from stored frames, and their repetition."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

import tsis.hardness
import tsis.inclusion
from tsis.calibration.frames import UsableCalibration, apply_calibration
from tsis.catalog.probes import load_probe
from tsis.errors import CalibrationError, InputError, RecordsError
from tsis.hardness.posterior import HardnessPrior
from tsis.inclusion import InclusionPrior
from tsis.mapping.estimation import estimate_map
from tsis.mapping.prior import MapPrior
from tsis.mapping.scan_folder import calibrated
from tsis.model.content import ContentValue
from tsis.model.estimate import INTERVAL_LEVEL
from tsis.model.require import freeze_mappings
from tsis.records.places import press_inputs, recorded_scan
from tsis.records.provenance import changes, comparison_message, environment
from tsis.records.values import ESTIMATES, MAP, REFERENCE_ROLES, StoredMap, estimate_to_json, map_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from tsis.calibration.file import ProbeCalibration
    from tsis.mapping.lump_map import LumpMap
    from tsis.model.estimate import Estimate
    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, StoredPress, Target, TargetRecord


PRIORS: Mapping[str, type[InclusionPrior | HardnessPrior | MapPrior]] = {
    "inclusion": InclusionPrior,
    "hardness": HardnessPrior,
    MAP: MapPrior,
}
OPTIONS = {  # beside the prior
    "inclusion": ("strain",),
    "hardness": ("radius_mm", "radius_sd_mm", "reference_radius_mm", "blur_mm", "drift_sd"),
    MAP: ("strain", "voxel_mm", "seed", "steps", "left_out"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimationRequest(ContentValue):
    """An estimate to compute from presses of a target record.

    Parameters
    ----------
    kind
        ``"inclusion"``, ``"hardness"`` or ``"map"``.
    probe
        Name of the probe in the catalog.
    presses
        Its presses in order; the role of each tells its use.
    calibration
        SHA-256 of a calibration of the record.
    options
        Arguments of the call by name as JSON values, the prior as its fields.
    """

    kind: str
    probe: str
    presses: tuple[StoredPress, ...]
    calibration: str
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        freeze_mappings(self, "options")


def estimate_stored(
    record: TargetRecord, request: EstimationRequest, *, progress: Callable[[int, int], None] | None = None
) -> Estimate:
    """Estimate from stored frames with a stored calibration.

    ``progress`` is called with (done, all) while the mechanics of a new probe are solved; the solution is cached.

    Raises
    ------
    RecordsError
        When the record lacks the calibration, or no press is on the target.
    InputError, CalibrationError, NotCalibratedError
        As the estimators.
    """
    calibration = _calibration(record, request)
    images = [record.image(press) for press in request.presses if press.role == "target"]
    others = [record.image(press) for press in request.presses if press.role == REFERENCE_ROLES[request.kind]]
    if not images:
        raise RecordsError("an estimate must rest on at least one press on the target; of these presses none is one")
    probe, arguments = load_probe(request.probe), _arguments(request.kind, request.options)
    of_inclusion = request.kind == ESTIMATES[0]
    use: dict[str, Any] = {"identity": request.calibration, "on_tissue": of_inclusion}
    ready, response = apply_calibration(calibration, images, **use)
    reference, other = apply_calibration(calibration, others, **use)
    arguments |= {"probe": probe, "reference": reference, "progress": progress}
    if of_inclusion:
        response = max(response, other, key=lambda item: item.force_sd)
        return tsis.inclusion.estimate(ready, calibration=response, **arguments)
    return tsis.hardness.estimate(ready, calibration=response, **arguments)


def map_stored(
    record: TargetRecord, request: EstimationRequest, *, progress: Callable[[int, int], None] | None = None
) -> LumpMap:
    """Map the scan of stored presses with a stored calibration; ``progress`` is called with (done, all).

    Raises
    ------
    RecordsError
        When the record lacks the calibration, or a press has no place.
    InputError, CalibrationError, NotCalibratedError
        As `tsis.mapping.estimate_map`.
    """
    usable = UsableCalibration(calibration=_calibration(record, request), identity=request.calibration)
    arguments = _arguments(MAP, request.options)
    scan = recorded_scan(replace(record, presses=request.presses)).scan
    pressed, response = calibrated(replace(scan, left_out=arguments.pop("left_out", ())), usable)
    return estimate_map(pressed, probe=load_probe(request.probe), calibration=response, progress=progress, **arguments)


def _calibration(record: TargetRecord, request: EstimationRequest) -> ProbeCalibration:
    calibration = record.calibrations.get(request.calibration)
    if calibration is None:
        raise RecordsError(f"the calibration {request.calibration[:12]!r} must be stored to estimate with; it is not")
    return calibration


def require_options(kind: str, options: Mapping[str, Any]) -> None:
    """Raise `InputError` for options that this kind of estimate refuses."""
    _arguments(kind, options)


def _arguments(kind: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Stored options as arguments of the estimator."""
    _require_known(f"options of an estimate of {kind}", options, ("prior", *OPTIONS[kind]))
    arguments = {name: value for name, value in options.items() if value is not None}
    if "prior" in arguments:
        prior = arguments["prior"]
        _require_known("prior", prior, [field.name for field in fields(PRIORS[kind])])
        values: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in prior.items()
        }
        arguments["prior"] = PRIORS[kind](**values)
    return arguments


def _require_known(what: str, names: Iterable[str], known: Sequence[str]) -> None:
    for name in names:
        if name not in known:
            raise InputError(f"{what} must have no names but {', '.join(known)}; got {name!r:.60}")


COMPARED = ("prior_sd", "cramer_rao_sd", "presence", "identifiability", "prior", "trusted", "flags", "notes")


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """Change of a parameter: posterior means and 90 % intervals in the unit of its name, and their shifts.

    ``moved``, ``low_shift`` and ``high_shift`` are shifts of the mean and of the ends of the interval in old standard
    deviations; positive is upwards. Means and ``moved`` are None where one of the estimates does not identify the
    parameter.
    """

    name: str
    before: float | None
    after: float | None
    interval_before: tuple[float, float]
    interval_after: tuple[float, float]
    moved: float | None
    low_shift: float
    high_shift: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recomputation:
    """A recomputed estimate or map.

    Attributes
    ----------
    before
        The stored result.
    after
        The new one, with an identity where it was stored.
    same
        Whether all samples and texts are equal bit for bit.
    shifts
        Shifts of the parameters of both, of a map those of each lump; none where one of the two is not trusted.
    causes
        Other differences: code, libraries, frames, forces, options, calibration.
    notes
        Notes on the validity of the calibration.
    stored
        Whether the new result was stored.
    """

    before: StoredEstimate | StoredMap
    after: StoredEstimate | StoredMap
    same: bool
    shifts: tuple[Shift, ...]
    causes: tuple[str, ...]
    notes: tuple[str, ...]
    stored: bool

    @property
    def flags_gained(self) -> tuple[str, ...]:
        """Flags of the new estimate alone."""
        return tuple(flag for flag in self.after.estimate.flags if flag not in self.before.estimate.flags)

    @property
    def flags_lost(self) -> tuple[str, ...]:
        """Flags of the old estimate alone."""
        return tuple(flag for flag in self.before.estimate.flags if flag not in self.after.estimate.flags)

    @property
    def message(self) -> str:
        """Whether the result changed, and why."""
        return comparison_message(self.same, self.causes)


def recompute(
    store: Store, target: Target, *, dry_run: bool = False, progress: Callable[[int, int], None] | None = None
) -> tuple[Recomputation, ...]:
    """Recompute the active estimates of a target, the last of each kind, and its active map; store what changed.

    ``dry_run`` stores nothing; ``progress`` is called with (done, all) while the mechanics of a new probe are solved.

    Raises
    ------
    RecordsError
        When the target has neither estimate nor map, or a frame or the calibration is damaged.
    InputError, CalibrationError
        When the present code refuses the stored input.
    """
    record = store.record(target)
    record.require_whole()
    if not record.active_results:
        raise RecordsError(f"target {target.number} must have an estimate or a map to be made again; it has none")
    # In the order of time, so that the newest estimate stays the newest.
    active = sorted(record.active_results, key=record.results.index)
    return tuple(_recomputed(store, record, stored, dry_run=dry_run, progress=progress) for stored in active)


def _recomputed(
    store: Store,
    record: TargetRecord,
    before: StoredEstimate | StoredMap,
    *,
    dry_run: bool,
    progress: Callable[[int, int], None] | None,
) -> Recomputation:
    by_identity = {press.id: press for press in record.presses}
    if missing := [identity for identity in before.presses if identity not in by_identity]:
        raise RecordsError(f"an estimate must rest on stored presses; {missing[0]!r:.40} is none (tsis records verify)")
    presses = tuple(by_identity[identity] for identity in before.presses)
    request = EstimationRequest(
        kind=before.kind,
        probe=before.probe,
        presses=presses,
        calibration=before.calibration,
        options=before.options,
    )
    if isinstance(before, StoredMap):
        return _map_again(store, record, before, request, dry_run=dry_run, progress=progress)
    estimate = estimate_stored(record, request, progress=progress)
    calibration = record.calibrations[before.calibration]
    after = replace(before, estimate=estimate, **_of_now(before))
    same = _same(before, after)
    save = not same and not dry_run
    if save:
        after = store.add_estimate(
            record.target,
            estimate,
            kind=before.kind,
            presses=presses,
            probe=before.probe,
            calibration=calibration,
            options=before.options,
            environment=after.environment,
            supersedes=before,
        )
    return Recomputation(
        before=before,
        after=after,
        same=same,
        shifts=_shifts(before.estimate, after.estimate),
        causes=changes(before, after),
        notes=_calibration_notes(calibration, before.made),
        stored=save,
    )


def _of_now(before: StoredEstimate | StoredMap) -> dict[str, Any]:
    return {"made": datetime.now(UTC), "environment": environment(), "supersedes": before.id, "id": ""}


def _map_again(
    store: Store,
    record: TargetRecord,
    before: StoredMap,
    request: EstimationRequest,
    *,
    dry_run: bool,
    progress: Callable[[int, int], None] | None,
) -> Recomputation:
    found = map_stored(record, request, progress=progress)
    inputs = {**found.provenance, "images": press_inputs(request.presses)}
    after = replace(before, estimate=replace(found, provenance=inputs), **_of_now(before))
    was, now = (map_bytes(replace(stored.estimate, provenance={})) for stored in (before, after))
    save, calibration = was != now and not dry_run, record.calibrations[before.calibration]
    if save:
        after = store.add_map(
            record.target,
            after.estimate,
            presses=request.presses,
            probe=before.probe,
            calibration=calibration,
            options=before.options,
            environment=after.environment,
            supersedes=before,
        )
    return Recomputation(
        before=before,
        after=after,
        same=was == now,
        shifts=_lump_shifts(before.estimate, after.estimate),
        causes=changes(before, after),
        notes=_calibration_notes(calibration, before.made),
        stored=save,
    )


def _lump_shifts(before: LumpMap, after: LumpMap) -> tuple[Shift, ...]:
    """The shifts of the lumps of one name."""
    if not (before.trusted and after.trusted):
        return ()
    lumps = {lump.name: lump for lump in after.lumps}
    return tuple(
        replace(shift, name=f"{lump.name}, {shift.name}")
        for lump in before.lumps
        if lump.name in lumps
        for shift in _shifts(lump.estimate, lumps[lump.name].estimate)
    )


def _same(before: StoredEstimate, after: StoredEstimate) -> bool:
    """Whether samples and texts are equal, bit for bit."""
    samples, new_samples = before.estimate.untrusted.samples, after.estimate.untrusted.samples
    if list(samples) != list(new_samples):
        return False
    was, now = (estimate_to_json(stored)["estimate"] for stored in (before, after))
    equal = all(np.array_equal(samples[name], new_samples[name]) for name in samples)
    return equal and all(was[name] == now[name] for name in COMPARED)


def _shifts(before: Estimate, after: Estimate) -> tuple[Shift, ...]:
    if not (before.trusted and after.trusted):
        return ()
    sd = before.untrusted.sd
    was, now = before.interval(INTERVAL_LEVEL), after.interval(INTERVAL_LEVEL)
    means, new_means = before.mean, after.mean
    identified = set(means) & set(new_means)
    return tuple(
        Shift(
            name=name,
            before=means[name] if name in identified else None,
            after=new_means[name] if name in identified else None,
            interval_before=was[name],
            interval_after=now[name],
            moved=_in_sd(new_means[name] - means[name], sd[name]) if name in identified else None,
            low_shift=_in_sd(now[name][0] - was[name][0], sd[name]),
            high_shift=_in_sd(now[name][1] - was[name][1], sd[name]),
        )
        for name in before.names
        if name in after.names
    )


def _in_sd(change: float, sd: float) -> float:
    """A change in standard deviations; 0 or infinite where the standard deviation is 0."""
    return change / sd if sd > 0 else float(np.copysign(np.inf, change)) if change else 0.0


def _calibration_notes(calibration: ProbeCalibration, created: datetime) -> tuple[str, ...]:
    try:
        calibration.require_usable(created)
    except CalibrationError as error:
        return (f"when the estimate was made the calibration was not to be used: {error}",)
    try:
        calibration.require_usable(datetime.now(UTC))
    except CalibrationError:
        until = "" if calibration.expires is None else f" (on {calibration.expires:%Y-%m-%d})"
        return (
            f"the calibration {calibration.name!r} has expired since{until}; it was good when the estimate was made",
        )
    return ()

"""Estimates from stored presses with the present code, for imports and recomputations."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import tsis.hardness
import tsis.inclusion
from tsis.calibration import apply_calibration
from tsis.catalog import load_probe
from tsis.errors import RecordsError
from tsis.hardness import HardnessPrior
from tsis.inclusion import InclusionPrior
from tsis.model import ContentValue, freeze_mappings
from tsis.records._values import ESTIMATES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from tsis.model import Estimate
    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredPress


REFERENCE_ROLES = {"inclusion": "plain", "hardness": "ball"}  # role of the reference presses
PRIORS: Mapping[str, type[InclusionPrior | HardnessPrior]] = {"inclusion": InclusionPrior, "hardness": HardnessPrior}
OPTIONS = {  # beside the prior
    "inclusion": ("strain",),
    "hardness": ("radius_mm", "radius_sd_mm", "reference_radius_mm", "blur_mm", "drift_sd"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimationRequest(ContentValue):
    """An estimate to compute from presses of a target record.

    Parameters
    ----------
    kind
        ``"inclusion"`` or ``"hardness"``.
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EstimationResult:
    """An estimate, its options in the form of this release, and notes on options that changed."""

    estimate: Estimate
    options: Mapping[str, Any]
    notes: tuple[str, ...] = ()


def estimate_stored(
    record: TargetRecord, request: EstimationRequest, *, progress: Callable[[int, int], None] | None = None
) -> EstimationResult:
    """Estimate from stored frames with a stored calibration.

    ``progress`` is called with (done, all) while the mechanics of a new probe are solved; the solution is cached.

    Raises
    ------
    RecordsError
        When the record lacks the calibration, or no press is on the target.
    InputError, CalibrationError, NotCalibratedError
        As the estimators.
    """
    calibration = record.calibrations.get(request.calibration)
    if calibration is None:
        raise RecordsError(f"the calibration {request.calibration[:12]!r} must be stored to estimate with; it is not")
    images = [record.image(press) for press in request.presses if press.role == "target"]
    others = [record.image(press) for press in request.presses if press.role == REFERENCE_ROLES[request.kind]]
    if not images:
        raise RecordsError("an estimate must rest on at least one press on the target; of these presses none is one")
    given: dict[str, Any] = {"identity": request.calibration, "on_tissue": request.kind == ESTIMATES[0]}
    ready, response = apply_calibration(calibration, images, **given)
    reference, other = apply_calibration(calibration, others, **given)
    probe, (options, notes) = load_probe(request.probe), migrate_options(request.kind, request.options)
    call = dict(options) | ({"prior": _prior(request.kind, options["prior"])} if "prior" in options else {})
    call |= {"probe": probe, "reference": reference, "progress": progress}
    if request.kind == ESTIMATES[0]:
        call.setdefault("strain", "small")  # records without the option are of releases before finite strain
        response = max(response, other, key=lambda item: item.force_sd)
        result = tsis.inclusion.estimate(ready, calibration=response, **call)
    else:
        result = tsis.hardness.estimate(ready, calibration=response, **call)
    return EstimationResult(estimate=result, options=options, notes=notes)


def migrate_options(kind: str, options: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Options of a stored estimate in the form of this release, and a note for each that was removed or is new."""
    notes = [f"the option {name!r} is unknown to this release and was left out" for name in options]
    notes = [note for name, note in zip(options, notes, strict=True) if name not in ("prior", *OPTIONS[kind])]
    ours = {name: options[name] for name in OPTIONS[kind] if options.get(name) is not None}
    prior = options.get("prior")
    if prior is None:
        return ours, tuple(notes)
    known = {field.name for field in fields(PRIORS[kind])}
    notes += [
        f"{name!r} of the prior is unknown to this release and was left out" for name in prior if name not in known
    ]
    new = PRIORS[kind]()
    notes += [
        f"{name!r} of the prior is new in this release; its default, {getattr(new, name)}, was taken"
        for name in sorted(known - set(prior))
    ]
    return ours | {"prior": {name: value for name, value in prior.items() if name in known}}, tuple(notes)


def require_options(kind: str, options: Mapping[str, Any]) -> None:
    """Raise `InputError` for options that this kind of estimate refuses."""
    migrated, _ = migrate_options(kind, options)
    if "prior" in migrated:
        _prior(kind, migrated["prior"])


def _prior(kind: str, values: Mapping[str, Any]) -> Any:
    prior_class: Any = PRIORS[kind]  # `migrate_options` has removed unknown fields
    return prior_class(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})

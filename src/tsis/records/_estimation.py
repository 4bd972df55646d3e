"""Estimates of stored presses with the code of today: the first one of an import, and those that are made again."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import tsis.hardness
import tsis.inclusion
from tsis.calibration import apply_calibration
from tsis.catalog import load_probe
from tsis.errors import RecordsError
from tsis.hardness import HardnessPrior
from tsis.inclusion import InclusionPrior
from tsis.records._values import ESTIMATES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from tsis.model import Estimate
    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredPress


REFERENCES = {"inclusion": "plain", "hardness": "ball"}  # role of the presses that are given as reference
PRIORS: Mapping[str, type[InclusionPrior | HardnessPrior]] = {"inclusion": InclusionPrior, "hardness": HardnessPrior}
OPTIONS = {  # beside the prior
    "inclusion": (),
    "hardness": ("radius_mm", "radius_sd_mm", "reference_radius_mm", "blur_mm", "drift_sd"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimationRequest:
    """What is to be estimated from presses of a dossier.

    Parameters
    ----------
    kind
        ``"inclusion"`` or ``"hardness"``.
    probe
        Name of the probe in the catalog.
    presses
        Those that it rests on: the role of each says what it is taken for, their order is kept.
    calibration
        SHA-256 of the calibration in the dossier.
    options
        Arguments of the call by name as plain values, the prior as its fields.
    """

    kind: str
    probe: str
    presses: tuple[StoredPress, ...]
    calibration: str
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "options", MappingProxyType(dict(self.options)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EstimationResult:
    """An estimate, the options as this release takes them, and what it could not take over."""

    estimate: Estimate
    options: Mapping[str, Any]
    notes: tuple[str, ...] = ()


def estimate_stored(
    record: TargetRecord, request: EstimationRequest, *, progress: Callable[[int, int], None] | None = None
) -> EstimationResult:
    """Estimate from the frames as they are stored, with the calibration as it is stored.

    Parameters
    ----------
    record
        Where frames and calibration are.
    request
        What to estimate.
    progress
        Called with (done, all) while the mechanics of a new probe are solved, which is kept for next time.

    Raises
    ------
    RecordsError
        When the calibration is not in the dossier or no press is one on the target.
    InputError, CalibrationError, NotCalibratedError
        As the estimates themselves.
    """
    given = record.calibrations.get(request.calibration)
    if given is None:
        raise RecordsError(f"the calibration {request.calibration[:12]!r} must be stored to estimate with; it is not")
    images = [record.image(press) for press in request.presses if press.role == "target"]
    others = [record.image(press) for press in request.presses if press.role == REFERENCES[request.kind]]
    if not images:
        raise RecordsError("an estimate must rest on at least one press on the target; of these presses none is one")
    ready, response = apply_calibration(given, images, identity=request.calibration)
    reference, other = apply_calibration(given, others, identity=request.calibration)
    probe, (options, notes) = load_probe(request.probe), migrate_options(request.kind, request.options)
    call = dict(options) | ({"prior": _prior(request.kind, options["prior"])} if "prior" in options else {})
    if request.kind == ESTIMATES[0]:
        response = max(response, other, key=lambda item: item.force_sd)
        result = tsis.inclusion.estimate(
            ready, probe=probe, calibration=response, reference=reference, progress=progress, **call
        )
    else:
        result = tsis.hardness.estimate(
            ready, probe=probe, calibration=response, reference=reference, progress=progress, **call
        )
    return EstimationResult(estimate=result, options=options, notes=notes)


def migrate_options(kind: str, options: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Options of a stored estimate as this release takes them, and a sentence for each that is gone or new."""
    notes = [f"the option {name!r} is unknown to this release and was left out" for name in options]
    notes = [note for name, note in zip(options, notes, strict=True) if name not in ("prior", *OPTIONS[kind])]
    ours = {name: options[name] for name in OPTIONS[kind] if options.get(name) is not None}
    given = options.get("prior")
    if given is None:
        return ours, tuple(notes)
    known = {field.name for field in fields(PRIORS[kind])}
    notes += [
        f"{name!r} of the prior is unknown to this release and was left out" for name in given if name not in known
    ]
    new = PRIORS[kind]()
    notes += [
        f"{name!r} of the prior is new in this release; its default, {getattr(new, name)}, was taken"
        for name in sorted(known - set(given))
    ]
    return ours | {"prior": {name: value for name, value in given.items() if name in known}}, tuple(notes)


def require_options(kind: str, options: Mapping[str, Any]) -> None:
    """Refuse options that no estimate of that kind takes; `InputError` says why."""
    taken, _ = migrate_options(kind, options)
    if "prior" in taken:
        _prior(kind, taken["prior"])


def _prior(kind: str, given: Mapping[str, Any]) -> Any:
    created: Any = PRIORS[kind]  # the fields of either were looked through by `migrate_options`
    return created(**{name: tuple(value) if isinstance(value, list) else value for name, value in given.items()})

"""An estimate from stored presses of a target."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import LARGEST_TARGET
from tsis.catalog.phantoms import load_phantom
from tsis.catalog.probes import load_probe
from tsis.errors import InputError, RecordsError
from tsis.inclusion import InclusionPrior, estimate, prior_on_tissue, stated_strain
from tsis.model.require import require_integer, require_one_of
from tsis.records.provenance import environment
from tsis.records.recomputation import REFERENCE_ROLES, EstimationRequest, estimate_stored, require_options
from tsis.records.values import ESTIMATES
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from tsis.console.services._subject import TissueReading
    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, StoredPress, TargetRecord

NO_PRESS = "target {} must have a press on the target to be estimated; it has none (press it, save a snapshot)"


def estimate_target(
    store: Store,
    number: int,
    *,
    kind: str,
    presses: Sequence[str] | None,
    options: Mapping[str, Any],
    tissue: TissueReading | None = None,
    progress: Callable[[int, int], None],
) -> StoredEstimate:
    """Estimate from presses of a target and store the estimate.

    Parameters
    ----------
    store, number
        The target's store and number.
    kind
        ``"inclusion"`` or ``"hardness"``.
    presses
        Identities of the presses to use; those of `newest_presses` when None.
    options
        As of `tsis.records.recomputation.EstimationRequest`.
    tissue
        That the prior of an inclusion is moved to, where ``options`` has none.
    progress
        Called with (done, all) while the mechanics of a new probe are solved, and (1, 1) before the result is stored;
        what it raises ends the estimate, and nothing is stored.

    Raises
    ------
    RecordsError
        When the target has no press to estimate from, or a named press is not one of its presses.
    InputError, CalibrationError, NotCalibratedError
        As the estimates themselves.
    """
    record = store.record(store.target(number))
    chosen = newest_presses(record, kind, tissue=tissue) if presses is None else _named(record, presses)
    probe, calibration = _terms(chosen, number)
    if kind == ESTIMATES[0]:
        if tissue is not None:
            options = {"prior": asdict(prior_on_tissue(InclusionPrior(), tissue.young_kpa))} | dict(options)
        options = {"strain": stated_strain(press.settings for press in chosen)} | dict(options)
    response = estimate_stored(
        record,
        EstimationRequest(kind=kind, probe=probe, presses=chosen, calibration=calibration, options=options),
        progress=progress,
    )
    progress(1, 1)
    return store.add_estimate(
        record.target,
        response.estimate,
        kind=kind,
        presses=chosen,
        probe=probe,
        calibration=record.calibrations[calibration],
        options=response.options,
        environment=environment(),
    )


def require_estimable(
    store: Store, number: int, *, kind: str, presses: Sequence[str] | None, options: Mapping[str, Any]
) -> None:
    """Refuse what no estimate can be begun with; parameters as of `estimate_target`, `InputError` says why."""
    require_one_of("kind of estimate", kind, ESTIMATES)
    require_options(kind, options)
    if presses is not None and not (len(presses) > 0 and all(isinstance(press, str) for press in presses)):
        raise InputError(f"presses must be identities of presses, one at least; got {presses!r:.80}")
    require_integer("target", number, 1, LARGEST_TARGET, hint="number of the target")
    try:
        store.target(number)
    except InputError as error:  # the first press makes a target
        raise InputError(NO_PRESS.format(number)) from error


def warm_up(probe: str) -> None:
    """Estimate a simulated press: solver, tables and compiled loops are in the caches then, for every process."""
    rig = VirtualProbe(load_probe(probe), rng=np.random.default_rng(0), strain="small")
    phantom = load_phantom("size-8")
    frames, reference = ([rig.press(item, force_n=1.0)] for item in (phantom, phantom.without_inclusion()))
    estimate(frames, probe=rig.probe, calibration=rig.calibration, reference=reference, strain="small")


def newest_presses(record: TargetRecord, kind: str, *, tissue: TissueReading | None = None) -> tuple[StoredPress, ...]:
    """The newest press of each role and force, among those with the probe and the calibration of the newest one.

    The light press of ``tissue`` is left out: a dome touches only in part under it.

    Presses of unknown force are all used: the force line distinguishes them. Presses at 0 N touch nothing, and no
    estimate can use them.
    """
    roles = ("target", REFERENCE_ROLES[kind])
    used = [press for press in record.presses if press.role in roles and press.force_n != 0]
    used = [press for press in used if tissue is None or press.id != tissue.press]
    on_target = [press for press in used if press.role == "target"]
    if not on_target:
        return ()
    terms = (on_target[-1].probe, on_target[-1].calibration)
    newest: dict[object, StoredPress] = {}
    for press in used:
        if (press.probe, press.calibration) == terms:
            newest[press.id if press.force_n is None else (press.role, press.force_n)] = press
    return tuple(press for press in used if press in newest.values())


def _named(record: TargetRecord, identities: Sequence[str]) -> tuple[StoredPress, ...]:
    by_identity = {press.id: press for press in record.presses}
    for identity in set(identities) - by_identity.keys():
        raise RecordsError(f"presses must be those of target {record.target.number}; {identity!r:.40} is none")
    return tuple(by_identity[identity] for identity in identities)


def _terms(presses: Sequence[StoredPress], number: int) -> tuple[str, str]:
    """The probe and the calibration that all presses share."""
    if not presses:
        raise RecordsError(NO_PRESS.format(number))
    (probe, calibration), *others = {(press.probe, press.calibration) for press in presses}
    if others:
        raise RecordsError("presses must be of one probe under one calibration; these are of several (choose fewer)")
    if calibration is None:
        raise RecordsError("presses must have been taken under a calibration to be estimated; these were not")
    return probe, calibration

"""A device beside the first one on the same targets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.detection import bland_altman, bootstrap_compare_detectors, compare_detectors
from tsis.model.errors import InputError
from tsis.study.reading import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np

    from tsis.detection import BlandAltman, Comparison
    from tsis.study.judged import DeviceResults, TargetResult

ENOUGH = 30  # targets of each kind from which DeLong's test may be used


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DeviceComparison:
    """Two devices on targets that both decided.

    Attributes
    ----------
    first, second
        Their names.
    targets
        How many both decided.
    areas
        Their areas under the curve, paired; None where ``remark`` says why.
    remark
        Why there is no comparison of areas.
    limits
        Bland and Altman's comparison, first less second, of each quantity on inclusions of which both have it.
    """

    first: str
    second: str
    targets: int
    areas: Comparison | None
    remark: str
    limits: Mapping[str, BlandAltman]


def device_comparison(first: DeviceResults, second: DeviceResults, rng: np.random.Generator) -> DeviceComparison:
    """Compare two devices; with fewer than 30 targets of a kind by the bootstrap, else by DeLong's test."""
    both = [
        (one, other)
        for one, other in zip(first.targets, second.targets, strict=True)
        if one.score is not None and other.score is not None
    ]
    scores = _ranks(first, [one for one, _ in both]), _ranks(second, [other for _, other in both])
    present = [one.truth.has_inclusion for one, _ in both]
    areas, remark = None, ""
    try:
        if min(sum(present), len(present) - sum(present)) >= ENOUGH:
            areas = compare_detectors(*scores, present)
        else:
            areas = bootstrap_compare_detectors(*scores, present, rng=rng)
    except InputError as error:
        remark = str(error)
    return DeviceComparison(
        first=first.device,
        second=second.device,
        targets=len(both),
        areas=areas,
        remark=remark,
        limits={name: found for name in QUANTITIES if (found := _limits(first, second, name)) is not None},
    )


def _ranks(device: DeviceResults, targets: Sequence[TargetResult]) -> list[float]:
    """What orders some of the targets that a device decided."""
    by_code = dict(zip((each.code for each in device.decided), device.ranks()[0].tolist(), strict=True))
    return [by_code[each.code] for each in targets]


def _limits(first: DeviceResults, second: DeviceResults, quantity: str) -> BlandAltman | None:
    pairs = [
        (one.reading.values[quantity], other.reading.values[quantity])
        for one, other in zip(first.targets, second.targets, strict=True)
        if one.truth.has_inclusion and one.reading and other.reading
        if quantity in one.reading.values and quantity in other.reading.values
    ]
    if len(pairs) < 2:
        return None
    return bland_altman([one for one, _ in pairs], [other for _, other in pairs])


__all__ = ["DeviceComparison", "device_comparison"]

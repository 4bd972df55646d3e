"""The analysis of an unblinded study: every device, and every further device against the first."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.detection import bland_altman, bootstrap_compare_detectors, compare_detectors
from tsis.errors import InputError, RecordsError, import_extra
from tsis.study._folder import read_seal
from tsis.study._tables import quantity_columns
from tsis.study._values import QUANTITIES
from tsis.study._verification import verify_study
from tsis.study.analysis._device import device_analysis
from tsis.study.analysis._precision import device_results

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from tsis.detection import BlandAltman, Comparison
    from tsis.study._folder import Study
    from tsis.study._values import TargetTruth
    from tsis.study._verification import StudyVerification
    from tsis.study.analysis._device import DeviceAnalysis
    from tsis.study.analysis._precision import DeviceResults, TargetResult


ENOUGH = 30  # targets of each kind for DeLong's test


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DeviceComparison:
    """Two devices on the targets that both decided.

    ``areas`` compares their areas under the curve, paired; None with a ``remark``. ``limits`` has Bland and Altman's
    comparison, first minus second, of each quantity on inclusions that both measured.
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
        (target, other)
        for target, other in zip(first.targets, second.targets, strict=True)
        if target.score is not None and other.score is not None
    ]
    scores = _ranks(first, [item for item, _ in both]), _ranks(second, [other for _, other in both])
    present = [item.truth.has_inclusion for item, _ in both]
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
        limits={name: result for name in QUANTITIES if (result := _limits(first, second, name)) is not None},
    )


def _ranks(device: DeviceResults, targets: Sequence[TargetResult]) -> list[float]:
    """Ranks of some of the targets that a device decided."""
    by_code = dict(zip((item.code for item in device.decided), device.ranks()[0].tolist(), strict=True))
    return [by_code[target.code] for target in targets]


def _limits(first: DeviceResults, second: DeviceResults, quantity: str) -> BlandAltman | None:
    pairs = [
        (target.reading.values[quantity], other.reading.values[quantity])
        for target, other in zip(first.targets, second.targets, strict=True)
        if target.truth.has_inclusion and target.reading and other.reading
        if quantity in target.reading.values and quantity in other.reading.values
    ]
    if len(pairs) < 2:
        return None
    return bland_altman([item for item, _ in pairs], [other for _, other in pairs])


BOOTSTRAP = 20_110  # seed, so that an analysis is reproducible to the digit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyAnalysis:
    """The analysis of an unblinded study: truths by code, faults of its files and log, and devices.

    Devices are in the order of their first reading; ``comparisons`` are of every further device with the first.
    """

    study: Study
    truths: Mapping[str, TargetTruth]
    verification: StudyVerification
    devices: tuple[DeviceAnalysis, ...]
    comparisons: tuple[DeviceComparison, ...]


def analyse(study: Study, *, progress: Callable[[int, int], None] | None = None) -> StudyAnalysis:
    """Analyse an unblinded study; faults of a changed study are in ``verification``.

    The first reading of each target by a device counts; repeats serve for the agreement. Random numbers are the same
    each time, so the same study gives the same result. ``progress`` is called with (done, total) devices.

    `RecordsError` when the study is blind, or its truth cannot be read.
    """
    if study.unblinded is None:
        raise RecordsError("a study must be unblinded before it is analysed; this one is blind")
    seal, _ = read_seal(study)
    truths = {code: seal.truths[code] for code in study.plan.codes}
    entries = [
        device_results(device, study.threshold_of(device), study.readings, truths, study.plan.codes)
        for device in study.devices
    ]
    devices = []
    for number, item in enumerate(entries):
        if progress is not None:
            progress(number, len(entries))
        devices.append(device_analysis(item, study.readings, np.random.default_rng([BOOTSTRAP, number])))
    comparisons = [
        device_comparison(entries[0], item, np.random.default_rng([BOOTSTRAP, number, 1]))
        for number, item in enumerate(entries[1:], start=1)
    ]
    if progress is not None:
        progress(len(entries), len(entries))
    return StudyAnalysis(
        study=study,
        truths=truths,
        verification=verify_study(study.folder),
        devices=tuple(devices),
        comparisons=tuple(comparisons),
    )


def results_table(analysis: StudyAnalysis) -> Any:
    """Every target of every device as a ``pandas.DataFrame``: its truth, and the first reading of it.

    The columns are device, code, label, has_inclusion, the true values ``true_...``, score, called (whether the score
    reaches the device's threshold), undecided and unread, and value, standard deviation and 90 % interval of each
    quantity as in `tsis.study.readings_table`. Raises `MissingExtraError` without the extra ``analysis``.
    """
    pandas = import_extra("pandas", feature="a table of results", extra="analysis")
    rows = [
        {
            "device": device.results.device,
            "code": item.code,
            "label": item.truth.label,
            "has_inclusion": item.truth.has_inclusion,
            **{f"true_{name}": item.truth.values.get(name, math.nan) for name in QUANTITIES},
            "score": math.nan if item.score is None else item.score,
            "called": device.results.calls(item),
            "undecided": item.reading is not None and item.score is None,
            "unread": item.reading is None,
            **quantity_columns(item.reading),
        }
        for device in analysis.devices
        for item in device.results.targets
    ]
    return pandas.DataFrame(rows)

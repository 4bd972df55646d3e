"""Readings beside the truth: what a study says of every device."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.model.errors import RecordsError
from tsis.study.comparison import device_comparison
from tsis.study.device_analysis import device_analysis
from tsis.study.folder import read_seal
from tsis.study.judged import device_results
from tsis.study.verification import verify_study

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from tsis.study.comparison import DeviceComparison
    from tsis.study.device_analysis import DeviceAnalysis
    from tsis.study.folder import Study
    from tsis.study.truth import TargetTruth
    from tsis.study.verification import StudyVerification

BOOTSTRAP = 20_110  # seed of what is drawn in an analysis, so that it can be made again to the digit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyAnalysis:
    """What a study says.

    Attributes
    ----------
    study
        As it was then, unblinded.
    truths
        By code.
    verification
        Whether it is as it was written.
    devices
        Numbers of each, in the order in which they came.
    comparisons
        Of every further device with the first.
    """

    study: Study
    truths: Mapping[str, TargetTruth]
    verification: StudyVerification
    devices: tuple[DeviceAnalysis, ...]
    comparisons: tuple[DeviceComparison, ...]


def analyse(study: Study, *, progress: Callable[[int, int], None] | None = None) -> StudyAnalysis:
    """Analyse an unblinded study; a study that was changed is analysed as it is, and `verification` tells it.

    The first reading of each target by a device is what counts; repeats serve to tell how well they agree. An analysis
    draws the same numbers each time, so that the same study has the same answer.

    Parameters
    ----------
    study
        Unblinded.
    progress
        Called with (done, total) devices.

    Raises
    ------
    RecordsError
        When the study is blind, or its truth cannot be read.
    """
    if study.unblinded is None:
        raise RecordsError("a study must be unblinded before it is analysed; this one is blind")
    seal, _ = read_seal(study)
    truths = {code: seal.truths[code] for code in study.plan.codes}
    told = [
        device_results(device, study.threshold_of(device), study.readings, truths, study.plan.codes)
        for device in study.devices
    ]
    devices = []
    for number, each in enumerate(told):
        if progress is not None:
            progress(number, len(told))
        devices.append(device_analysis(each, study.readings, np.random.default_rng([BOOTSTRAP, number])))
    comparisons = [
        device_comparison(told[0], each, np.random.default_rng([BOOTSTRAP, number, 1]))
        for number, each in enumerate(told[1:], start=1)
    ]
    if progress is not None:
        progress(len(told), len(told))
    return StudyAnalysis(
        study=study,
        truths=truths,
        verification=verify_study(study.folder),
        devices=tuple(devices),
        comparisons=tuple(comparisons),
    )


__all__ = ["StudyAnalysis", "analyse"]

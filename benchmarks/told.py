"""The estimate of one who is told the world: how uneven the tissue is, that it has no layer, and the true light.

Its width is the price of what the estimate does not know, and its standard deviation is the Bayes bound of any
estimator in that world, as far as its own intervals hold.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from benchmarks.lamp_laws import calibrated_probe

from tsis.inclusion._estimate import analyse
from tsis.inclusion.posterior import explore_inclusion

if TYPE_CHECKING:
    from benchmarks.press_bank import PressBank

    from tsis.inclusion.posterior import InclusionPosterior


def told(bank: PressBank, index: int, strain: str) -> InclusionPosterior:
    """Posterior of case ``index`` under the one hypothesis on tissue and light that holds in its world."""
    case = bank.raw(index)
    calibration = case.calibration
    if bank.world.lamps:
        calibration = calibrated_probe(bank.world.lamps, bank.protocol.probe, bank.seed).truth
    found = analyse(
        case.frames,
        probe=bank.protocol.probe,
        calibration=calibration,
        reference=case.references,
        prior=bank.prior,
        progress=None,
        strain=strain,
    )
    hypotheses = found.likelihood.model.heterogeneity
    if hypotheses is None or bank.world.sd is None or bank.world.length_mm is None:
        return found.posterior
    return explore_inclusion(found.likelihood.under(hypotheses.alone(bank.world.sd, bank.world.length_mm)), bank.prior)


def told_sd(bank: PressBank, index: int, strain: str) -> tuple[list[float], list[float]]:
    """Standard deviations of diameter, depth and modulus, and the ranks of the truth, as `judgement.compared`."""
    samples = told(bank, index, strain).samples
    truth = bank.raw(index).phantom.inclusion
    assert truth is not None  # no blanks are told
    true = np.array([truth.diameter_mm, truth.depth_mm, truth.young_kpa])
    rank = (samples < true).mean(axis=0) + (samples == true).mean(axis=0) / 2
    return samples.std(axis=0).tolist(), rank.tolist()

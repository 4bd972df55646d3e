"""The estimate of one who knows the world: how uneven the tissue is, that it has no layer, and the true light.

Its width is the price of what the estimate does not know, and its standard deviation is the Bayes bound of any
estimator in that world, as far as its own intervals hold.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.judgement import compared
from benchmarks.lamp_laws import calibrated_probe
from benchmarks.worlds import RANDOM_SD

from tsis.compiled import one_blas_thread
from tsis.inclusion import estimate
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.inclusion.reading import press_tables, read_frames

if TYPE_CHECKING:
    from benchmarks.press_bank import PressBank
    from benchmarks.simulated_presses import SimulatedCase
    from benchmarks.worlds import World

    from tsis.inclusion import InclusionPrior
    from tsis.inclusion.posterior.exploration import InclusionPosterior
    from tsis.inclusion.reading import PressTables
    from tsis.model.probe import Probe


def informed_posterior(bank: PressBank, case: SimulatedCase, strain: str) -> InclusionPosterior:
    """Posterior of a case, as it is before lamps are corrected, under the tissue and the light of its world."""
    calibration = case.calibration
    if bank.world.lamps:
        calibration = calibrated_probe(bank.world.lamps, bank.protocol.probe, bank.seed).truth
    with one_blas_thread():
        reading = read_frames(
            list(case.frames),
            list(case.references),
            _tables(bank.protocol.probe, bank.prior, strain),
            probe=bank.protocol.probe,
            calibration=calibration,
            prior=bank.prior,
        )
        likelihood = reading.likelihood
        hypotheses = likelihood.model.heterogeneity
        if hypotheses is not None and bank.world.sd is not None and bank.world.length_mm is not None:
            likelihood = likelihood.under(hypotheses.alone(bank.world.sd, bank.world.length_mm))
        return explore_inclusion(likelihood, bank.prior)


@lru_cache(maxsize=1)
def _tables(probe: Probe, prior: InclusionPrior, strain: str) -> PressTables:
    return press_tables(probe, prior, strain)


def knowing(prior: InclusionPrior, world: World) -> InclusionPrior:
    """The prior of one who knows how uneven the tissue of a world may be."""
    return replace(prior, heterogeneity_sd=RANDOM_SD[1] if world.sd is None else world.sd)


def informed_spread(bank: PressBank, index: int, strain: str) -> tuple[list[float], list[float]]:
    """Standard deviations of diameter, depth and modulus, and the ranks of the truth, as `judgement.compared`.

    Of a shipped prior it is the estimate itself that knows how uneven the tissue may be, and not the place either.
    """
    case = bank.case(index) if bank.prior.name else bank.raw(index)
    truth = case.phantom.inclusion
    assert truth is not None  # blanks have no spread
    if bank.prior.name:
        found = estimate(
            case.frames,
            probe=bank.protocol.probe,
            calibration=case.calibration,
            reference=case.references,
            prior=knowing(bank.prior, bank.world),
            strain=strain,
        )
        line = compared(found, truth)
        return line["sd"], line["rank"]
    samples = informed_posterior(bank, case, strain).samples
    true = np.array([truth.diameter_mm, truth.depth_mm, truth.young_kpa])
    rank = (samples < true).mean(axis=0) + (samples == true).mean(axis=0) / 2
    return samples.std(axis=0).tolist(), rank.tolist()

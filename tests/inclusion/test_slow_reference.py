"""The fast posterior against a sampler that linearises nothing, and the forward model against one written in loops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.slow_reference import PROTOCOLS, compare, log_likelihood, looped, simulated
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from tsis.inclusion.posterior.forward import SHARED

pytestmark = pytest.mark.usefixtures("flat", "domed")

FAINT = ("flat", (1.2, 7.0, 80.0))


@pytest.mark.parametrize(
    "protocol", [pytest.param(each, marks=[pytest.mark.slow] * (each == "flat-alone")) for each in PROTOCOLS]
)
def test_the_forward_model_written_twice(protocol: str) -> None:
    """Every nuisance far from what is believed."""
    rng = np.random.default_rng(4)
    experiment, data = simulated(protocol, (10.0, 5.0, 60.0), rng)
    prior, again = experiment.model.prior, looped(experiment.model)
    sd = experiment.nuisance_sd(data.grey)
    assert len(sd) == SHARED + 2 * len(data.grey)
    for _ in range(10):
        inclusion, nuisance = rng.uniform(prior.low, prior.high), 2 * sd * rng.standard_normal(len(sd))
        for shown in (inclusion, None):
            expected = experiment.expected(shown, nuisance)
            np.testing.assert_allclose(again(shown, nuisance), expected, rtol=1e-11)
            assert np.ptp(expected) > 1


def test_its_density_is_the_normal_one_of_the_usable_rings() -> None:
    experiment, data = simulated("flat", (10.0, 5.0, 60.0), np.random.default_rng(4))
    usable = np.ones(data.grey.shape, dtype=bool)
    usable[0, 4] = usable[1, 15:] = False
    density = log_likelihood(experiment.model, replace(data, usable=usable))
    known, grey, use = experiment.model.calibration, data.grey, usable.ravel()
    assert experiment.model.correlation is not None
    root = np.linalg.cholesky(experiment.model.correlation)
    # Neighbouring rings share grains: of a pattern that all frames show, and of one that each press draws anew.
    pattern = np.concatenate([known.pattern_sd * row[:, None] * root for row in grey])
    repeated = block_diag(*[known.repeatability_sd * row[:, None] * root for row in grey])
    cov = np.diag(data.variance.ravel()) + pattern @ pattern.T + repeated @ repeated.T
    normal = multivariate_normal(cov=cov[np.ix_(use, use)])
    found, expected = [], []
    for diameter in (9.0, 10.0, 11.0):
        inclusion, nuisance = np.array([diameter, 5.0, 60.0]), np.zeros(SHARED + 4)
        left = grey - experiment.expected(inclusion, nuisance)
        found.append(density(inclusion, nuisance))
        expected.append(normal.logpdf(left.ravel()[use]))
    np.testing.assert_allclose(np.diff(found), np.diff(expected), rtol=1e-6)
    assert np.ptp(expected) > 10


@pytest.mark.slow
def test_what_can_hardly_be_seen_against_a_sampler_of_everything() -> None:
    """Means, standard deviations and the Bayes factor, within what is allowed and twice the sampler's own error."""
    found = compare(*FAINT, samples=3000, seed=1)
    sampled, plain = found.sampled, found.plain
    assert plain is not None
    assert min(sampled.effective, plain.effective) > 100
    chance = 2 / np.sqrt(sampled.effective)
    assert (np.abs(found.shift) < 0.1 + chance).all()
    assert (np.abs(found.widening - 1) < 0.1 + chance).all()
    factor, error = found.sampled_log_bayes_factor()
    assert abs(found.log_bayes_factor - factor) < 0.1 + 2 * error
    assert error < 0.2
    assert 1 < factor < 6, "neither certain nor excluded"


@pytest.mark.slow
def test_what_can_be_seen_well_against_a_sampler_of_everything() -> None:
    found = compare("domed", (10.0, 5.0, 60.0), samples=2000, seed=1)
    sampled = found.sampled
    assert sampled.effective > 100
    chance = 2 / np.sqrt(sampled.effective)
    assert (np.abs(found.shift) < 0.1 + chance).all()
    assert (np.abs(found.widening - 1) < 0.1 + chance).all()
    assert (sampled.sd[:2] < 0.5).all()

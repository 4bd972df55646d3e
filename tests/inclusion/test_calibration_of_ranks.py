"""Ranks of truths drawn from the prior among posterior samples: uniform if the posterior is right."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.judgement import Judgement
from benchmarks.simulation_based_calibration import (
    ALONE,
    PROTOCOLS,
    Experiment,
    chances,
    draw,
    noise,
    run,
)
from benchmarks.slow_reference import weighted
from scipy.stats import kstest

from tsis.inclusion import InclusionPrior
from tsis.inclusion.frames import ring_edges
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.inclusion.posterior.forward import SHARED, THICKNESS
from tsis.inclusion.posterior.likelihood import InclusionLikelihood
from tsis.inclusion.prior import PARAMETERS
from tsis.virtual.examinations import DEEPEST_FRACTION

if TYPE_CHECKING:
    from numpy.typing import NDArray

pytestmark = pytest.mark.usefixtures("flat", "domed")

PRIOR = InclusionPrior()


@pytest.fixture(scope="module")
def flat_with_reference() -> Experiment:
    return Experiment.of(PROTOCOLS["flat"], PRIOR)


def judged(rank: NDArray[np.float64]) -> Judgement:
    common = {"truth": 3 * [1.0], "mean": 3 * [0.0], "sd": 3 * [1.0], "trusted": True, "flags": []}
    return Judgement.of([common | {"rank": at} for at in rank])


def test_noise_has_the_covariance_that_is_stated(flat_with_reference: Experiment) -> None:
    """By its parts: a pattern for all frames, one of each press, both of grains, and what each mean has for its own."""
    rng, grey = np.random.default_rng(1), flat_with_reference.known(np.array([10.0, 5.0, 60.0]))
    variance, known = flat_with_reference.variance(grey), flat_with_reference.model.calibration
    edges, grain, count = ring_edges(PROTOCOLS["flat"].probe), known.grain_mm, 20_000
    radius = np.linspace(0.0, edges[-1], 20 * 16 + 1)
    middle = (radius[1:] + radius[:-1]) / 2
    weight = middle.reshape(20, 16) / middle.reshape(20, 16).sum(axis=1, keepdims=True)
    knots = np.arange(-2 * grain, edges[-1] + 3 * grain, grain)

    def grains() -> NDArray[np.float64]:
        """Means over rings of lines between values drawn wherever, of variance one on average."""
        values = np.sqrt(1.5) * rng.standard_normal(len(knots))
        line = np.interp(middle + grain * rng.random(), knots, values)
        return np.asarray((weight * line.reshape(20, 16)).sum(axis=1))

    drawn = np.array(
        [known.pattern_sd * grains() + known.repeatability_sd * np.array([grains(), grains()]) for _ in range(count)]
    )
    drawn = drawn * grey + np.sqrt(variance) * rng.standard_normal((count, *grey.shape))
    found = noise(grey, variance, flat_with_reference.model)
    size = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    np.testing.assert_allclose(np.cov(drawn.reshape(count, -1).T) / size, found / size, atol=0.04)
    own = np.diag(variance.ravel())
    assert np.linalg.norm(found - own) > 0.5 * np.linalg.norm(found)


def test_profiles_scatter_as_they_say(flat_with_reference: Experiment) -> None:
    rng, grey = np.random.default_rng(2), flat_with_reference.known(np.array([10.0, 5.0, 60.0]))
    seen = [flat_with_reference.observed(grey, rng) for _ in range(2000)]
    sd = np.sqrt(np.diag(noise(grey, flat_with_reference.variance(grey), flat_with_reference.model)))
    np.testing.assert_allclose(np.std([one.grey for one in seen], axis=0).ravel(), sd, rtol=0.08)
    np.testing.assert_allclose(seen[0].variance, flat_with_reference.variance(grey), rtol=0.05)


def test_draws_are_those_of_the_prior(flat_with_reference: Experiment, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []

    def expected(
        self: Experiment, inclusion: NDArray[np.float64] | None, nuisance: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        assert inclusion is not None
        drawn.append((inclusion, nuisance))
        return np.full((2, self.model.rings.count), 50.0)

    monkeypatch.setattr(Experiment, "expected", expected)
    rng = np.random.default_rng(3)
    for _ in range(600):
        draw(flat_with_reference, rng)
    inclusions, nuisances = (np.array(column) for column in zip(*drawn[1::2], strict=True))
    for column, low, high in zip(inclusions.T, PRIOR.low, PRIOR.high, strict=True):
        assert kstest((column - low) / (high - low), "uniform").pvalue > 1e-3
    sd = flat_with_reference.nuisance_sd(np.full((2, 20), 50.0))
    others = np.delete(nuisances / sd, THICKNESS, axis=1)
    assert others.shape[1] == SHARED + 3
    assert kstest(others.ravel(), "norm").pvalue > 1e-3
    slab = PRIOR.thickness_mm * np.exp(nuisances[:, THICKNESS])
    assert (inclusions[:, 0] + inclusions[:, 1] < DEEPEST_FRACTION * slab).all()


def test_uneven_ranks_are_found_out() -> None:
    even = np.random.default_rng(4).uniform(size=(1000, 3))
    narrow = even.copy()
    narrow[:, 1] = 0.5 + 1.3 * (narrow[:, 1] - 0.5)  # as of a posterior that claims too much: truths at its ends
    assert (chances(judged(even)) > 0.01).all()
    found = chances(judged(np.clip(narrow, 0.0, 1.0)))
    assert found[1] < 1e-6 < 0.01 < found[[0, 2]].min()


@pytest.mark.slow
def test_a_few_ranks_are_not_uneven() -> None:
    found = run(PROTOCOLS["flat-alone"], 40, seed=2)
    assert found.rank.shape == (40, 3)
    assert all(kstest(column, "uniform").pvalue > 0.01 for column in found.rank.T)
    assert (found.sd[:, 0] < 0.9 * PRIOR.sd["diameter_mm"]).mean() > 0.8, "estimates that say something"


@pytest.mark.slow
@pytest.mark.parametrize("protocol", ALONE)
def test_ranks_are_uniform(protocol: str) -> None:
    found = run(PROTOCOLS[protocol], 150, seed=3)
    summary = found.summary(PRIOR)
    for name in PARAMETERS:
        assert summary[name]["uniform_ranks"] > 0.01
        assert 0.83 < summary[name]["coverage_90"] < 0.97
    assert (chances(found) > 0.01).all()
    assert found.keeps_the_claim()


@pytest.mark.slow
def test_a_faint_inclusion_is_not_moved_to_where_nothing_was_compared() -> None:
    """Draw 111 of seed 2: a parabola through comparisons once put a mountain into a corner of the prior."""
    prior = InclusionPrior()
    experiment = Experiment.of(PROTOCOLS["domed"], prior)
    rng = np.random.default_rng(np.random.SeedSequence(2, spawn_key=(111,)))
    truth, data = draw(experiment, rng)
    likelihood = InclusionLikelihood(experiment.model, data)
    found = explore_inclusion(likelihood, prior)
    exact = weighted(experiment, data, found, count=500, rng=rng).mean
    assert (np.abs(found.middle - truth) < 4 * found.samples.std(axis=0)).all()
    assert (np.abs(found.samples.mean(axis=0) - exact) < 0.5 * found.samples.std(axis=0)).all()

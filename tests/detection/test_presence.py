"""Probabilities of an inclusion moved by Bayes' rule, beside whole numbers and a count of drawn targets."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import InputError
from tsis.model import Estimate
from tsis.study.probabilities import PresenceProbability, presence

SHARES = st.integers(1, 9999).map(lambda whole: Fraction(whole, 10000))


def _estimate(**changed: Any) -> Estimate:
    given_by_default = {
        "samples": {"depth_mm": [5.0, 6.0]},
        "prior_sd": {"depth_mm": 2.0},
        "presence": 0.8,
        "provenance": {"prior": {"presence": 0.5}},
    }
    return Estimate(**{**given_by_default, **changed})


@given(SHARES, SHARES, SHARES)
def test_moving_is_bayes_rule_in_whole_numbers(probability: Fraction, prior: Fraction, other: Fraction) -> None:
    ratio = probability / (1 - probability) / (prior / (1 - prior))
    odds = ratio * other / (1 - other)
    found = PresenceProbability(probability=float(probability), prior=float(prior))
    assert found.likelihood_ratio == pytest.approx(float(ratio), rel=1e-9)
    moved = found.at_prevalence(float(other))
    assert moved.probability == pytest.approx(float(odds / (1 + odds)), rel=1e-9)
    assert moved.at_prevalence(float(prior)).probability == pytest.approx(float(probability), rel=1e-9)


def test_moved_probabilities_come_true_at_the_new_prevalence() -> None:
    rng = np.random.default_rng(1)
    there = rng.random(40000) < 0.1
    signal = rng.normal(size=len(there)) + 1.5 * there
    at_half = 1 / (1 + np.exp(-(1.5 * signal - 1.5**2 / 2)))  # the posterior where every second target holds one
    moved = np.array(
        [PresenceProbability(probability=p, prior=0.5).at_prevalence(0.1).probability for p in at_half.tolist()]
    )
    for low, high in ((0.0, 0.1), (0.1, 0.3), (0.3, 0.7)):
        within = (moved > low) & (moved <= high)
        error = np.sqrt(moved[within].mean() / within.sum())
        assert there[within].mean() == pytest.approx(moved[within].mean(), abs=4 * error)


def test_what_was_rounded_to_certain_stays_so_and_says_that_its_ratio_is_a_bound() -> None:
    for certain in (0.0, 1.0):
        found = PresenceProbability(probability=certain, prior=0.5)
        assert found.is_bound
        assert np.isfinite(found.log_likelihood_ratio)
        assert found.at_prevalence(0.001).probability == certain
    assert PresenceProbability(probability=1.0, prior=0.5).likelihood_ratio > 1e15
    assert PresenceProbability(probability=0.0, prior=0.5).likelihood_ratio < 1e-300
    assert not PresenceProbability(probability=0.5, prior=0.5).is_bound


@given(st.floats(-2000, 2000), st.floats(0.001, 0.999), st.floats(0.001, 0.999))
def test_evidence_that_was_kept_is_not_rounded(evidence: float, prior: float, other: float) -> None:
    def told(share: float) -> float:
        return float(1 / (1 + Decimal(-evidence).exp() * (1 - Decimal(share)) / Decimal(share)))

    provenance = {"prior": {"presence": prior}}
    found = presence(_estimate(presence=told(prior), log_bayes_factor=evidence, provenance=provenance))
    assert not found.is_bound
    assert found.likelihood_ratio == pytest.approx(float(Decimal(min(evidence, 709.0)).exp()), rel=1e-9)
    moved = found.at_prevalence(other)
    assert moved.log_likelihood_ratio == pytest.approx(evidence, abs=1e-9)
    assert moved.probability == pytest.approx(told(other), rel=1e-9)


def test_an_estimate_is_read_with_the_prior_that_it_names() -> None:
    assert presence(_estimate()).likelihood_ratio == pytest.approx(4.0)
    assert presence(_estimate(provenance={"prior": {"presence": 0.2}})).likelihood_ratio == pytest.approx(16.0)
    assert presence(_estimate(provenance={}), prior=0.2).likelihood_ratio == pytest.approx(16.0)
    doubted = _estimate(trusted=False, flags=("no_inclusion", "model_does_not_fit", "no_reference"))
    assert presence(doubted).caveats == ("model_does_not_fit",)


@pytest.mark.parametrize(
    ("estimate", "prior", "said"),
    [
        (_estimate(presence=None), None, "must hold the probability of an inclusion"),
        (_estimate(provenance={}), None, "prior must be given"),
        (_estimate(provenance={"prior": "half"}), None, "prior must be given"),
        (_estimate(), 0.3, "prior must be that of the estimate, 0.5"),
        (_estimate(provenance={}), 0.0, "prior must lie in"),
        ("an estimate", None, "estimate must be a Estimate"),
    ],
)
def test_estimates_without_it_are_refused(estimate: Any, prior: float | None, said: str) -> None:
    with pytest.raises(InputError, match=said):
        presence(estimate, prior=prior)


@pytest.mark.parametrize("prevalence", [0.0, 1.0, np.nan, -0.1, "half"])
def test_a_prevalence_is_a_share(prevalence: Any) -> None:
    with pytest.raises(InputError, match="prevalence must"):
        PresenceProbability(probability=0.5, prior=0.5).at_prevalence(prevalence)

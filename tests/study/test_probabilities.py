"""Probabilities beside scikit-learn's scores and bins, statsmodels' logistic regression, and Bayes' rule."""

from __future__ import annotations

import math
import sys
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import statsmodels.api as sm
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit, logit
from sklearn.calibration import calibration_curve
from sklearn.metrics import brier_score_loss

from tsis.errors import InputError, MissingExtraError
from tsis.model.estimate import Estimate
from tsis.study.probabilities import (
    PresenceProbability,
    brier_interval,
    brier_score,
    presence,
    recalibration,
    reliability_curve,
)

Study = tuple[np.ndarray, np.ndarray]
told = st.lists(st.tuples(st.sampled_from(np.linspace(0, 1, 9).tolist()), st.booleans()), min_size=1, max_size=50)


def _drawn(seed: int, size: int = 400, slope: float = 1.0) -> Study:
    """Targets whose inclusions are drawn with logits ``slope`` times those that are said."""
    rng = np.random.default_rng(seed)
    logits = rng.normal(size=size) * 2
    return expit(logits), rng.random(size) < expit(slope * logits)


@given(told, st.integers(1, 12), st.sampled_from(["equal-count", "equal-width"]))
def test_murphys_parts_add_up(pairs: list[tuple[float, bool]], bins: int, widths: str) -> None:
    said, present = np.array([one for one, _ in pairs]), np.array([one for _, one in pairs])
    peer = np.mean((said - present) ** 2)
    for parts in (
        brier_score(said, present),
        reliability_curve(said, present, bins=bins, widths=widths).brier,
    ):
        assert parts.score == pytest.approx(peer, abs=1e-12)
        total = parts.reliability - parts.resolution + parts.uncertainty + parts.within
        assert total == pytest.approx(parts.score, abs=1e-12)
        assert min(parts.reliability, parts.resolution, parts.uncertainty) >= 0
    assert brier_score(said, present).within == pytest.approx(0, abs=1e-12)


def test_the_score_is_scikit_learns() -> None:
    said, present = _drawn(1)
    assert brier_score(said, present).score == pytest.approx(brier_score_loss(present, said), abs=1e-12)


@pytest.mark.parametrize(("widths", "strategy"), [("equal-count", "quantile"), ("equal-width", "uniform")])
@pytest.mark.parametrize(
    "bins", [1, 5, 11]
)  # no quantile of 400 values is one of them, which rounding would put on either side
def test_curves_are_those_of_scikit_learn(widths: str, strategy: str, bins: int) -> None:
    said, present = _drawn(2)
    curve = reliability_curve(said, present, bins=bins, widths=widths)
    seen, mean = calibration_curve(present, said, n_bins=bins, strategy=strategy)
    assert [one.observed.value for one in curve.bins] == pytest.approx(list(seen), abs=1e-12)
    assert [one.probability for one in curve.bins] == pytest.approx(list(mean), abs=1e-12)
    assert sum(one.observed.trials for one in curve.bins) == len(said)
    for one in curve.bins:
        assert one.low <= one.probability <= one.high
        assert one.observed.interval().method == "wilson"


@given(told, st.integers(1, 12))
def test_equal_probabilities_stay_together(pairs: list[tuple[float, bool]], bins: int) -> None:
    said, present = np.array([one for one, _ in pairs]), np.array([one for _, one in pairs])
    curve = reliability_curve(said, present, bins=bins)
    assert len(curve.bins) <= len(set(said.tolist()))
    assert sum(one.observed.successes for one in curve.bins) == present.sum()
    assert 0 <= curve.expected_calibration_error <= 1


def test_the_calibration_error_by_hand() -> None:
    curve = reliability_curve([0.2, 0.2, 0.2, 0.9], [True, False, True, True], bins=2, widths="equal-width")
    assert curve.expected_calibration_error == pytest.approx((3 * abs(0.2 - 2 / 3) + 0.1) / 4)
    assert reliability_curve([0.0, 1.0], [False, True]).expected_calibration_error == 0.0


@pytest.mark.parametrize("seed", range(4))
def test_recalibration_is_that_of_statsmodels(seed: int) -> None:
    said, present = _drawn(seed, size=60 + 200 * seed, slope=0.6)
    found = recalibration(said, present)
    peer = sm.Logit(present.astype(float), sm.add_constant(logit(said))).fit(disp=0, tol=1e-12)
    for index, fitted in enumerate((found.intercept, found.slope)):
        assert fitted.value == pytest.approx(peer.params[index], abs=1e-8)
        assert fitted.standard_error == pytest.approx(peer.bse[index], rel=1e-6)
        assert list(fitted.interval(0.9)) == pytest.approx(list(peer.conf_int(0.1)[index]), abs=1e-6)
    binomial = sm.families.Binomial()
    large = sm.GLM(present.astype(float), np.ones(len(said)), binomial, offset=logit(said)).fit(tol=1e-12)
    assert found.in_the_large.value == pytest.approx(large.params[0], abs=1e-8)
    assert found.in_the_large.standard_error == pytest.approx(large.bse[0], rel=1e-6)


def test_a_slope_is_found_again_as_often_as_said() -> None:
    held = np.zeros(2)
    for seed in range(300):
        found = recalibration(*_drawn(seed, size=200, slope=0.7))
        held += [found.slope.interval(0.9).holds(0.7), found.intercept.interval(0.9).holds(0.0)]
    assert held / 300 == pytest.approx(0.9, abs=0.05)


@given(st.integers(0, 2**32))
def test_extreme_probabilities_are_recalibrated(seed: int) -> None:
    rng = np.random.default_rng(seed)
    said = np.concatenate([10.0 ** -rng.uniform(1, 300, 10), rng.uniform(0.01, 0.99, 4)])
    order = np.argsort(said)
    present = np.zeros(14, dtype=bool)
    present[order[[2, 6, 12]]] = True  # they overlap
    found = recalibration(said, present)
    for fitted in (found.slope, found.intercept, found.in_the_large):
        assert math.isfinite(fitted.value)
        assert fitted.standard_error > 0
    residual = present - expit(found.intercept.value + found.slope.value * logit(said))
    assert residual.sum() == pytest.approx(0, abs=1e-6)
    assert residual @ logit(said) == pytest.approx(0, abs=1e-6 * np.abs(logit(said)).max())


def test_the_bootstraps_interval_of_the_score_is_that_of_the_central_limit() -> None:
    said, present = _drawn(3, size=2000)
    squares = (said - present) ** 2
    heard: list[tuple[int, int]] = []
    found = brier_interval(
        said, present, rng=np.random.default_rng(1), level=0.9, draws=4000, progress=lambda *at: heard.append(at)
    )
    half = 1.6449 * squares.std() / math.sqrt(2000)
    assert list(found) == pytest.approx([squares.mean() - half, squares.mean() + half], abs=0.1 * half)
    assert found.method == "bootstrap"
    assert heard[-1] == (4000, 4000)


RNG = np.random.default_rng(0)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda: brier_score([0.5, 1.2], [True, False]),
            r"probabilities must lie in \[0, 1\]; got 1.2 among 1",
        ),
        (lambda: brier_score([0.5, math.nan], [True, False]), "probabilities must be finite"),
        (lambda: brier_score([0.5], [True, False]), "probabilities and present must be equally long"),
        (lambda: brier_score([0.5], [1]), "present must hold True and False alone"),
        (lambda: brier_score([], []), "probabilities must not be empty"),
        (lambda: brier_score([0.5, 0.5], [True, False], groups=[1]), "groups must have one number a target"),
        (lambda: brier_interval([0.5, 0.5], [True, False], rng=RNG), "must miss the truth by unequal amounts"),
        (lambda: brier_interval([0.5, 0.4], [True, False], rng=RNG, draws=5), "draws must lie in"),
        (
            lambda: brier_interval([0.5, 0.4], [True, False], rng=1),  # type: ignore[arg-type]
            "rng must be a numpy.random.Generator; got 1",
        ),
        (lambda: reliability_curve([0.5], [True], bins=0), "bins must lie in"),
        (lambda: reliability_curve([0.5], [True], widths="even"), "widths must be one of equal-count, equal-width"),
        (lambda: recalibration([0.5, 0.4], [True, True]), "present must be False for at least 1 target"),
        (lambda: recalibration([0.5, 1.0], [True, False]), "strictly between 0 and 1 for their logits; got 1"),
        (lambda: recalibration([0.4, 0.4], [True, False]), "must not all be equal for a slope"),
        (lambda: recalibration([0.1, 0.4, 0.6], [False, False, True]), "must overlap for a slope"),
        (lambda: recalibration([0.1, 0.4, 0.4], [True, True, False]), "must overlap for a slope"),
    ],
)
def test_bad_probabilities_are_told(call: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        call()


def test_one_class_alone_still_has_a_score() -> None:
    parts = brier_score([0.9, 0.8], [True, True])
    assert parts.score == pytest.approx(0.025)
    assert parts.uncertainty == 0


def test_a_recalibration_names_the_library_that_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "statsmodels.genmod.generalized_linear_model", None)
    with pytest.raises(MissingExtraError, match=r'a recalibration needs statsmodels, .* "tsis\[study\]"'):
        recalibration(*_drawn(1))


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

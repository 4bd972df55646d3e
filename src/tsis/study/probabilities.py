"""Probabilities beside what came true, and the probability of an inclusion from an estimate.

The Brier score, its decomposition by Murphy, the reliability curve, and logistic recalibration after Cox. An estimate
compares inclusions of its prior with tissue without inclusion. Its probability is valid at the prevalence of the prior;
the likelihood ratio does not depend on it, and converts the probability to another prevalence.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.errors import InputError, import_extra
from tsis.inclusion.flags import presence_caveats
from tsis.model.estimate import LARGEST_EVIDENCE, Estimate
from tsis.model.require import require_integer, require_number, require_type
from tsis.study.proportions import LEVEL, Interval, Proportion, both_classes, checked_level, choice, scored
from tsis.study.roc import DRAWS, batches, checked_draws, percentiles

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class BrierScore:
    """Mean square of probability less truth, 0 at best, and its decomposition.

    ``score = reliability - resolution + uncertainty + within``.
    """

    score: float  #: in [0, 1]
    reliability: float  #: mean square of a group's probability less its frequency of inclusions; 0 is best
    resolution: float  #: mean square of a group's frequency less that of all; larger is better
    uncertainty: float  #: score of the frequency of all as the constant probability
    within: float  #: contribution of different probabilities within a group; 0 where groups have equal probabilities


def brier_score(probabilities: ArrayLike, present: ArrayLike, *, groups: ArrayLike | None = None) -> BrierScore:
    """Brier score in Murphy's parts: probabilities in [0, 1] that targets hold an inclusion, and whether they do.

    All arrays have the shape (targets,). ``groups`` has whole numbers, equal within a group; None groups equal
    probabilities, which is of little use where few are equal. Raises `InputError` when a probability lies outside [0,
    1], the truth is not boolean, or the lengths differ.

    Examples
    --------
    >>> parts = brier_score([0.8, 0.8, 0.8, 0.2, 0.2], [True, True, False, False, False])
    >>> round(parts.score, 3), round(parts.reliability, 3), round(parts.resolution, 3), round(parts.uncertainty, 3)
    (0.16, 0.027, 0.107, 0.24)
    """
    values, truth = _probabilities_and_truth(probabilities, present)
    together = values if groups is None else np.asarray(groups)
    if together.shape != values.shape:
        raise InputError(f"groups must have one number a target, {len(values)} in all; got shape {together.shape}")
    group = np.unique(together, return_inverse=True)[1]
    sizes = np.bincount(group)
    mean_probability, observed = (np.bincount(group, weights=item) / sizes for item in (values, truth.astype(float)))
    frequency = float(truth.mean())
    # Stephenson, Coelho and Jolliffe, Weather Forecast. 23 (2008) 752: variance and covariance inside the groups.
    difference = values - mean_probability[group]
    return BrierScore(
        score=float(np.mean((values - truth) ** 2)),
        reliability=float(np.average((mean_probability - observed) ** 2, weights=sizes)),
        resolution=float(np.average((observed - frequency) ** 2, weights=sizes)),
        uncertainty=frequency * (1 - frequency),
        within=float(np.mean(difference**2) - 2 * np.mean(difference * (truth - observed[group]))),
    )


def brier_interval(
    probabilities: ArrayLike,
    present: ArrayLike,
    *,
    rng: np.random.Generator,
    level: float = LEVEL,
    draws: int = DRAWS,
    progress: Callable[[int, int], None] | None = None,
) -> Interval:
    """Bootstrap percentile interval of the `brier_score`; too narrow for few targets.

    ``rng``, ``level``, ``draws`` and ``progress`` are as for `tsis.study.roc.bootstrap_auc`. Raises `InputError` when
    the input is invalid, or all squared errors are equal.
    """
    values, truth = _probabilities_and_truth(probabilities, present)
    checked_level(level)
    draws = checked_draws(rng, draws)
    squares = (values - truth) ** 2
    if np.ptp(squares) == 0:
        raise InputError(
            f"probabilities must miss the truth by unequal amounts for an interval; got {len(squares)} equal squares "
            f"of {squares[0]:g}: add targets"
        )
    drawn = np.empty(draws)
    for start, stop in batches(draws, len(squares), progress):
        picked = rng.multinomial(len(squares), np.full(len(squares), 1 / len(squares)), stop - start)
        drawn[start:stop] = picked @ squares / len(squares)
    return percentiles(drawn, level)


def _probabilities_and_truth(probabilities: ArrayLike, present: ArrayLike) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Checked probabilities and truth, one of each per target."""
    values, truth = scored(probabilities, present, name="probabilities")
    outside = (values < 0) | (values > 1)
    if outside.any():
        raise InputError(
            f"probabilities must lie in [0, 1]; got {values[outside][0]:g} among {np.count_nonzero(outside)} outside: "
            "scores of another kind belong into Roc.of"
        )
    return values, truth


BINS = 10
MOST_BINS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class ReliabilityBin:
    """Targets of similar probability."""

    #: low, high: ends of the bin; a probability at an inner end belongs below it
    low: float
    high: float
    probability: float  #: mean of the stated probabilities
    observed: Proportion  #: proportion of the targets with an inclusion; ``observed.interval()`` is Wilson's


@dataclass(frozen=True, slots=True, kw_only=True)
class ReliabilityCurve:
    """Stated probability and observed frequency in each bin that is not empty."""

    bins: tuple[ReliabilityBin, ...]  #: by rising probability
    brier: BrierScore  #: Brier score with Murphy's parts over these bins

    @property
    def expected_calibration_error(self) -> float:
        """Expected calibration error over all targets; few targets per bin raise it even for correct probabilities."""
        weights = [item.observed.trials for item in self.bins]
        return float(np.average([abs(item.probability - item.observed.value) for item in self.bins], weights=weights))


def reliability_curve(
    probabilities: ArrayLike, present: ArrayLike, *, bins: int = BINS, widths: str = "equal-count"
) -> ReliabilityCurve:
    """Compare probabilities in 1 or more ``bins`` with observed frequencies; the arrays are as for `brier_score`.

    With the ``widths`` ``"equal-count"`` the bins end at quantiles of the probabilities; ``"equal-width"`` divides [0,
    1]. Equal probabilities are in one bin. Raises `InputError` as `brier_score`, or when a choice is unknown.

    Examples
    --------
    >>> curve = reliability_curve([0.1, 0.2, 0.3, 0.7, 0.8, 0.9], [False, False, True, True, True, True], bins=2)
    >>> [(round(one.probability, 2), one.observed.value) for one in curve.bins]
    [(0.2, 0.3333333333333333), (0.8, 1.0)]
    >>> round(curve.expected_calibration_error, 3)
    0.167
    """
    values, truth = _probabilities_and_truth(probabilities, present)
    fractions = np.linspace(0.0, 1.0, require_integer("bins", bins, 1, MOST_BINS) + 1)
    widths = choice("widths", widths, ("equal-count", "equal-width"))
    ends = fractions if widths == "equal-width" else np.quantile(values, fractions)
    bin_of = np.searchsorted(ends[1:-1], values)
    filled = []
    for index in np.unique(bin_of):
        inside = bin_of == index
        observed = Proportion(successes=int(truth[inside].sum()), trials=int(inside.sum()))
        low, high = float(ends[index]), float(ends[index + 1])
        filled.append(ReliabilityBin(low=low, high=high, probability=float(values[inside].mean()), observed=observed))
    return ReliabilityCurve(bins=tuple(filled), brier=brier_score(values, truth, groups=bin_of))


STEPS = 100
TOLERANCE = 1e-10  # of the parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedValue:
    """A maximum-likelihood estimate."""

    value: float  #: the estimate
    standard_error: float  #: from the curvature of the likelihood there

    def interval(self, level: float = LEVEL) -> Interval:
        """Wald's interval; it assumes a normal distribution, and is approximate below some 30 targets of each kind.

        ``level`` is the confidence, in (0, 1); else `InputError` is raised.
        """
        half = float(scipy.special.ndtri(0.5 + checked_level(level) / 2)) * self.standard_error
        return Interval(low=self.value - half, high=self.value + half, level=level, method="wald")


@dataclass(frozen=True, slots=True, kw_only=True)
class Recalibration:
    """``logit(true fraction) = intercept + slope * logit(probability)``."""

    slope: FittedValue  #: 1 for calibrated probabilities; below 1 they are overconfident, above 1 underconfident
    intercept: FittedValue  #: with that slope; 0 for calibrated probabilities
    #: intercept with the slope fixed at 1: positive where inclusions are more frequent than the probabilities
    in_the_large: FittedValue


def recalibration(probabilities: ArrayLike, present: ArrayLike) -> Recalibration:
    """Fit slope and intercept of the logits by maximum likelihood.

    The arrays are as for `brier_score`, with both kinds of targets, and probabilities strictly between 0 and 1 that are
    not all equal. Raises `InputError` when the input is invalid, a class is missing, or the probabilities separate both
    kinds, so that the slope is infinite.

    Examples
    --------
    >>> fitted = recalibration([0.01, 0.1, 0.9, 0.99, 0.9, 0.1], [False, True, True, True, False, False])
    >>> fitted.slope.value < 1  # too bold
    True
    """
    values, truth = _probabilities_and_truth(probabilities, present)
    both_classes(truth, needed_by="a recalibration")
    certain = (values == 0) | (values == 1)
    if certain.any():
        raise InputError(
            f"probabilities must lie strictly between 0 and 1 for their logits; got {np.count_nonzero(certain)} that "
            "do not: a probability from n samples can be counted as (k + 1/2) / (n + 1)"
        )
    logits = scipy.special.logit(values)
    _require_overlap(logits, truth)
    models = import_extra("statsmodels.genmod.generalized_linear_model", feature="a recalibration", extra="study")
    from statsmodels.genmod.families import Binomial

    units = np.array([1.0, np.abs(logits).max()])  # of the columns, which keep the fit well conditioned
    model = models.GLM(truth.astype(float), np.stack([np.ones_like(logits), logits], axis=1) / units, family=Binomial())
    with np.errstate(over="ignore"):  # of a link far from 0, whose probability is 0 all the same
        fitted = model.fit(tol=TOLERANCE, tol_criterion="params", maxiter=STEPS)
    intercept, slope = (
        FittedValue(value=value, standard_error=error)
        for value, error in zip((fitted.params / units).tolist(), (fitted.bse / units).tolist(), strict=True)
    )
    return Recalibration(slope=slope, intercept=intercept, in_the_large=_shift(logits, truth))


def _require_overlap(logits: NDArray[Any], truth: NDArray[np.bool_]) -> None:
    """Albert and Anderson (1984): the maximum exists where no cut separates both kinds, touching or not."""
    if np.ptp(logits) == 0:
        raise InputError("probabilities must not all be equal for a slope; got one value alone: add targets")
    within, without = logits[truth], logits[~truth]
    if within.min() >= without.max() or without.min() >= within.max():
        raise InputError(
            "probabilities of targets with and without an inclusion must overlap for a slope; got two parts that one "
            "cut separates: add targets"
        )


def _shift(logits: NDArray[Any], truth: NDArray[np.bool_]) -> FittedValue:
    """Shift of the logits that makes the expected number of inclusions equal to the observed one.

    Our own, in a bracket: the iteration of statsmodels with an offset diverges for logits of some hundreds.
    """
    observed = int(truth.sum())
    low, high = (
        scipy.special.logit(observed / len(truth)) - logits.max(),
        scipy.special.logit(observed / len(truth)) - logits.min(),
    )

    def excess(shift: float) -> float:
        return float(scipy.special.expit(logits + shift).sum() - observed)

    shift = float(scipy.optimize.brentq(excess, low - 1, high + 1, xtol=1e-13))
    chance = scipy.special.expit(logits + shift)
    return FittedValue(value=shift, standard_error=float(1 / np.sqrt((chance * (1 - chance)).sum())))


PREVALENCE = (1e-9, 1 - 1e-9)  # range
NEAREST_TO_ONE = 2.0**-53  # distance from 1 below which a probability rounds to 1
NEAREST_TO_NONE = 5e-324
LARGEST_EXPONENT = 709.0  # whose exponential does not overflow


@dataclass(frozen=True, slots=True, kw_only=True)
class PresenceProbability:
    """Probability of an inclusion, with its prior and caveats.

    Raises `InputError` when a number is no probability.

    Examples
    --------
    >>> found = PresenceProbability(probability=0.9, prior=0.5)
    >>> round(found.likelihood_ratio, 9)
    9.0
    >>> round(found.at_prevalence(0.01).probability, 4)  # 9 : 99
    0.0833
    """

    probability: float  #: of an inclusion, in [0, 1], at the prevalence ``prior``
    prior: float  #: prior probability of an inclusion, in [1e-9, 1 - 1e-9]
    #: flags of the estimate that its model is not valid: the probability then compares two poor models
    caveats: tuple[str, ...] = ()
    #: natural logarithm of the likelihood ratio before the probability was rounded; None if it was not kept
    evidence: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "probability", require_number("probability", self.probability, 0, 1))
        prior = require_number("prior", self.prior, *PREVALENCE, hint="a fraction of targets")
        object.__setattr__(self, "prior", prior)
        require_type("caveats", self.caveats, tuple)
        if self.evidence is not None:
            require_number("evidence", self.evidence, -LARGEST_EVIDENCE, LARGEST_EVIDENCE)

    @property
    def is_bound(self) -> bool:
        """Whether the probability was rounded to 0 or 1, so that the likelihood ratio is only a bound."""
        return self.evidence is None and self.probability in (0.0, 1.0)

    @property
    def log_odds(self) -> float:
        """Logit of the probability; of a rounded probability that of the nearest number."""
        if self.evidence is not None:
            return self.evidence + float(scipy.special.logit(self.prior))
        return float(scipy.special.logit(np.clip(self.probability, NEAREST_TO_NONE, 1 - NEAREST_TO_ONE)))

    @property
    def log_likelihood_ratio(self) -> float:
        """Natural logarithm of the likelihood ratio of an inclusion over tissue without inclusion."""
        return self.log_odds - float(scipy.special.logit(self.prior))

    @property
    def likelihood_ratio(self) -> float:
        """Factor of the frames on the odds of an inclusion, at most e**709; a bound where `is_bound`."""
        return float(np.exp(np.minimum(self.log_likelihood_ratio, LARGEST_EXPONENT)))

    def at_prevalence(self, prevalence: float) -> PresenceProbability:
        """The probability for the same frames at another prevalence of targets with an inclusion.

        The prevalence lies in [1e-9, 1 - 1e-9]; else `InputError` is raised. The ranges of size, depth and modulus
        remain those of the estimate's prior.
        """
        require_number("prevalence", prevalence, *PREVALENCE, hint="a fraction of targets")
        moved = float(scipy.special.expit(self.log_likelihood_ratio + float(scipy.special.logit(prevalence))))
        # Where the ratio is only a bound, 0 and 1 stay.
        return replace(self, probability=self.probability if self.is_bound else moved, prior=prevalence)


def presence(estimate: Estimate, *, prior: float | None = None) -> PresenceProbability:
    """Probability of an inclusion from a result of `tsis.inclusion.estimate`.

    ``prior`` is the probability of an inclusion that the estimate was made with; by default that of its provenance.
    Raises `InputError` when the estimate has no such probability, or its prior is unknown.

    Examples
    --------
    >>> from tsis.model.estimate import Estimate
    >>> made = Estimate(
    ...     samples={"depth_mm": [5.0, 6.0]}, prior_sd={"depth_mm": 2.3}, presence=0.8,
    ...     provenance={"prior": {"presence": 0.5}},
    ... )
    >>> round(presence(made).at_prevalence(0.2).probability, 9)
    0.5
    """
    require_type("estimate", estimate, Estimate)
    if estimate.presence is None:
        raise InputError(
            "estimate must hold the probability of an inclusion, presence; got None: take one that "
            "tsis.inclusion.estimate made"
        )
    stated = _stated_prior(estimate.provenance)
    if prior is None and stated is None:
        raise InputError(
            "prior must be given where the estimate's provenance names none; got None: give the probability of an "
            "inclusion that it was made with"
        )
    if prior is not None and stated is not None and prior != stated:
        raise InputError(f"prior must be that of the estimate, {stated:g}; got {prior!r:.60}: leave it out")
    return PresenceProbability(
        probability=estimate.presence,
        prior=stated if prior is None else prior,  # type: ignore[arg-type]
        caveats=tuple(flag for flag in estimate.flags if flag in presence_caveats(estimate.flags)),
        evidence=estimate.log_bayes_factor,
    )


def _stated_prior(provenance: Mapping[str, Any]) -> float | None:
    prior = provenance.get("prior")
    value = prior.get("presence") if isinstance(prior, Mapping) else None
    return value if isinstance(value, float) else None

"""Probability of an inclusion from an estimate, and at another prevalence.

An estimate compares inclusions of its prior with tissue without inclusion. Its probability is valid at the prevalence
of the prior; the likelihood ratio does not depend on it, and converts the probability to another prevalence.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.inclusion import presence_caveats
from tsis.model import LARGEST_EVIDENCE, Estimate, require_number, require_type

PREVALENCE = (1e-9, 1 - 1e-9)  # range
NEAREST_TO_ONE = 2.0**-53  # distance from 1 below which a probability rounds to 1
NEAREST_TO_NONE = 5e-324
LARGEST_EXPONENT = 709.0  # whose exponential does not overflow


@dataclass(frozen=True, slots=True, kw_only=True)
class PresenceProbability:
    """Probability of an inclusion, with its prior and caveats.

    Raises `InputError` when a number is no probability.

    Parameters
    ----------
    probability
        Of an inclusion, in [0, 1], at the prevalence ``prior``.
    prior
        Prior probability of an inclusion, in [1e-9, 1 - 1e-9].
    caveats
        Flags of the estimate that its model is not valid: the probability then compares two poor models.
    evidence
        Natural logarithm of the likelihood ratio before the probability was rounded; None if not saved.

    Examples
    --------
    >>> found = PresenceProbability(probability=0.9, prior=0.5)
    >>> round(found.likelihood_ratio, 9)
    9.0
    >>> round(found.at_prevalence(0.01).probability, 4)  # 9 : 99
    0.0833
    """

    probability: float
    prior: float
    caveats: tuple[str, ...] = ()
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
        transformed = float(scipy.special.expit(self.log_likelihood_ratio + float(scipy.special.logit(prevalence))))
        # Where the ratio is only a bound, 0 and 1 stay.
        return replace(self, probability=self.probability if self.is_bound else transformed, prior=prevalence)


def presence(estimate: Estimate, *, prior: float | None = None) -> PresenceProbability:
    """Probability of an inclusion from an estimate.

    Raises `InputError` when the estimate has no such probability, or its prior is unknown.

    Parameters
    ----------
    estimate
        A result of `tsis.inclusion.estimate`.
    prior
        Prior probability of an inclusion of the estimate; by default that of its provenance.

    Examples
    --------
    >>> from tsis.model import Estimate
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
    reported = provenance.get("prior")
    value = reported.get("presence") if isinstance(reported, Mapping) else None
    return value if isinstance(value, float) else None

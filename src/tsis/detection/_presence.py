"""The probability that an inclusion is there, as an estimate says it, and at another prevalence.

An estimate weighs inclusions of its prior against plain tissue. Its probability holds at the share of targets with an
inclusion that the prior states; the likelihood ratio does not depend on that share, and carries it to another one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import expit, logit

from tsis.errors import InputError
from tsis.inclusion import UNTRUSTED_FLAGS
from tsis.model import LARGEST_EVIDENCE, Estimate, require_number, require_type

LEAST_PREVALENCE = 1e-9
NEAREST_TO_ONE = 2.0**-53  # a probability that is nearer to 1 is told as 1
NEAREST_TO_NONE = 5e-324
LARGEST_EXPONENT = 709.0  # beyond it an exponential is no finite number
ABSENCE_FLAG = "no_inclusion"  # distrusts the numbers of an inclusion, not that there is none


@dataclass(frozen=True, slots=True, kw_only=True)
class PresenceProbability:
    """How likely an inclusion is, and what that rests on.

    Parameters
    ----------
    probability
        That there is an inclusion, in [0, 1], at the prevalence ``prior``.
    prior
        Share of targets with an inclusion that was believed before the press, in [1e-9, 1 - 1e-9].
    caveats
        Flags of the estimate that say that its model does not hold; with any of them the probability compares two
        explanations of which neither is good.
    evidence
        Natural logarithm of the likelihood ratio before the probability was rounded; None where nobody kept it.

    Raises
    ------
    InputError
        When a number is no probability.

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
        prior = require_number("prior", self.prior, LEAST_PREVALENCE, 1 - LEAST_PREVALENCE, hint="a share of targets")
        object.__setattr__(self, "prior", prior)
        require_type("caveats", self.caveats, tuple)
        if self.evidence is not None:
            require_number("evidence", self.evidence, -LARGEST_EVIDENCE, LARGEST_EVIDENCE)

    @property
    def is_bound(self) -> bool:
        """Whether the probability was rounded to 0 or 1, so that the likelihood ratio is only known to lie beyond."""
        return self.evidence is None and self.probability in (0.0, 1.0)

    @property
    def log_odds(self) -> float:
        """Natural logarithm of probability over its rest; of a rounded probability that of the nearest below it."""
        if self.evidence is not None:
            return self.evidence + float(logit(self.prior))
        return float(logit(np.clip(self.probability, NEAREST_TO_NONE, 1 - NEAREST_TO_ONE)))

    @property
    def log_likelihood_ratio(self) -> float:
        """Natural logarithm of how much better an inclusion explains the frames than plain tissue does."""
        return self.log_odds - float(logit(self.prior))

    @property
    def likelihood_ratio(self) -> float:
        """By what the frames multiply the odds of an inclusion, at most e**709; a bound where `is_bound`."""
        return float(np.exp(np.minimum(self.log_likelihood_ratio, LARGEST_EXPONENT)))

    def at_prevalence(self, prevalence: float) -> PresenceProbability:
        """The same frames where another share of targets holds an inclusion.

        Sizes, depths and moduli are still those of the estimate's prior: where other inclusions occur, press and
        estimate anew.

        Parameters
        ----------
        prevalence
            Share of targets with an inclusion, in [1e-9, 1 - 1e-9].

        Raises
        ------
        InputError
            When it is no such share.
        """
        require_number("prevalence", prevalence, LEAST_PREVALENCE, 1 - LEAST_PREVALENCE, hint="a share of targets")
        transformed = float(expit(self.log_likelihood_ratio + float(logit(prevalence))))
        if self.is_bound:  # what was certain stays so: the ratio behind it is larger than is known
            transformed = self.probability
        return replace(self, probability=transformed, prior=prevalence)


def presence(estimate: Estimate, *, prior: float | None = None) -> PresenceProbability:
    """Read the probability of an inclusion off an estimate.

    Parameters
    ----------
    estimate
        As `tsis.inclusion.estimate` makes it.
    prior
        Probability of an inclusion that it was made with; by default the one that its provenance names.

    Raises
    ------
    InputError
        When the estimate has no such probability, or nobody says which prior it was made with.

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
    uncertainties = tuple(flag for flag in estimate.flags if flag in UNTRUSTED_FLAGS and flag != ABSENCE_FLAG)
    return PresenceProbability(
        probability=estimate.presence,
        prior=stated if prior is None else prior,  # type: ignore[arg-type]
        caveats=uncertainties,
        evidence=estimate.log_bayes_factor,
    )


def _stated_prior(provenance: Mapping[str, Any]) -> float | None:
    reported = provenance.get("prior")
    value = reported.get("presence") if isinstance(reported, Mapping) else None
    return value if isinstance(value, float) else None

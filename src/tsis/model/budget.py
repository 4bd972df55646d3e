"""Uncertainty budgets in the terms of the GUM (JCGM 100)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import scipy

from tsis.errors import InputError
from tsis.model.require import require_number, require_one_of, require_type

EVALUATIONS = ("A", "B")
COVERAGE = 0.95  # probability of an expanded uncertainty


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyComponent:
    """One source of uncertainty of a quantity.

    Parameters
    ----------
    source
        What is uncertain.
    evaluation
        ``"A"`` by the statistics of repeated observations, ``"B"`` by other means.
    distribution
        Assumed distribution, e.g. ``"normal"``.
    standard_uncertainty
        Standard deviation of the source, not negative, in ``unit``.
    unit
        Unit of the source; ``"1"`` for a pure number or a fraction.
    contribution
        Standard deviation of the quantity by this source alone, in the quantity's unit, not negative.
    """

    source: str
    evaluation: str
    distribution: str
    standard_uncertainty: float
    unit: str
    contribution: float

    def __post_init__(self) -> None:
        for name in ("source", "distribution", "unit"):
            require_type(name, getattr(self, name), str)
        require_one_of("evaluation", self.evaluation, EVALUATIONS)
        require_number("standard_uncertainty", self.standard_uncertainty, 0.0, 1e300)
        require_number("contribution", self.contribution, 0.0, 1e300)

    @property
    def sensitivity(self) -> float:
        """Change of the quantity with the source, without sign; 0 for a source that is known exactly.

        For a source of several independent values, e.g. one a frame, it is the root of the sum of squares.
        """
        return self.contribution / self.standard_uncertainty if self.standard_uncertainty > 0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityBudget:
    """The uncertainty budget of one quantity; its components are independent.

    Parameters
    ----------
    name
        Name of the quantity, e.g. ``"depth_mm"``.
    value, unit
        Its value and unit.
    components
        The sources, one at least.
    degrees_of_freedom
        Effective degrees of freedom, at least 1; infinite for a normal distribution.
    sampled_sd
        Standard deviation by sampling, without linearisation; None where nothing was sampled.

    Examples
    --------
    >>> gauge, line = (
    ...     UncertaintyComponent(
    ...         source=source, evaluation="B", distribution="normal", standard_uncertainty=sd, unit="1",
    ...         contribution=2 * sd,
    ...     )
    ...     for source, sd in (("gauge", 0.03), ("line", 0.04))
    ... )
    >>> force = QuantityBudget(name="force_n", value=2.0, unit="N", components=(gauge, line))
    >>> f"{force.combined:.3f} N, expanded {force.expanded:.3f} N (k = {force.coverage_factor:.2f})"
    '0.100 N, expanded 0.196 N (k = 1.96)'
    """

    name: str
    value: float
    unit: str
    components: tuple[UncertaintyComponent, ...]
    degrees_of_freedom: float = math.inf
    sampled_sd: float | None = None

    def __post_init__(self) -> None:
        for name in ("name", "unit"):
            require_type(name, getattr(self, name), str)
        require_number("value", self.value, -1e300, 1e300)
        if not self.components:
            raise InputError("components must hold at least one source; got none")
        for component in self.components:
            require_type("components", component, UncertaintyComponent)
        if not self.degrees_of_freedom >= 1:
            raise InputError(f"degrees_of_freedom must be at least 1; got {self.degrees_of_freedom!r}")
        if self.sampled_sd is not None:
            require_number("sampled_sd", self.sampled_sd, 0.0, 1e300)

    @property
    def combined(self) -> float:
        """Combined standard uncertainty: the root of the sum of the squared contributions."""
        return math.hypot(*(component.contribution for component in self.components))

    @property
    def coverage_factor(self) -> float:
        """Quantile of Student's t by which the expanded uncertainty covers 95 %."""
        return float(scipy.stats.t.ppf(0.5 + COVERAGE / 2, self.degrees_of_freedom))

    @property
    def expanded(self) -> float:
        """Expanded uncertainty of 95 % coverage: `combined` times `coverage_factor`."""
        return self.coverage_factor * self.combined

    @property
    def departure(self) -> float | None:
        """``sampled_sd`` over `combined`, less 1: how far the linear budget is from the sampled distribution."""
        if self.sampled_sd is None or self.combined == 0:
            return None
        return self.sampled_sd / self.combined - 1

    def fraction(self, component: UncertaintyComponent) -> float:
        """The fraction of the combined variance by one component."""
        return (component.contribution / self.combined) ** 2 if self.combined > 0 else 0.0

"""An estimate: samples of the posterior and their summary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import InputError
from tsis.model._content import ContentValue
from tsis.model._exchange import posterior_for_arviz
from tsis.model._html import summary_html
from tsis.model._require import freeze_mappings, require_array, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray


INTERVAL_LEVEL = 0.9  # default probability of intervals
IMPROBABLE = 1e-4  # p-value of the model below which results say so
NOT_IDENTIFIED = 0.85  # posterior over prior standard deviation from which a parameter is not identified
LARGEST_EVIDENCE = 1e12
LEAST_CHANCE = 1e-99  # smallest printed probability


def probability_bound(chance: float) -> str:
    """The next power of ten above a probability, for messages: the digits of a tiny one mean nothing.

    >>> probability_bound(2.3e-15), probability_bound(0.0)
    ('1e-14', '1e-99')
    """
    return f"1e{np.ceil(np.log10(max(chance, LEAST_CHANCE))):+03.0f}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate(ContentValue):
    """Posterior samples by parameter name, with the standard deviations of the prior.

    Parameters
    ----------
    samples
        Equally weighted posterior samples, name -> shape (n,); the names carry the unit.
    prior_sd
        Prior standard deviation of each parameter.
    cramer_rao_sd
        Least standard deviation of any unbiased estimate of each parameter, all others unknown; infinite where the
        data contain no information, empty where not computed.
    presence
        Probability that an inclusion is present; None where not computed.
    log_bayes_factor
        Natural logarithm of the Bayes factor of presence, unrounded: it ranks targets whose probabilities are near 1.
    identifiability
        A message on which parameters the data identify.
    prior
        A description of the prior.
    trusted
        False where a flag tells that the model does not hold; then no number here should be used.
    flags
        Short names of warnings, e.g. ``"young_kpa_not_identified"``.
    notes
        A message for each flag or parameter.
    provenance
        Version, inputs and calibration of the estimate.

    Examples
    --------
    >>> estimate = Estimate(samples={"depth_mm": [4.0, 5.0, 6.0]}, prior_sd={"depth_mm": 2.0})
    >>> estimate.mean["depth_mm"]
    5.0
    >>> [float(bound) for bound in estimate.interval(0.5)["depth_mm"]]
    [4.5, 5.5]
    """

    samples: Mapping[str, NDArray[np.float64]]
    prior_sd: Mapping[str, float]
    cramer_rao_sd: Mapping[str, float] = field(default_factory=dict)
    presence: float | None = None
    log_bayes_factor: float | None = None
    identifiability: str = ""
    prior: str = ""
    trusted: bool = True
    flags: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("samples", "prior_sd", "cramer_rao_sd", "provenance"):
            require_type(name, getattr(self, name), Mapping)
        for name in ("identifiability", "prior"):
            require_type(name, getattr(self, name), str)
        require_type("trusted", self.trusted, bool)
        require_type("flags", self.flags, tuple)
        require_type("notes", self.notes, tuple)
        samples = {name: require_array(name, values, ndim=1) for name, values in self.samples.items()}
        if set(samples) != set(self.prior_sd):
            raise InputError(
                f"samples and prior_sd must name the same parameters; got {set(samples)} and {set(self.prior_sd)}"
            )
        for name, sd in self.prior_sd.items():
            require_number(f"prior_sd[{name!r}]", sd, 1e-300, 1e300)
        for name, sd in self.cramer_rao_sd.items():
            require_one_of("parameter", name, samples)
            if not isinstance(sd, float) or not sd > 0:
                raise InputError(f"cramer_rao_sd[{name!r}] must be positive; got {sd!r}")
        if self.presence is not None:
            require_number("presence", self.presence, 0.0, 1.0, hint="a probability")
        if self.log_bayes_factor is not None:
            require_number("log_bayes_factor", self.log_bayes_factor, -LARGEST_EVIDENCE, LARGEST_EVIDENCE)
        object.__setattr__(self, "samples", samples)
        freeze_mappings(self, "samples", "prior_sd", "cramer_rao_sd", "provenance")

    @property
    def mean(self) -> dict[str, float]:
        """Posterior mean of each parameter."""
        return {name: float(values.mean()) for name, values in self.samples.items()}

    @property
    def sd(self) -> dict[str, float]:
        """Posterior standard deviation of each parameter."""
        return {name: float(values.std()) for name, values in self.samples.items()}

    @property
    def narrowing(self) -> dict[str, float]:
        """Posterior over prior standard deviation; 1 where the data contain no information."""
        return {name: sd / self.prior_sd[name] for name, sd in self.sd.items()}

    def identified(self, name: str) -> bool:
        """Whether the data identify a parameter, so that its mean is meaningful."""
        return f"{name}_not_identified" not in self.flags

    def interval(self, level: float = INTERVAL_LEVEL) -> dict[str, tuple[float, float]]:
        """Equal-tailed credible interval of each parameter, in the unit of its name.

        ``level`` is its probability, in (0, 1); else `InputError`.
        """
        require_number("level", level, 1e-6, 1.0 - 1e-6)
        tails = (0.5 - level / 2, 0.5 + level / 2)
        bounds = {name: np.quantile(values, tails) for name, values in self.samples.items()}
        return {name: (float(low), float(high)) for name, (low, high) in bounds.items()}

    def to_arviz(self) -> Any:
        """The posterior for ArviZ: an ``InferenceData`` before its release 1, else a ``DataTree``.

        The samples are one chain of the group ``posterior``, each parameter with its unit, the standard deviation of
        its prior, and whether the data identify it. Raises `MissingExtraError` without the extra ``analysis``.
        """
        presence = {"presence": self.presence} if self.trusted and self.presence is not None else {}
        return posterior_for_arviz(
            self.samples,
            variables={
                name: {"units": unit_of(name), "prior_sd": sd, "identified": int(self.identified(name))}
                for name, sd in self.prior_sd.items()
            },
            attributes={
                "notice": RESEARCH_USE_ONLY,
                "inference_library": "tsis",
                "inference_library_version": __version__,
                "prior": self.prior,
                "flags": ", ".join(self.flags),
                **presence,
            },
        )

    def _repr_html_(self) -> str:
        """The means and intervals that are not withheld, and the flags."""
        rows = [(f"{label_of(name)} / {unit_of(name)}", *self._cells(name)) for name in self.prior_sd]
        if self.trusted and self.presence is not None:
            bound = "above 0.999" if self.presence > 0.999 else "below 0.001" if self.presence < 0.001 else ""
            rows.append(("probability of an inclusion", bound or f"{self.presence:.3g}"))
        rows.append(("flags", ", ".join(self.flags) or "none"))
        return summary_html("Estimate", rows, headings=("", "mean", "90 % interval"), result=True)

    def _cells(self, name: str) -> tuple[str, ...]:
        """Mean and interval of a parameter, or the reason for which they are withheld."""
        if not self.trusted:
            return ("not to be trusted",)
        low, high = self.interval()[name]
        return f"{self.mean[name]:.3g}" if self.identified(name) else "not identified", f"{low:.3g} to {high:.3g}"


UNITS = {"_mm": "mm", "_kpa": "kPa", "_n": "N", "_deg": "deg"}  # as UCUM writes them
NO_UNIT = "1"


def unit_of(name: str) -> str:
    """The unit of a quantity in UCUM; ``"1"`` for a pure number.

    Examples
    --------
    >>> unit_of("young_kpa"), unit_of("presence")
    ('kPa', '1')
    """
    return next((unit for ending, unit in UNITS.items() if name.endswith(ending)), NO_UNIT)


def label_of(name: str) -> str:
    """The name of a quantity for people, without its unit.

    Examples
    --------
    >>> label_of("young_kpa"), label_of("depth_mm")
    ("Young's modulus", 'depth')
    """
    ending = next((ending for ending in UNITS if name.endswith(ending)), "")
    bare = name.removesuffix(ending).replace("_", " ")
    return "Young's modulus" if bare == "young" else bare

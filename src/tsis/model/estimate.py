"""An estimate: samples of a posterior, and whether its numbers may be used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import InputError, NotIdentifiedError, UntrustedError
from tsis.model.content import ContentValue
from tsis.model.exchange import posterior_for_arviz, summary_html
from tsis.model.require import freeze_mappings, require_array, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray


INTERVAL_LEVEL = 0.9  # default probability of intervals
Value = TypeVar("Value")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosteriorSamples(ContentValue):
    """Equally weighted samples of a posterior, by the name of the parameter, which carries its unit.

    Its numbers are never withheld: those of an `Estimate` are, where they must not be used.

    Parameters
    ----------
    samples
        Samples of each parameter, shape (n,).
    prior_sd
        Prior standard deviation of each parameter.
    """

    samples: Mapping[str, NDArray[np.float64]]
    prior_sd: Mapping[str, float]

    def __post_init__(self) -> None:
        for name in ("samples", "prior_sd"):
            require_type(name, getattr(self, name), Mapping)
        samples = {name: require_array(name, values, ndim=1) for name, values in self.samples.items()}
        if set(samples) != set(self.prior_sd):
            raise InputError(
                f"samples and prior_sd must name the same parameters; got {set(samples)} and {set(self.prior_sd)}"
            )
        for name, sd in self.prior_sd.items():
            require_number(f"prior_sd[{name!r}]", sd, 1e-300, 1e300)
        object.__setattr__(self, "samples", samples)
        freeze_mappings(self, "samples", "prior_sd")

    @property
    def mean(self) -> dict[str, float]:
        """Mean of each parameter."""
        return {name: float(values.mean()) for name, values in self.samples.items()}

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviation of each parameter."""
        return {name: float(values.std()) for name, values in self.samples.items()}

    @property
    def narrowing(self) -> dict[str, float]:
        """Posterior over prior standard deviation; 1 where the data contain no information."""
        return {name: sd / self.prior_sd[name] for name, sd in self.sd.items()}

    def interval(self, level: float = INTERVAL_LEVEL) -> dict[str, tuple[float, float]]:
        """Equal-tailed credible interval of each parameter, in the unit of its name.

        ``level`` is its probability, in (0, 1); else `InputError`.
        """
        require_number("level", level, 1e-6, 1.0 - 1e-6)
        tails = (0.5 - level / 2, 0.5 + level / 2)
        bounds = {name: np.quantile(values, tails) for name, values in self.samples.items()}
        return {name: (float(low), float(high)) for name, (low, high) in bounds.items()}


class ParameterValues(dict[str, Value]):
    """Values by the name of the parameter; a name without one raises.

    Parameters
    ----------
    values
        The value of each parameter.
    withheld
        Parameters that the data do not identify, whose values are left out.

    Raises
    ------
    NotIdentifiedError
        For a parameter in ``withheld``.
    UnknownNameError
        For a name that is no parameter.
    """

    __slots__ = ("withheld",)

    def __init__(self, values: Mapping[str, Value] = MappingProxyType({}), withheld: Collection[str] = ()) -> None:
        super().__init__({name: value for name, value in values.items() if name not in withheld})
        self.withheld = frozenset(withheld)

    def get(self, name: str, default: Any = None) -> Any:
        """The value; ``default`` for a parameter whose value is withheld."""
        return default if name in self.withheld else self[name]

    def copy(self) -> ParameterValues[Value]:
        """An equal mapping, which withholds the same."""
        return ParameterValues(self, self.withheld)

    def __or__(self, other: Any) -> Any:
        raise TypeError("values of an estimate do not support |, because the result would withhold nothing")

    def __setitem__(self, name: str, value: Value) -> None:
        raise TypeError("values of an estimate do not support item assignment: build another Estimate")

    def __reduce__(self) -> tuple[type[ParameterValues[Value]], tuple[dict[str, Value], frozenset[str]]]:
        return ParameterValues, (dict(self), self.withheld)

    def __missing__(self, name: str) -> Value:
        require_one_of("parameter", name, [*self, *self.withheld])
        raise NotIdentifiedError(
            f"the mean and the standard deviation of {name} must not be used, because the data do not identify {name}: "
            "take its interval or samples"
        )


NOT_TRUSTED = "The numbers of this estimate are not to be trusted, for a reason named below."
ABSENCE_FLAG = "no_inclusion"  # concerns the parameters of an inclusion, not its probability
PRESENCE_FLAGS = ("inclusion_uncertain", ABSENCE_FLAG)
NOT_IDENTIFIED_FLAG = "_not_identified"  # after the name of the parameter
IMPROBABLE = 1e-4  # p-value of the model below which results say so
NOT_IDENTIFIED = 0.85  # posterior over prior standard deviation from which a parameter is not identified
LARGEST_EVIDENCE = 1e12
NEARLY = 1e-3  # probabilities closer than this to 0 or 1 are shown as a bound
LEAST_CHANCE = 1e-99  # smallest printed probability


def probability_bound(chance: float) -> str:
    """The next power of ten above a probability, for messages: the digits of a tiny one mean nothing.

    >>> probability_bound(2.3e-15), probability_bound(0.0)
    ('1e-14', '1e-99')
    """
    return f"1e{np.ceil(np.log10(max(chance, LEAST_CHANCE))):+03.0f}"


def probability_text(value: float) -> str:
    """The text of a probability, never 0 or 1."""
    if value > 1 - NEARLY:
        return f"above {1 - NEARLY:g}"
    return f"below {NEARLY:g}" if value < NEARLY else f"{value:.3g}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, init=False, repr=False)
class Estimate(ContentValue):
    """A posterior whose numbers are withheld where they must not be used.

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
    presence_trusted
        Whether ``presence`` may be used; by default where the estimate is trusted. An estimate that is not trusted has
        a presence to trust only under the flag ``"no_inclusion"``.
    log_bayes_factor
        Natural logarithm of the Bayes factor of presence, unrounded: it ranks targets whose probabilities are near 1.
    identifiability
        A message on which parameters the data identify.
    prior
        A description of the prior.
    trusted
        False where a flag tells that the model does not hold; then the numbers are withheld.
    flags
        Short names of warnings, e.g. ``"young_kpa_not_identified"``.
    notes
        A message for each flag or parameter.
    provenance
        Version, inputs and calibration of the estimate.
    untrusted
        The posterior whose numbers are never withheld, instead of ``samples`` and ``prior_sd``.

    Raises
    ------
    UntrustedError
        By `mean`, `sd`, `interval`, `samples` and `narrowing` of an estimate that is not trusted.
    NotIdentifiedError
        By `mean` and `sd` of a parameter that the data do not identify.
    UnknownNameError
        By any of them for a name that is no parameter.

    Examples
    --------
    >>> estimate = Estimate(samples={"depth_mm": [4.0, 5.0, 6.0]}, prior_sd={"depth_mm": 2.0})
    >>> estimate.mean["depth_mm"]
    5.0
    >>> [float(bound) for bound in estimate.interval(0.5)["depth_mm"]]
    [4.5, 5.5]
    """

    untrusted: PosteriorSamples
    cramer_rao_sd: Mapping[str, float]
    presence: float | None
    presence_trusted: bool
    log_bayes_factor: float | None
    identifiability: str
    prior: str
    trusted: bool
    flags: tuple[str, ...]
    notes: tuple[str, ...]
    provenance: Mapping[str, Any]

    def __init__(
        self,
        *,
        samples: Mapping[str, Any] | None = None,
        prior_sd: Mapping[str, float] | None = None,
        cramer_rao_sd: Mapping[str, float] = MappingProxyType({}),
        presence: float | None = None,
        presence_trusted: bool | None = None,
        log_bayes_factor: float | None = None,
        identifiability: str = "",
        prior: str = "",
        trusted: bool = True,
        flags: tuple[str, ...] = (),
        notes: tuple[str, ...] = (),
        provenance: Mapping[str, Any] = MappingProxyType({}),
        untrusted: PosteriorSamples | None = None,
    ) -> None:
        if untrusted is not None:
            require_type("untrusted", untrusted, PosteriorSamples)
            samples = untrusted.samples if samples is None else samples
            prior_sd = untrusted.prior_sd if prior_sd is None else prior_sd
        if samples is None or prior_sd is None:
            raise InputError("samples and prior_sd must be mappings; got None: give both, or untrusted")
        values = {
            "untrusted": PosteriorSamples(samples=samples, prior_sd=prior_sd),
            "cramer_rao_sd": cramer_rao_sd,
            "presence": presence,
            "presence_trusted": _presence_trusted(presence_trusted, trusted, flags),
            "log_bayes_factor": log_bayes_factor,
            "identifiability": identifiability,
            "prior": prior,
            "trusted": trusted,
            "flags": flags,
            "notes": notes,
            "provenance": provenance,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)
        self._check()
        freeze_mappings(self, "cramer_rao_sd", "provenance")

    def _check(self) -> None:
        for name in ("cramer_rao_sd", "provenance"):
            require_type(name, getattr(self, name), Mapping)
        for name in ("identifiability", "prior"):
            require_type(name, getattr(self, name), str)
        for name in ("trusted", "presence_trusted"):
            require_type(name, getattr(self, name), bool)
        require_type("flags", self.flags, tuple)
        require_type("notes", self.notes, tuple)
        for name, sd in self.cramer_rao_sd.items():
            require_one_of("parameter", name, self.names)
            if not isinstance(sd, float) or not sd > 0:
                raise InputError(f"cramer_rao_sd[{name!r}] must be positive; got {sd!r}")
        if self.presence is not None:
            require_number("presence", self.presence, 0.0, 1.0, hint="a probability")
        if self.log_bayes_factor is not None:
            require_number("log_bayes_factor", self.log_bayes_factor, -LARGEST_EVIDENCE, LARGEST_EVIDENCE)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(self.untrusted.samples)

    @property
    def prior_sd(self) -> Mapping[str, float]:
        """Prior standard deviation of each parameter."""
        return self.untrusted.prior_sd

    @property
    def samples(self) -> Mapping[str, NDArray[np.float64]]:
        """Equally weighted posterior samples of each parameter, shape (n,)."""
        return ParameterValues(self._trusted_posterior().samples)

    @property
    def mean(self) -> Mapping[str, float]:
        """Posterior mean of each parameter that the data identify."""
        return ParameterValues(self._trusted_posterior().mean, self._not_identified())

    @property
    def sd(self) -> Mapping[str, float]:
        """Posterior standard deviation of each parameter that the data identify."""
        return ParameterValues(self._trusted_posterior().sd, self._not_identified())

    @property
    def narrowing(self) -> dict[str, float]:
        """Posterior over prior standard deviation; 1 where the data contain no information."""
        return ParameterValues(self._trusted_posterior().narrowing)

    def interval(self, level: float = INTERVAL_LEVEL) -> dict[str, tuple[float, float]]:
        """Equal-tailed credible interval of each parameter, in the unit of its name.

        ``level`` is its probability, in (0, 1); else `InputError`.
        """
        return ParameterValues(self._trusted_posterior().interval(level))

    def identified(self, name: str) -> bool:
        """Whether the data identify a parameter, so that its mean is meaningful."""
        require_one_of("parameter", name, self.names)
        return f"{name}{NOT_IDENTIFIED_FLAG}" not in self.flags

    def withheld_reason(self, name: str) -> str:
        """Why the mean of a parameter is withheld; empty where it is not."""
        identified = self.identified(name)
        if not self.trusted:
            return "not to be trusted"
        return "" if identified else "not identified"

    @property
    def printed_notes(self) -> tuple[str, ...]:
        """The notes; of an untrusted estimate those without withheld numbers."""
        if self.trusted:
            return self.notes
        if len(self.notes) != len(self.flags):
            return ()
        # earlier versions wrote the presence into their notes
        withheld = () if self.presence_trusted else PRESENCE_FLAGS
        pairs = zip(self.flags, self.notes, strict=True)
        return tuple(note for flag, note in pairs if not (flag.endswith(NOT_IDENTIFIED_FLAG) or flag in withheld))

    @property
    def printed_identifiability(self) -> str:
        """The message on which parameters the data identify; of an untrusted estimate that its numbers are withheld."""
        return self.identifiability if self.trusted else NOT_TRUSTED

    @property
    def printed_presence(self) -> float | None:
        """The probability of an inclusion; None where it is unknown or not to be trusted."""
        return self.presence if self.presence_trusted else None

    def __repr__(self) -> str:
        if not self.trusted:
            return f"Estimate(not trusted: {', '.join(self.flags) or 'no flag'}; of {', '.join(self.names)})"
        intervals = (f"{name}={low:.3g}..{high:.3g}" for name, (low, high) in self.interval().items())
        return f"Estimate(90 %: {', '.join(intervals)}; flags: {', '.join(self.flags) or 'none'})"

    def _not_identified(self) -> list[str]:
        return [name for name in self.names if not self.identified(name)]

    def _trusted_posterior(self) -> PosteriorSamples:
        if self.trusted:
            return self.untrusted
        flags = ", ".join(self.flags) or "no flag"
        parts = (
            f"this estimate must not be used, because it is not trusted ({flags}).",
            *self.printed_notes,
            "Its attribute untrusted gives the numbers all the same.",
        )
        raise UntrustedError(" ".join(parts))

    def to_arviz(self) -> Any:
        """The posterior for ArviZ: an ``InferenceData`` before its release 1, else a ``DataTree``.

        The samples are one chain of the group ``posterior``, each parameter with its unit, the standard deviation of
        its prior, and whether the data identify it. Raises `MissingExtraError` without the extra ``analysis``.
        """
        presence = {} if self.printed_presence is None else {"presence": self.printed_presence}
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
        if self.printed_presence is not None:
            rows.append(("probability of an inclusion", probability_text(self.printed_presence)))
        rows.append(("flags", ", ".join(self.flags) or "none"))
        return summary_html("Estimate", rows, headings=("", "mean", "90 % interval"), result=True)

    def _cells(self, name: str) -> tuple[str, ...]:
        """Mean and interval of a parameter, or the reason for which they are withheld."""
        withheld = self.withheld_reason(name)
        if not self.trusted:
            return (withheld,)
        low, high = self.interval()[name]
        return withheld or f"{self.mean[name]:.3g}", f"{low:.3g} to {high:.3g}"


def _presence_trusted(stated: bool | None, trusted: bool, flags: tuple[str, ...]) -> bool:
    """Whether a presence may be used; an untrusted estimate without the flag of absence never has one."""
    if stated is None or not (trusted or ABSENCE_FLAG in flags):
        return trusted
    return stated


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

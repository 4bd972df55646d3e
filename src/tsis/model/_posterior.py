"""Samples of a posterior and their summary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tsis.errors import InputError, NotIdentifiedError
from tsis.model._content import ContentValue
from tsis.model._require import freeze_mappings, require_array, require_number, require_one_of, require_type

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

"""How a material's stress fades while its strain is held."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.model.check import require_array, require_number
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Relaxation:
    """A Prony series of the modulus; one term is the standard linear solid.

    The modulus falls from ``young_kpa / (1 - sum(shares))`` at once to ``young_kpa``, the settled one that a phantom
    states, as ``E(t) = E(0) * (1 - sum(share * (1 - exp(-t / time))))``. Poisson's ratio stays.

    Parameters
    ----------
    shares
        Share of the instantaneous modulus that each term loses, each in (0, 1), together at most 0.99.
    times_s
        Time constant of each term, s, in [1e-4, 1e6], all different.

    Raises
    ------
    InputError
        When a value lies outside its range or the two do not belong together.

    Examples
    --------
    >>> tissue = Relaxation(shares=(0.3,), times_s=(2.0,))
    >>> f"{float(tissue.modulus_ratio(2.0)):.4f}"
    '1.1577'
    """

    shares: tuple[float, ...]
    times_s: tuple[float, ...]

    def __post_init__(self) -> None:
        shares, times = (
            require_array("shares", self.shares, ndim=1),
            require_array("times_s", self.times_s, ndim=1),
        )
        if shares.shape != times.shape:
            raise InputError(f"shares and times_s must have one value a term; got {shares.size} and {times.size}")
        for share in shares.tolist():
            require_number("shares", share, 1e-6, 0.99, hint="shares of the instantaneous modulus")
        for time in times.tolist():
            require_number("times_s", time, 1e-4, 1e6, hint="seconds")
        if shares.sum() > 0.99:
            raise InputError(f"shares must add up to at most 0.99, or nothing is left; got {shares.sum():g}")
        if len(set(times.tolist())) < times.size:
            raise InputError(f"times_s must all differ; got {self.times_s!r}; add the shares of equal ones")
        object.__setattr__(self, "shares", tuple(shares.tolist()))
        object.__setattr__(self, "times_s", tuple(times.tolist()))

    @property
    def instantaneous_ratio(self) -> float:
        """Instantaneous over settled modulus, > 1."""
        return 1 / (1 - sum(self.shares))

    def modulus_ratio(self, time_s: Any) -> NDArray[np.float64]:
        """Modulus at ``time_s`` after a step of strain, over the settled one."""
        faded = 1 - np.exp(-np.asarray(time_s, dtype=float)[..., None] / np.array(self.times_s))
        return np.asarray(self.instantaneous_ratio * (1 - faded @ np.array(self.shares)))

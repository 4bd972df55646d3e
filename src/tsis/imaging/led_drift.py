"""How the lamps' light drifts from frame to frame: they warm up, and wander slowly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.model.check import require_array, require_number
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

SECONDS_PER_HOUR = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LedDrift:
    """Drift of the light: ``(1 + warm_up exp(-t / tau)) exp(wander W(t))``, where W is a random walk of 1 an hour.

    Lamps are brightest when cold, so the light settles from above. The defaults are of the size of small white lamps at
    constant current; they are assumed, not measured.

    Parameters
    ----------
    warm_up
        How much brighter the lamps are when switched on than when warm, a share, in [0, 1].
    warm_up_s
        Time constant tau of warming up, s, in [1e-3, 1e5].
    wander
        Relative standard deviation of the random walk after an hour, in [0, 0.5].

    Raises
    ------
    InputError
        When a value lies outside its range.
    """

    warm_up: float = 0.05
    warm_up_s: float = 300.0
    wander: float = 0.005

    def __post_init__(self) -> None:
        require_number("warm_up", self.warm_up, 0.0, 1.0, hint="a share of one")
        require_number("warm_up_s", self.warm_up_s, 1e-3, 1e5, hint="seconds")
        require_number("wander", self.wander, 0.0, 0.5, hint="a share of one")

    def factors(self, time_s: ArrayLike, rng: np.random.Generator) -> NDArray[np.float64]:
        """Factors of the light at times in seconds after switching on, (n,), ascending and not negative.

        Multiply a frame's light by its factor before exposing it.

        Examples
        --------
        >>> LedDrift(wander=0.0).factors([0.0, 300.0, 3000.0], np.random.default_rng(1)).round(4).tolist()
        [1.05, 1.0184, 1.0]
        """
        time = require_array("time_s", time_s, ndim=1)
        if time[0] < 0 or (np.diff(time) < 0).any():
            raise InputError(f"time_s must ascend from 0 or later; got {time!r:.80}")
        steps = np.sqrt(np.diff(time, prepend=0.0) / SECONDS_PER_HOUR) * rng.standard_normal(len(time))
        return np.asarray((1 + self.warm_up * np.exp(-time / self.warm_up_s)) * np.exp(self.wander * np.cumsum(steps)))

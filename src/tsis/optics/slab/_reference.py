"""A slow, readable reference of the guided modes, close to the dissertation's notation.

One angle theta, ``tan(theta) = u / v``, is propagated from below to above, and each mode is found by bisection.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


def effective_indices(
    index: Sequence[float],
    thickness_um: Sequence[float],
    *,
    wavelength_um: float,
    index_below: float = 1.0,
    index_above: float = 1.0,
    polarization: str = "TE",
) -> list[float]:
    """Effective indices of all guided modes, descending; parameters as of `tsis.optics.guided_modes`, unchecked.

    Examples
    --------
    >>> [round(n, 6) for n in effective_indices([1.5], [0.5], wavelength_um=0.55)]
    [1.441051, 1.259717, 1.001429]
    """
    regions = [index_below, *index, index_above]
    lengths = [2 * math.pi / wavelength_um * part for part in thickness_um]
    weights = [1.0 if polarization == "TE" else n**2 for n in regions]

    def modes_above(n_eff: float) -> int:
        """Whole multiples of pi of the angle beyond the angle of the solution that decays above."""
        q = [n**2 - n_eff**2 for n in regions]
        theta = math.atan2(weights[0], _rate(q[0]))
        for region, length in enumerate(lengths, start=1):
            theta = _through(theta, q[region], weights[region], length)
        decaying = math.pi - math.atan2(weights[-1], _rate(q[-1]))
        return max(0, math.ceil((theta - decaying) / math.pi))

    low, high = max(index_below, index_above), max(regions)
    return [_bisect(modes_above, mode, low, high) for mode in range(modes_above(low))]


def _through(theta: float, q: float, weight: float, length: float) -> float:
    """The angle behind a layer, where u = sin and v = cos of it up to a factor."""
    rate = _rate(q)
    if rate * length < 1e-12:  # a straight line
        return _stretched(theta, 1.0, weight * length)
    own = _stretched(theta, rate / weight, 0.0)  # the angle of (u, v p / rate)
    if q > 0:
        return _stretched(own + rate * length, weight / rate, 0.0)
    half_turns = math.floor(own / math.pi)
    rising = math.sin(own - half_turns * math.pi) + math.cos(own - half_turns * math.pi)
    falling = math.sin(own - half_turns * math.pi) - math.cos(own - half_turns * math.pi)
    falling *= math.exp(-2 * rate * length)
    out = math.atan2(rising + falling, rising - falling) % (2 * math.pi)  # it passes at most one zero
    return _stretched(out + half_turns * math.pi, weight / rate, 0.0)


def _stretched(theta: float, factor: float, shift: float) -> float:
    """The angle when u becomes ``factor u + shift v``, in the same half-turn or, by the shift, a later one."""
    half_turns = math.floor(theta / math.pi)
    u, v = math.sin(theta - half_turns * math.pi), math.cos(theta - half_turns * math.pi)
    return math.atan2(factor * u + shift * v, v) % (2 * math.pi) + half_turns * math.pi


def _rate(q: float) -> float:
    return math.sqrt(abs(q))


def _bisect(modes_above: Callable[[float], int], mode: int, low: float, high: float) -> float:
    while low < (middle := (low + high) / 2) < high:
        if modes_above(middle) > mode:
            low = middle
        else:
            high = middle
    return low

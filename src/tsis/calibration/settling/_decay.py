"""The fading part of a series, for any set of time constants.

The series is ``y(t) = level + sum of a_k exp(-t / tau_k)`` plus noise, a Prony series with amplitudes of one sign:
relaxation falls, creep rises. The time constants lie on a dense grid up to the longest assumed one; the fit selects
two or three of them. The profile of the sum of squares bounds the part still to fade: the greatest and the least value
that fit hardly worse than the best. A plateau shorter than the longest time constant therefore leaves a wide
interval. The fit uses no prior of the amplitudes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

if TYPE_CHECKING:
    from numpy.typing import NDArray


PER_DECADE = 24  # time constants: two neighbours reproduce any value between them to 1e-4 of the amplitude
EVERY = 3  # every third spans all the others, with amplitudes of either sign
STIFF = 1e3  # over the noise of the mean: weight of the constraint on the fading part in the profile
SIGNS = (1.0, -1.0)
STEPS = 10  # of the bisections


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Decay:
    """The best fit of a fading series, and the interval of the part still to fade at its end."""

    tau_s: NDArray[np.float64]  # time constants, shape (k,)
    amplitude: NDArray[np.float64]  # at the last value, shape (k,), of one sign
    level: float  # final level of the series
    low: float  # end of the interval of the sum of those amplitudes
    high: float

    def fading(self, after_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """The part still to fade at times after the end, shape (t,)."""
        return np.asarray(np.exp(-after_s[:, None] / self.tau_s) @ self.amplitude)


class DecayFit:
    """The fit at given ascending times for any noise, from projections of the exponentials on the series."""

    def __init__(
        self, time_s: NDArray[np.float64], value: NDArray[np.float64], *, tau_range_s: tuple[float, float]
    ) -> None:
        count = 2 + int(np.ceil(PER_DECADE * np.log10(tau_range_s[1] / tau_range_s[0])))
        self.tau_s = np.geomspace(*tau_range_s, count)
        # Amplitudes count from the start, where no exponential exceeds 1.
        basis = np.exp(-(time_s - time_s[0])[:, None] / self.tau_s)
        self._at_end = basis[-1]
        self._means, self._middle = basis.mean(axis=0), float(value.mean())
        basis = basis - self._means  # the level is free
        # The few directions that every third exponential spans contain all the information.
        orthogonal = np.linalg.qr(basis[:, ::EVERY])[0]
        free = orthogonal.T @ basis
        constrained = np.vstack([free, STIFF * self._at_end])
        # By sign of the amplitudes and whether the fading part is constrained; the solver uses them some dozen times.
        self._matrices = {
            (sign, fixed): sign * part for sign in SIGNS for fixed, part in ((False, free), (True, constrained))
        }
        self._observed = orthogonal.T @ (value - self._middle)
        self._rest = max(float(np.square(value - self._middle).sum() - np.square(self._observed).sum()), 0.0)

    def best(self) -> tuple[float, float]:
        """Sign of the amplitudes that fits better, and its sum of squared residuals."""
        misfits = {sign: self._solved(sign)[1] for sign in SIGNS}
        sign = min(misfits, key=lambda item: misfits[item])
        return sign, misfits[sign]

    def decay(self, noise: float, *, deviations: float) -> Decay:
        """The fit with the interval of ``deviations`` standard deviations for values of that ``noise``."""
        sign, least = self.best()
        amplitude = self._solved(sign)[0]
        now = float(self._at_end @ amplitude)
        allowed = least + (deviations * noise) ** 2
        ends = [self._end_of(side, sign, now, allowed, noise) for side in (-1.0, 1.0)]
        return Decay(
            tau_s=self.tau_s,
            amplitude=self._at_end * amplitude,
            level=self._middle - float(self._means @ amplitude),
            low=ends[0],
            high=ends[1],
        )

    def _end_of(self, side: float, sign: float, now: float, allowed: float, noise: float) -> float:
        """Largest (side 1) or smallest (side -1) allowed sum of amplitudes at the end."""
        if sign != side:  # towards zero: beyond it the other sign continues
            if self._constrained(sign, 0.0) > allowed:
                return self._boundary(sign, now, 0.0, allowed)
            if self._constrained(side, 0.0) > allowed:
                return 0.0
            now = 0.0
        far = now + side * noise
        while self._constrained(side, far) <= allowed and abs(far) < 1e6 * noise:
            far = now + 4.0 * (far - now)
        return self._boundary(side, now, far, allowed)

    def _boundary(self, sign: float, inside: float, outside: float, allowed: float) -> float:
        for _ in range(STEPS):
            middle = (inside + outside) / 2
            fits = self._constrained(sign, middle) <= allowed
            inside, outside = (middle, outside) if fits else (inside, middle)
        return outside

    def _constrained(self, sign: float, fading: float) -> float:
        """Sum of squared residuals with the fading part constrained near a value, the constraint's included."""
        return self._solved(sign, fading=fading)[1]

    def _solved(self, sign: float, *, fading: float | None = None) -> tuple[NDArray[np.float64], float]:
        """Amplitudes of that sign, and the sum of squared residuals."""
        target = self._observed if fading is None else np.append(self._observed, STIFF * fading)
        amplitude, norm = nnls(self._matrices[sign, fading is not None], target, maxiter=50 * len(self.tau_s))
        return sign * amplitude, norm**2 + self._rest

"""Settling of a press: tissue relaxes under the probe, and force and light follow.

A standard linear solid fades with one time constant, a Prony series with several. The tail of the series is fitted by
such a sum with time constants up to the longest assumed one. A press is settled
when its remaining change is below the tolerance with the stated certainty; a plateau that is too short for the longest
time constant, or too noisy, is neither settled nor settling but unknown.

A gauge's display has steps. Their rounding error stays the same while the value stays on one step and does not average
out, so a run of equal values counts as one value, and the remaining change is at least a step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.calibration.measured import MeasuredValue
from tsis.errors import InputError
from tsis.imaging.patch import GAUSSIAN_MAD
from tsis.model.require import require_array, require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


LONGEST_HOLD_S = 100.0  # assumed of soft tissue: the slow term of its relaxation lasts tens of seconds
CERTAINTY = 0.95  # one-sided, of each end of the remaining change
BINS = 128  # longer series are averaged to at most this many values, at equal steps
FEWEST = 16  # values that separate two exponentials from the noise
LEAST_NOISE = 2e-4  # of the value: the accuracy of the grid of time constants
TERMS = 5  # of a fit: level, two amplitudes and two time constants
MISFIT_SD = 3.0  # standard deviations by which a fit may miss its noise
SAME = 1e-9  # of the value: smaller differences are rounding of the arithmetic
CAPPED = 1.0  # largest reported relative change
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
        amplitude, norm = scipy.optimize.nnls(
            self._matrices[sign, fading is not None], target, maxiter=50 * len(self.tau_s)
        )
        return sign * amplitude, norm**2 + self._rest


@dataclass(frozen=True, slots=True, kw_only=True)
class Settling:
    """Whether a press has settled, and the time still to wait.

    Attributes
    ----------
    verdict
        ``"settled"``, ``"settling"``, or ``"cannot tell"`` when the series is too short or too noisy.
    remaining
        Change still to come relative to the present value; negative where it falls.
    bound
        Limit of the remaining relative change, either sign, with probability `CERTAINTY`; at most 1.
    wait_s
        Time from now until the remaining change is below the tolerance, s; 0 when it is, None when unknown.
    """

    verdict: str
    remaining: MeasuredValue
    bound: float
    wait_s: float | None

    @property
    def settled(self) -> bool:
        """True when the verdict is ``"settled"``."""
        return self.verdict == "settled"

    @property
    def text(self) -> str:
        """``"settled"``, ``"moving"``, or the waiting time as ``"wait 4 s"``."""
        if self.settled:
            return "settled"
        return "moving" if self.wait_s is None else f"wait {self.wait_s:.0f} s"


UNKNOWN = Settling(verdict="cannot tell", remaining=MeasuredValue(value=0.0, sd=CAPPED), bound=CAPPED, wait_s=None)


def assess_settling(
    time_s: ArrayLike,
    value: ArrayLike,
    *,
    tolerance: float = 0.01,
    longest_s: float = LONGEST_HOLD_S,
    step: float | None = None,
) -> Settling:
    """Assess from a series of force, sum of grey levels or area whether a press has settled.

    Raises `InputError` when the series holds NaN, times do not ascend or a value lies outside its range.

    Parameters
    ----------
    time_s
        Times, s, shape (n,), strictly ascending, about even.
    value
        The series, shape (n,), of one sign at its end. It may begin before the travel ends: the oldest half is
        dropped until a sum of two exponentials describes the rest to within its noise.
    tolerance
        Remaining change relative to the settled value, in [1e-4, 0.5], below which a press counts as settled.
    longest_s
        Longest assumed time constant, s, in [1e-2, 1e5].
    step
        Smallest step of the values, in their unit, in [0, 1e12], as 0.01 of a gauge that shows 1.23 N. When None, the
        smallest difference between them where some repeat.

    Returns
    -------
    Settling
        The verdict; ``"cannot tell"`` below 16 values, and where all are equal and ``step`` is None, which leaves the
        rounding unknown.

    Examples
    --------
    >>> time = np.arange(0.0, 60.0, 0.1)
    >>> force = 1 + 0.4 * np.exp(-time / 3.0) + 1e-3 * np.random.default_rng(1).standard_normal(time.size)
    >>> assess_settling(time[:60], force[:60]).verdict, assess_settling(time, force).verdict
    ('settling', 'settled')
    """
    require_number("tolerance", tolerance, 1e-4, 0.5, hint="a fraction of the settled value")
    require_number("longest_s", longest_s, 1e-2, 1e5, hint="seconds")
    time, values = require_array("time_s", time_s, ndim=1), require_array("value", value, ndim=1)
    if time.shape != values.shape:
        raise InputError(f"time_s and value must be of one length; got {time.size} and {values.size}")
    if (np.diff(time) <= 0).any():
        at = int(np.argmax(np.diff(time) <= 0))
        raise InputError(f"time_s must ascend; got {time[at]:g} s and then {time[at + 1]:g} s")
    if step is None:
        step = _display_step(values)
    else:
        require_number("step", step, 0.0, 1e12, hint="in the unit of the values")
    if step is None:
        return UNKNOWN
    return assess_history(*_averaged(time, values), tolerance=tolerance, longest_s=longest_s, step=step)


def _display_step(value: NDArray[np.float64]) -> float | None:
    """Smallest difference between values if some repeat; 0 if none does, None if all are equal."""
    difference = np.diff(np.sort(value))
    equal = difference <= SAME * np.abs(value).max()
    if equal.all():
        return None
    return float(difference[~equal].min()) if equal.any() else 0.0


def assess_history(
    time: NDArray[np.float64],
    value: NDArray[np.float64],
    *,
    tolerance: float,
    longest_s: float = LONGEST_HOLD_S,
    step: float | None = None,
) -> Settling:
    """`assess_settling` of a series already checked and averaged to at most `BINS` values."""
    if step is None:
        step = _display_step(value)
    while step is not None and len(time) >= FEWEST:
        if value[-1] * value.mean() <= 0:
            break
        try:
            decay = _described(time, value, longest_s, step)
        except RuntimeError:  # the solver does not converge on this series
            decay = None
        if decay is not None:
            return _verdict(decay, len(time), tolerance, step)
        time, value = (part[len(part) // 2 :] for part in (time, value))
    return UNKNOWN


def _averaged(time: NDArray[np.float64], value: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Means over neighbours that shorten the series to at most `BINS` values; the oldest remainder is dropped."""
    # An exponential averaged over equal steps remains the same exponential up to a factor.
    by = -(-len(time) // BINS)
    first = len(time) % by
    return time[first:].reshape(-1, by).mean(axis=1), value[first:].reshape(-1, by).mean(axis=1)


def _described(time: NDArray[np.float64], value: NDArray[np.float64], longest_s: float, display: float) -> Decay | None:
    """The fit, or None when it misses the series by more than the noise between neighbours."""
    count, size = len(time), float(np.abs(value[len(value) // 2 :]).mean())
    differences = np.diff(value, 2)
    noise = GAUSSIAN_MAD * float(np.median(np.abs(differences))) / np.sqrt(6.0)  # (1 -2 1) has the norm sqrt(6)
    rounding = display / np.sqrt(12.0)  # standard deviation
    noise = max(noise, LEAST_NOISE * size, rounding)
    step = float(time[-1] - time[0]) / (count - 1)
    fit = DecayFit(time, value, tau_range_s=(min(step, longest_s / 2), longest_s))
    missed = fit.best()[1] / (count - TERMS)
    # Sampling variances: of the residual's variance 2 / n, of the robust variance from differences some 8 / n.
    if missed > noise**2 * (1 + MISFIT_SD * np.sqrt(10.0 / count)):
        return None
    quantile = float(scipy.special.stdtrit(count - TERMS, CERTAINTY))
    runs = 1 + int(np.count_nonzero(np.diff(value)))
    noise = max(noise, float(np.sqrt(missed)), rounding * float(np.sqrt(count / runs)))
    return fit.decay(noise, deviations=quantile)


def _verdict(decay: Decay, count: int, tolerance: float, display: float) -> Settling:
    fading = decay.fading(np.zeros(1))[0]
    present = decay.level + fading
    low, high = sorted(min(max(-end / present, -CAPPED), CAPPED) for end in (decay.low, decay.high))
    # A change below one step stays invisible.
    bound = max(-low, high, min(display / abs(present), CAPPED))
    quantile = float(scipy.special.stdtrit(count - TERMS, CERTAINTY))
    change = MeasuredValue(
        value=float(-fading / present), sd=(high - low) / (2 * quantile), degrees_of_freedom=count - TERMS
    )
    if bound <= tolerance:
        return Settling(verdict="settled", remaining=change, bound=bound, wait_s=0.0)
    if low < tolerance and high > -tolerance:
        return Settling(verdict="cannot tell", remaining=change, bound=bound, wait_s=None)
    longest = float(decay.tau_s[-1])
    wait = np.r_[0.0, np.geomspace(1e-3 * longest, 20.0 * longest, 600)]
    below = np.abs(decay.fading(wait)) <= tolerance * abs(decay.level)
    return Settling(verdict="settling", remaining=change, bound=bound, wait_s=float(wait[np.argmax(below)]))

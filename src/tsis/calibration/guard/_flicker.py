"""Flicker of room lamps with the mains, at 100 or 120 Hz."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


LAMPS_HZ = (100.0, 120.0)
FRAMES = 64  # newest frames in the fit: two seconds at 30 frames a second
FEWEST = 16
LEAST_PERIODS = 1.5  # of the alias in the series: a slower oscillation looks like a trend
CONFUSED = 2.0  # variance of the amplitude over that of even sampling; beyond, stalled frames alias trends
SIGNIFICANT = 5.0  # standard deviations of the amplitude; the series is tested at every frame


def flicker_amplitude(time_s: Sequence[float], level: Sequence[float]) -> float | None:
    """Amplitude at the mains' frequencies in a series of levels.

    Frames more than half a period apart alias the flicker to a lower frequency; a fit at the times of the frames
    still gives its amplitude. Where the alias is near zero (100 Hz at 25 or 50 frames a second), every frame has the
    same phase and the amplitude is unknown, None. It is 0 when it does not stand out of the noise.

    Examples
    --------
    >>> time = np.arange(64) / 30.0
    >>> round(flicker_amplitude(time, 8.0 + 0.5 * np.cos(2 * np.pi * 100.0 * time)), 3)
    0.5
    """
    if len(time_s) < FEWEST:
        return None
    time = np.asarray(time_s) - time_s[0]
    values = np.asarray(level, dtype=float)
    amplitudes = [item for item in (_amplitude(time, values, hertz) for hertz in LAMPS_HZ) if item is not None]
    return max(amplitudes) if amplitudes else None


def _amplitude(time: NDArray[np.float64], values: NDArray[np.float64], hertz: float) -> float | None:
    angle = 2 * np.pi * hertz * time
    rate = (len(time) - 1) / time[-1]
    alias = abs((hertz + rate / 2) % rate - rate / 2)
    if alias * time[-1] < LEAST_PERIODS:
        return None
    steady = time / time[-1]
    columns = np.column_stack([np.ones_like(time), steady, steady**2, np.cos(angle), np.sin(angle)])
    weights, _, rank, _ = np.linalg.lstsq(columns, values, rcond=1e-6)
    if rank < columns.shape[1]:
        return None
    inverse = np.linalg.inv(columns.T @ columns)
    spread = float(inverse[3, 3] + inverse[4, 4]) / 2
    if spread * len(time) / 2 > CONFUSED:
        return None
    residuals = values - columns @ weights
    variance = float(residuals @ residuals) / (len(time) - columns.shape[1]) * spread
    amplitude = float(np.hypot(weights[3], weights[4]))
    return amplitude if amplitude > SIGNIFICANT * np.sqrt(variance) else 0.0

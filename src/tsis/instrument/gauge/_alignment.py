"""Noise of force readings, and the force at the time of a frame."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import GaugeError, InputError
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.instrument.gauge._gauge import ForceReading

    Floats = NDArray[np.float64]

_SPAN = 4  # successive readings: one more than the three parameters of a parabola


def reading_noise(times: Floats, forces: Floats) -> tuple[float, float]:
    """Standard deviation of independent noise in readings of a smooth course, and its degrees of freedom.

    One combination of any four successive readings vanishes for every parabola; scaled to length 1 it has the noise's
    standard deviation. Combinations with common readings are correlated, so the degrees of freedom are Satterthwaite's
    for their quadratic form, fewer than the combinations. A course that bends within four readings counts as noise.

    Examples
    --------
    >>> times = np.arange(12.0)
    >>> reading_noise(times, 3 * times**2)[0] < 1e-9
    True
    """
    count = len(times) - _SPAN + 1
    rows = np.arange(count)[:, None] + np.arange(_SPAN)
    difference = times[rows][:, :, None] - times[rows][:, None, :]
    difference[:, np.arange(_SPAN), np.arange(_SPAN)] = 1.0
    weights = 1.0 / difference.prod(axis=2)  # of the third divided difference
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    combinations = np.zeros((count, len(times)))
    np.put_along_axis(combinations, rows, weights, axis=1)
    gram = combinations @ combinations.T
    freedom = count**2 / float(np.sum(gram**2))
    return float(np.sqrt(np.mean((combinations @ forces) ** 2))), freedom


LONGEST_GAP_S = 0.5
LEVEL = 0.95  # probability that the true force lies within error_n
_NEIGHBOURS = 8  # readings for the noise
_LEAST = 4  # readings: a line, its curvature, and one for the noise
# Parabolas smooth the curvature that they measure: for nine readings a period it is up to 1.098 times as large.
_SMOOTHED = 1.1


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceAtTime:
    """The force at a time.

    Parameters
    ----------
    force_n
        In newtons.
    error_n
        Bound of the error relative to the gauge's display without noise, with at least 95 % probability. It excludes
        the gauge's own calibration.
    gap_s
        Time between the two readings around it.
    """

    force_n: float
    error_n: float
    gap_s: float


def force_at(
    readings: Sequence[ForceReading],
    time_s: float,
    *,
    latency_s: float = 0.0,
    time_error_s: float = 0.0,
    longest_gap_s: float = LONGEST_GAP_S,
) -> ForceAtTime:
    """Interpolate the force at a frame's time linearly.

    Parameters
    ----------
    readings
        At least 4 with ascending times.
    time_s
        Time of the frame, on the same clock.
    latency_s
        Delay of the gauge relative to frames: the force is interpolated at ``time_s + latency_s``; `find_latency`
        measures it.
    time_error_s
        Half-width of the uncertainty of ``time_s + latency_s``.
    longest_gap_s
        Longest interval of interpolation.

    Raises
    ------
    InputError
        When an argument is out of its range or the times do not ascend.
    GaugeError
        When there are fewer than 4 readings, the time lies before the first or more than one interval after the
        last one, or in a gap that is too long.

    Examples
    --------
    >>> from tsis.instrument.gauge import ForceReading
    >>> readings = [ForceReading(time_s=0.1 * k, force_n=0.01 * k**2, resolution_n=0.001) for k in range(12)]
    >>> force = force_at(readings, 0.55)
    >>> round(force.force_n, 4), round(force.error_n, 4), round(force.gap_s, 3)
    (0.305, 0.0033, 0.1)

    The true course at 0.55 s is 0.3025 N.
    """
    at_s = require_number("time_s", time_s, -1e12, 1e12) + require_number("latency_s", latency_s, -1e3, 1e3)
    require_number("time_error_s", time_error_s, 0.0, 1e3)
    require_number("longest_gap_s", longest_gap_s, 1e-6, 1e6)
    right = _right(readings, at_s)
    around = readings[max(right - _NEIGHBOURS, 0) : right + _NEIGHBOURS]
    right -= max(right - _NEIGHBOURS, 0)
    times = np.array([reading.time_s for reading in around]) - at_s
    forces = np.array([reading.force_n for reading in around])
    if not (np.diff(times) > 0).all():
        raise InputError("readings must have ascending times; sort them, or select those of one run")
    gap = float(times[right] - times[right - 1])
    if max(gap, -float(times[right])) > longest_gap_s:
        raise GaugeError(
            f"the force readings around {at_s:.3f} s must lie at most {longest_gap_s:g} s apart; got {gap:.3g} s; "
            "raise the gauge's rate, or state a longer longest_gap_s"
        )
    weight = float(-times[right - 1] / gap)
    pair = around[right - 1 : right + 1]
    slope = float(forces[right] - forces[right - 1]) / gap
    curvature = _curvature(times, forces, right)
    sd, freedom = reading_noise(times, forces)
    time_error = time_error_s + max(reading.time_error_s for reading in pair)
    error = (
        curvature * abs(float(times[right - 1] * times[right])) / 2
        + max(reading.resolution_n for reading in pair) / 2
        + (abs(slope) + curvature * gap / 2) * time_error
        + float(scipy.special.stdtrit(freedom, 0.5 + LEVEL / 2)) * sd * float(np.hypot(weight, 1 - weight))
    )
    force = float(forces[right - 1]) + slope * float(-times[right - 1])
    return ForceAtTime(force_n=force, error_n=error, gap_s=gap)


def _right(readings: Sequence[ForceReading], at_s: float) -> int:
    """Index of the reading after the time, or of the last one up to an interval before the time."""
    if len(readings) < _LEAST:
        raise GaugeError(f"at least {_LEAST} force readings are needed around a frame; got {len(readings)}")
    first_s, before_s, last_s = readings[0].time_s, readings[-2].time_s, readings[-1].time_s
    if at_s < first_s:
        raise GaugeError(f"the frame lies {first_s - at_s:.3g} s before the first force reading; start the gauge first")
    if at_s > 2 * last_s - before_s:
        raise GaugeError(
            f"the frame lies {at_s - last_s:.3g} s after the last force reading, more than one interval of "
            f"{last_s - before_s:.3g} s; wait for the gauge, or see whether it was lost"
        )
    return min(bisect_right(readings, at_s, key=lambda reading: reading.time_s), len(readings) - 1)


def _curvature(times: Floats, forces: Floats, right: int) -> float:
    """Bound of the course's second derivative between two readings."""
    slopes = np.diff(forces) / np.diff(times)
    second = 2 * np.diff(slopes) / (times[2:] - times[:-2])
    touching = second[max(right - 2, 0) : right]
    if len(touching) == 2:
        return _SMOOTHED * float(np.abs(touching).max())
    # At an end there is only one parabola; its curvature may continue to change at the same rate.
    inner = second[1] if right == 1 else second[-2]
    return _SMOOTHED * float(abs(touching[0]) + abs(touching[0] - inner))

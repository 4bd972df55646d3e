"""Frame rate as it was, from the times of frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.measured import MeasuredValue
from tsis.model.check import require_array
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

FEWEST = 3


def frame_rate(time_s: ArrayLike) -> MeasuredValue:
    """Frames a second of a stream: intervals over the time between the first and the last frame.

    Parameters
    ----------
    time_s
        Times of the frames on one clock, ascending, shape (n,), n >= 3. Lost frames count as long intervals.

    Returns
    -------
    Measured
        The rate in 1/s; its standard deviation is that of the mean interval.

    Raises
    ------
    InputError
        When there are too few times, or they do not ascend.

    Examples
    --------
    >>> round(frame_rate([0.0, 0.03, 0.07, 0.10]).value, 6)
    30.0
    """
    time = require_array("time_s", time_s, ndim=1)
    if len(time) < FEWEST or (np.diff(time) <= 0).any():
        raise InputError(f"time_s must hold at least {FEWEST} ascending times; got {len(time)} values")
    steps = np.diff(time)
    mean = float(steps.mean())
    error = float(steps.std(ddof=1)) / float(np.sqrt(len(steps)))
    return MeasuredValue(value=1 / mean, sd=error / mean**2, degrees_of_freedom=len(steps) - 1.0, unit="1/s")

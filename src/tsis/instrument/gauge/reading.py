"""One reading of a force gauge."""

from __future__ import annotations

from dataclasses import dataclass

from tsis.model.check import require_number

LARGEST_FORCE_N = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceReading:
    """A force and when it acted.

    Parameters
    ----------
    time_s
        When it acted, in seconds on the host's monotonic clock.
    force_n
        Force in newtons, as the gauge signs it.
    resolution_n
        Step of the gauge's display in newtons, 0 when it is not known.
    time_error_s
        Half-width of the time in which the gauge must have taken the reading, in seconds; 0 when it is not known.

    Raises
    ------
    InputError
        When a number is not finite or out of its range.

    Examples
    --------
    >>> ForceReading(time_s=12.5, force_n=0.8).force_n
    0.8
    """

    time_s: float
    force_n: float
    resolution_n: float = 0.0
    time_error_s: float = 0.0

    def __post_init__(self) -> None:
        require_number("time_s", self.time_s, -1e12, 1e12)
        require_number("force_n", self.force_n, -LARGEST_FORCE_N, LARGEST_FORCE_N)
        require_number("resolution_n", self.resolution_n, 0.0, LARGEST_FORCE_N)
        require_number("time_error_s", self.time_error_s, 0.0, 1e6)

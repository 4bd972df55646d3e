"""Confidence intervals, and checks of inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import InputError
from tsis.model import require_array, require_number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray


LEVEL = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """Confidence interval; ``low, high = interval`` unpacks it.

    Attributes
    ----------
    low, high
        Ends, included; an end may be infinite.
    level
        Probability that such intervals contain the true value, in (0, 1).
    method
        Its method, e.g. ``"wilson"``.

    Examples
    --------
    >>> low, high = Interval(low=0.4, high=0.9, level=0.95, method="wilson")
    >>> low, high
    (0.4, 0.9)
    """

    low: float
    high: float
    level: float
    method: str

    def __iter__(self) -> Iterator[float]:
        return iter((self.low, self.high))

    def holds(self, value: float) -> bool:
        """Whether a value lies in the interval, its ends included."""
        return self.low <= value <= self.high


def checked_level(level: float) -> float:
    """Check a level of confidence."""
    return require_number("level", level, 1e-6, 1 - 1e-9, hint="a probability, such as 0.95")


LARGEST_READING = 1e70  # its fourth power does not overflow
ABSENT = {
    True: "score at least {least} that {hold} an inclusion",
    False: "score at least {least} that {hold} none",
}


def booleans(name: str, value: ArrayLike) -> NDArray[np.bool_]:
    """Return a read-only copy of a row of truth values, not empty.

    Raises `InputError` when it is empty, masked, has more axes than one, or holds anything but True and False.
    """
    if np.ma.is_masked(value):
        raise InputError(f"{name} must not hold masked values; leave those targets out before")
    try:
        result = np.array(value)
    except ValueError as error:
        raise InputError(f"{name} must be one row of True and False; got rows of unequal lengths") from error
    if result.ndim != 1:
        raise InputError(f"{name} must be one row of True and False; got shape {result.shape}")
    if result.size == 0:
        raise InputError(f"{name} must not be empty; give one value a target")
    if result.dtype.kind != "b":
        raise InputError(
            f"{name} must hold True and False alone; got {result.dtype.name} as {result[0]!r:.40}: "
            f"compare first, such as numbers == 1"
        )
    result.flags.writeable = False
    return result


def scored(scores: ArrayLike, present: ArrayLike, *, name: str = "scores") -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Check scores and truth, one of each per target.

    Raises `InputError` when either is empty or no row, a score is not finite, or their lengths differ.
    """
    values = require_array(name, scores, ndim=1)
    truth = booleans("present", present)
    same_length(name, values, "present", truth)
    return values, truth


def same_length(name: str, value: NDArray[Any], other_name: str, other: NDArray[Any]) -> None:
    """Refuse two rows of different lengths."""
    if len(value) != len(other):
        raise InputError(
            f"{name} and {other_name} must be equally long, one value a target; got {len(value)} and {len(other)}"
        )


def both_classes(present: NDArray[np.bool_], *, least: int = 1, needed_by: str) -> tuple[int, int]:
    """Numbers of targets with and without an inclusion, both at least ``least``.

    Raises `InputError` when a class is missing or too small; the message names it.
    """
    inside = int(np.count_nonzero(present))
    results = {True: inside, False: len(present) - inside}
    for value, number in results.items():
        if number < least:
            targets, hold = ("target", "holds") if least == 1 else ("targets", "hold")
            cure = ABSENT[value].format(least=f"{least} {targets}", hold=hold)
            raise InputError(
                f"present must be {value} for at least {least} {targets} for {needed_by}; got {number} "
                f"of {len(present)}: {cure}"
            )
    return inside, len(present) - inside


def readings(name: str, value: ArrayLike, *, ndim: int) -> NDArray[np.float64]:
    """Return a read-only copy of finite readings whose fourth powers are finite too.

    Raises `InputError` when they are empty, of another shape or too large.
    """
    result = require_array(name, value, ndim=ndim)
    largest = float(np.abs(result).max())
    if largest > LARGEST_READING:
        raise InputError(f"{name} must lie within ±{LARGEST_READING:g}; got {largest:g}: choose a larger unit")
    return result


def choice(name: str, value: str, choices: tuple[str, ...]) -> str:
    """Check that a text is among ``choices``."""
    if not isinstance(value, str) or value not in choices:
        raise InputError(f"{name} must be one of {', '.join(choices)}; got {value!r:.60}")
    return value

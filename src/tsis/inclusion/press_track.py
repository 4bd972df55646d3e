"""A sequence of frames of one press: how the light moves, and whether its sum has settled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.settling import LONGEST_HOLD_S, Settling, assess_settling
from tsis.errors import InputError
from tsis.inclusion.mobility import Mobility, mobility
from tsis.model.require import require_array

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressTrack:
    """Analysis of a sequence of frames.

    Attributes
    ----------
    mobility
        Positions, steps, path and excursion of the light.
    settling
        Settling of the sum of grey levels; None without times.
    time_s
        Times of the frames, shape (n,); None where unknown.
    total_grey
        Change of the sum of grey levels, shape (n,).
    """

    mobility: Mobility
    settling: Settling | None
    time_s: NDArray[np.float64] | None
    total_grey: NDArray[np.float64]


def track_press(
    images: Sequence[TactileImage],
    references: Sequence[TactileImage],
    *,
    against: str,
    time_s: ArrayLike | None = None,
    calibration: Calibration | None = None,
    threshold_grey: float | None = None,
    tolerance: float = 0.01,
    longest_s: float = LONGEST_HOLD_S,
    progress: Callable[[int, int], None] | None = None,
) -> PressTrack:
    """Track the light through a sequence, and test whether its sum has settled.

    ``time_s`` has the times of the frames, s, shape (images,), ascending. Other parameters as for
    `tsis.inclusion.mobility.mobility` and `tsis.calibration.settling.assess_settling`.

    Raises
    ------
    InputError, ImageMismatchError
        As these functions; when the numbers of times and frames differ.
    """
    movement = mobility(
        images,
        references,
        against=against,
        calibration=calibration,
        threshold_grey=threshold_grey,
        progress=progress,
    )
    untouched = np.mean([frame.grey for frame in references], axis=0)
    total = np.array([float((frame.grey - untouched).sum()) for frame in images])
    if time_s is None:
        return PressTrack(mobility=movement, settling=None, time_s=None, total_grey=total)
    times = require_array("time_s", time_s, ndim=1)
    if len(times) != len(images):
        raise InputError(f"time_s must hold one time for each of {len(images)} images; got {len(times)}")
    settling = assess_settling(times, total, tolerance=tolerance, longest_s=longest_s)
    return PressTrack(mobility=movement, settling=settling, time_s=times, total_grey=total)

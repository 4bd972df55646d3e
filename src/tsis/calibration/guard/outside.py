"""The level where no press reaches: beyond the face's rim, or the darkest part of the frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from tsis.imaging.patch import NOISE_FACTOR, pixel_noise

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.calibration.guard.reference import Prepared

COARSE = 4  # blocks along the side of what the darkest part is looked for in
LOWEST = 0.05  # share of the frame whose median starts the search
LEAST_SHARE = 0.1  # of the frame: a smaller dark part may be the foot of a contact that fills the frame


@dataclass(frozen=True, slots=True, kw_only=True)
class OutsideLevel:
    """Levels where no press reaches.

    Attributes
    ----------
    level
        Of the change of grey level; 0 or the lowest where nothing is known to be untouched.
    before, since
        Level of the untouched frame there, and what was added since, grey levels as the camera delivers them; None
        without an untouched frame or place. Where light from outside is uneven, that of the brightest quadrant.
    mean_grey
        Mean level there of the frame itself; None where nothing is untouched.
    """

    level: float
    before: float | None = None
    since: float | None = None
    mean_grey: float | None = None


def level_outside(grey: NDArray[np.float64], change: NDArray[np.float64], prepared: Prepared) -> OutsideLevel:
    """Look beyond the face's rim where that is known, else at the darkest part of the change."""
    if prepared.beyond_rim:
        parts, level = prepared.beyond_rim, None
    else:
        level, dark = darkest(change)
        if dark is None:
            return OutsideLevel(level=level if prepared.untouched is None else 0.0)
        parts = (dark,)
    mean = float(np.mean([grey[part].mean() for part in parts]))
    levels = [float(np.median(change[part])) for part in parts]
    if prepared.untouched is None:
        return OutsideLevel(level=float(np.median(levels)), mean_grey=mean)
    added = [prepared.sign * level for level in levels]
    brightest = int(np.argmax(added))
    before = float(np.median(prepared.untouched[parts[brightest]]))
    return OutsideLevel(level=float(np.median(levels)), before=before, since=added[brightest], mean_grey=mean)


def darkest(change: NDArray[np.float64]) -> tuple[float, NDArray[np.bool] | None]:
    """Lowest level of a change, and the blocks that are level with it; None when they are too few to be untouched."""
    rows, columns = change.shape
    size = (max(1, columns // COARSE), max(1, rows // COARSE))
    coarse = cv2.resize(change, size, interpolation=cv2.INTER_AREA)
    lowest = float(np.quantile(coarse, LOWEST / 2))
    level = np.asarray(coarse <= lowest + 2 * NOISE_FACTOR * pixel_noise(change) / COARSE)
    if level.mean() < LEAST_SHARE:
        return lowest, None
    whole = cv2.resize(level.astype(np.uint8), (columns, rows), interpolation=cv2.INTER_NEAREST)
    return lowest, whole.astype(bool)

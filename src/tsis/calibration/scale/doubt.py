"""What a clean fit of the dots cannot know of the scale: bent pixels, a board that is not square, a spot's own bias.

The residuals tell how well the dots fit the map. Where they fit to a hundredth of a pixel, what the map leaves out is
larger. The bend counts in full: the mean over a pitch and the size at the place itself are both called the scale.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.measured import MeasuredValue
from tsis.calibration.scale.axes import skew_deg

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.calibration.scale.board_map import BoardMap

LEAST_SHARE = 2e-4  # relative; no picture of spots goes below it: light, aberrations, the gel's creep
EVEN = 3**0.5  # bound of an even distribution over its standard deviation
BY_CHANCE = 2.0  # standard deviations that noise explains


def with_model_uncertainty(
    sizes: tuple[MeasuredValue, MeasuredValue], fitted: BoardMap, cell: NDArray[np.float64]
) -> tuple[MeasuredValue, ...]:
    """Pixel sizes (x, y) with the uncertainty of what the map of the dots leaves out added to that of its residuals.

    Parameters
    ----------
    sizes
        As the residuals alone give them, pitch included.
    fitted
        The map from board to image.
    cell
        Place on the lattice, shape (2,), in pitches.
    """
    bend = _beyond_noise(*fitted.bend(cell))
    # Between no error and half the skew anything is as likely (GUM 4.3.7: bound over the root of three).
    askew = _skew_beyond_noise(fitted, cell) / 2 / EVEN
    shares = np.sqrt(LEAST_SHARE**2 + bend**2 + askew**2)
    return tuple(_widened(size, float(share)) for size, share in zip(sizes, shares, strict=True))


def _beyond_noise(found: NDArray[np.float64], noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """Size of what was found less what noise explains, which the residuals' part has counted already."""
    return np.asarray(np.sqrt(np.maximum(found**2 - (BY_CHANCE * noise) ** 2, 0.0)))


def _skew_beyond_noise(fitted: BoardMap, cell: NDArray[np.float64]) -> float:
    """Sine of the skew that noise does not explain.

    Cameras' axes are square, so it is the board's or the tilt's. Pitches that differ by a share e, turned by 45
    degrees, show a skew of e and make both pixel sizes wrong by e / 2; a board sheared by an angle s makes one wrong
    by 1 - cos(s), which is less.
    """
    sine = np.sin(np.radians(skew_deg(fitted.face_step(cell))))
    x, y = fitted.pixel_size(cell, pitch=MeasuredValue(value=1.0, sd=0.0))
    return float(_beyond_noise(np.array(sine), np.hypot(x.sd / x.value, y.sd / y.value)))


def _widened(size: MeasuredValue, share: float) -> MeasuredValue:
    known = (share * size.value) ** 2
    total = size.sd**2 + known
    # Only the residuals' part rests on few degrees of freedom (Welch and Satterthwaite).
    freedom = size.degrees_of_freedom * (total / size.sd**2) ** 2 if size.sd > 0 else np.inf
    return MeasuredValue(value=size.value, sd=total**0.5, degrees_of_freedom=float(freedom), unit=size.unit)

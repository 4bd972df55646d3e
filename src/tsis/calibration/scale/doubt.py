"""What a clean fit of the dots cannot know of the scale: bent pixels, a board that is not square, a spot's own bias.

The residuals tell how well the dots fit the map. Where they fit to a hundredth of a pixel, what the map leaves out is
larger. Each part is an even distribution between two bounds (GUM 4.3.7: bound over the root of three).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.measured import Measured
from tsis.calibration.scale.axes import skew_deg
from tsis.calibration.scale.board_map import LENS_ORDER, fit_order

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.calibration.scale.board_map import BoardMap

LEAST_SHARE = (
    2e-4  # relative standard uncertainty that no image of spots goes below: light, aberrations, the gel's creep
)
POINT = 1e-3  # pitches; over so short a way the map is straight
EVEN = 3**0.5  # bound of an even distribution over its standard deviation
BY_CHANCE = 2.0  # standard deviations of the skew that noise explains


def with_doubt(sizes: tuple[Measured, Measured], fitted: BoardMap, cell: NDArray[np.float64]) -> tuple[Measured, ...]:
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
    bend, rest = _bend(fitted, cell), _rest_of_lens(fitted, cell)
    askew = _skew_beyond_noise(fitted, cell) / 2
    shares = np.sqrt(LEAST_SHARE**2 + (bend**2 + rest**2 + askew**2) / EVEN**2)
    return tuple(_widened(size, float(share)) for size, share in zip(sizes, shares, strict=True))


def _bend(fitted: BoardMap, cell: NDArray[np.float64]) -> NDArray[np.float64]:
    """By what share the mean pixel over one pitch to either side differs from the one at the place itself, (x, y)."""
    mean, here = (np.linalg.norm(fitted.face_step(cell, reach=reach), axis=0) for reach in (1.0, POINT))
    return np.asarray(np.abs(mean / here - 1))


def _rest_of_lens(fitted: BoardMap, cell: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share (x, y) that a wide-angle lens's orders above the fitted one may bring: no more than its last order did."""
    if fitted.order <= LENS_ORDER:
        return np.zeros(2)
    lower = fit_order(fitted.cells, fitted.places_px, LENS_ORDER)
    before, now = (np.linalg.norm(one.face_step(cell), axis=0) for one in (lower, fitted))
    return np.asarray(np.abs(before / now - 1))


def _skew_beyond_noise(fitted: BoardMap, cell: NDArray[np.float64]) -> float:
    """Sine of the skew that noise does not explain.

    Cameras' axes are square, so it is the board's or the tilt's. Pitches that differ by a share e, turned by 45
    degrees, show a skew of e and make both pixel sizes wrong by e / 2; a board sheared by an angle s makes one wrong
    by 1 - cos(s), which is less.
    """
    sine = np.sin(np.radians(skew_deg(fitted.face_step(cell))))
    sizes = fitted.pixel_size(cell, pitch=Measured(value=1.0, sd=0.0))
    noise = BY_CHANCE * np.hypot(*(size.sd / size.value for size in sizes))
    return float(np.sqrt(max(sine**2 - noise**2, 0.0)))


def _widened(size: Measured, share: float) -> Measured:
    known = (share * size.value) ** 2
    total = size.sd**2 + known
    # Only the residuals' part rests on few degrees of freedom (Welch and Satterthwaite).
    freedom = size.degrees_of_freedom * (total / size.sd**2) ** 2 if size.sd > 0 else np.inf
    return Measured(value=size.value, sd=total**0.5, degrees_of_freedom=float(freedom), unit=size.unit)

"""Round spots in a frame, dark or bright, with sub-pixel centres.

A spot is a maximum of the difference of two Gaussian blurs, which suppresses level and slope of the light; the blur of
the strongest response gives the spots' size (Lindeberg, Int. J. Computer Vision 30, 79, 1998).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.imaging import NOISE_FACTOR, QUANTISATION, pixel_noise
from tsis.model.require import freeze_arrays, require_integer

if TYPE_CHECKING:
    from numpy.typing import NDArray


STEP = 2.0**0.5  # from one blur to the next
FINEST_PX = 1.5  # blur: finer spots have no sub-pixel centre
COARSEST = 1 / 20  # blur over the image's shorter side, for at least five spots across
BORDER = 4.0  # blurs between a spot and the border, whose reflection would shift it outwards
LEAST_SEPARATION = 1.5  # blurs between a spot and the next maximum
WEAKEST = 0.3  # strength over that of a typical spot


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spots:
    """Spots of a frame, strongest first."""

    positions_px: NDArray[np.float64]  # centres (x, y), shape (n, 2)
    strength: NDArray[np.float64]  # height above the surroundings, shape (n,), grey levels
    width_px: float  # standard deviation of a Gaussian as wide as the spots
    bright: bool  # brighter than their surroundings

    def __post_init__(self) -> None:
        freeze_arrays(self, "positions_px", "strength", dtype=float)


def find_spots(grey: NDArray[np.float64], *, least: int) -> Spots:
    """Find spots of one size and one sign, above noise and above a fraction of the typical strength.

    The strongest ``least`` of them set size, sign and typical strength.

    Examples
    --------
    >>> y, x = np.mgrid[:100, :120]
    >>> grey = sum(50 * np.exp(-((x - 20.3 - 40 * i) ** 2 + (y - 50.6) ** 2) / 32) for i in range(3))
    >>> spots = find_spots(grey, least=3)
    >>> spots.bright, np.sort(spots.positions_px[:, 0]).round(1).tolist()
    (True, [20.3, 60.3, 100.3])
    """
    least = require_integer("least", least, 1, 10**6)
    noise = max(pixel_noise(grey), QUANTISATION)
    blurs = FINEST_PX * STEP ** np.arange(64)
    blurs = blurs[blurs <= max(COARSEST * min(grey.shape), FINEST_PX)]
    typical = np.zeros((2, len(blurs)))  # strength, by sign and blur
    best, fine = None, _blurred(grey, FINEST_PX)
    for k, blur in enumerate(blurs):
        coarse = _blurred(grey, STEP * blur)
        change = fine - coarse
        level = float(np.median(change))  # a field with light that falls off all round responds everywhere
        for side, sign in enumerate((1.0, -1.0)):
            response = sign * (change - level)
            rows, columns = _peaks(response, blur, NOISE_FACTOR * noise * _noise_gain(blur))
            strength = np.sort(response[rows, columns])
            if strength.size >= least:
                typical[side, k] = strength[-least:].mean()
            if typical[side, k] > np.delete(typical.ravel(), side * len(blurs) + k).max(initial=0.0):
                best = side, k, response, rows, columns
        fine = coarse
    if best is None:
        return Spots(positions_px=np.empty((0, 2)), strength=np.empty(0), width_px=0.0, bright=True)
    side, k, response, rows, columns = best
    strength = response[rows, columns]
    selected = np.flatnonzero(strength > WEAKEST * typical[side, k])
    selected = selected[np.argsort(-strength[selected], kind="stable")]
    return Spots(
        positions_px=_sub_pixel(response, rows[selected], columns[selected], max(1, round(blurs[k] / 2))),
        strength=strength[selected],
        # A Gaussian responds most to the blur of its own width over the root of the step.
        width_px=float(blurs[k] * STEP ** (0.5 + _top(typical[side], k))),
        bright=side == 0,
    )


def _top(values: NDArray[np.float64], index: int) -> float:
    """Offset of the parabola's top through a maximum and its neighbours, in steps."""
    if not 0 < index < len(values) - 1:
        return 0.0
    bend = (values[index - 1] + values[index + 1]) - 2 * values[index]
    return float(np.clip((values[index - 1] - values[index + 1]) / (2 * bend), -0.5, 0.5)) if bend < 0 else 0.0


def in_even_light(
    positions_px: NDArray[np.float64], strength: NDArray[np.float64], width_px: float
) -> NDArray[np.float64]:
    """Centres of spots in even light, shape (n, 2), pixels.

    Light that grows across a spot shifts its centre by the spot's variance times the relative growth per pixel. Towards
    the rim of a lit field the shift is proportional to the distance from its middle, which is an error of scale. The
    light is an exponential of a quadratic function of position, fitted to the spots' own strengths.
    """
    middle, extent = positions_px.mean(axis=0), np.ptp(positions_px, axis=0).max() / 2
    u, v = ((positions_px - middle) / extent).T
    zero, ones = np.zeros_like(u), np.ones_like(u)
    factors = np.linalg.lstsq(np.stack([ones, u, v, u * u, u * v, v * v], axis=1), np.log(strength), rcond=None)[0]
    growth_x = np.stack([zero, ones, zero, 2 * u, v, zero], axis=1) @ factors
    growth_y = np.stack([zero, zero, ones, zero, u, 2 * v], axis=1) @ factors
    return np.asarray(positions_px - width_px**2 / extent * np.stack([growth_x, growth_y], axis=1))


def _blurred(grey: NDArray[np.float64], blur: float) -> NDArray[np.float64]:
    return np.asarray(scipy.ndimage.gaussian_filter(grey, blur), dtype=np.float64)


def _noise_gain(blur: float) -> float:
    """Standard deviation of the difference of two blurs of white noise of standard deviation 1."""
    first, second = blur**2, (STEP * blur) ** 2
    return float(np.sqrt((1 / first + 1 / second - 4 / (first + second)) / (4 * np.pi)))


def _peaks(response: NDArray[np.float64], blur: float, least: float) -> tuple[NDArray[np.intp], ...]:
    """Rows and columns of the maxima above a level, apart from each other and from the border."""
    size = 2 * round(LEAST_SEPARATION * blur) + 1
    highest = scipy.ndimage.maximum_filter(response, size)
    margin = int(np.ceil(BORDER * blur)) + 1
    inside = np.zeros(response.shape, dtype=bool)
    inside[margin:-margin, margin:-margin] = True
    return np.nonzero((response >= highest) & (response > least) & inside)


def _sub_pixel(
    response: NDArray[np.float64], rows: NDArray[np.intp], columns: NDArray[np.intp], half: int
) -> NDArray[np.float64]:
    """Tops (x, y) of the paraboloids through the neighbourhoods of maxima, shape (n, 2)."""
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    terms = np.stack([np.ones(x.size), *(a.ravel() for a in (x, y, x * x, x * y, y * y))], axis=1)
    around = response[rows[:, None] + y.ravel(), columns[:, None] + x.ravel()]
    _, bx, by, xx, xy, yy = np.linalg.pinv(terms) @ around.T
    bend = 4 * xx * yy - xy**2
    # A paraboloid without a top, or with one beyond one pixel, leaves the centre at the pixel.
    good = (bend > 0) & (xx < 0)
    safe = np.where(good, bend, 1.0)
    shift = np.stack([(xy * by - 2 * yy * bx) / safe, (xy * bx - 2 * xx * by) / safe], axis=1)
    shift[~good | (np.abs(shift).max(axis=1) > 1.0)] = 0.0
    return np.asarray(np.stack([columns, rows], axis=1) + shift)

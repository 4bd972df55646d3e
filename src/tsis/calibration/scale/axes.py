"""Which two directions of a lattice of dots are the board's rows and columns."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.scale.board_map import BoardMap, fit_map
from tsis.model.errors import CalibrationError

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_SKEW_DEG = 3.0  # between the image's axes as the board shows them; noise and scatter make some tenths
# Height over width of a pixel; rows of a hexagonal board or one with a row in two missing make it 0.58 or 0.5 times.
PIXEL_RATIO = (0.8, 1.25)
LONGEST_PIXEL = 2.5  # ratio of the sides that a lattice of unlike pitches is looked for with, to say what is wrong
CLEAR_SKEW_DEG = 4.0  # by which the right pair of lattice axes is squarer than the next
# Pairs of axes that count one and the same lattice of points; the first dots found may have had gaps for neighbours.
WAYS = [(i, j) for i in range(3) for j in range(-2, 3) if i > 0 or j > 0]
AXES = [
    np.array(pair)
    for pair in itertools.combinations(WAYS, 2)
    if abs(pair[0][0] * pair[1][1] - pair[0][1] * pair[1][0]) == 1
]


def with_square_axes(fitted: BoardMap, cell: NDArray[np.float64]) -> BoardMap:
    """The same dots counted along the two lattice axes that make the image's axes perpendicular on the face.

    A turned board's diagonal may be shorter in the image than its side where pixels are far from square. A square
    lattice at 32 degrees, counted along a diagonal, is again square, of pixels 2.6 times as long as wide; no camera has
    such.
    """
    step = fitted.face_step(cell)
    skews = np.array([abs(skew_deg(axes @ step)) for axes in AXES])
    width, height = np.array([np.linalg.norm(axes @ step, axis=0) for axes in AXES]).T
    ratios = height / width
    usual = (ratios > PIXEL_RATIO[0]) & (ratios < PIXEL_RATIO[1])
    first, second = np.argsort(np.where(usual, skews, 90.0))[:2]
    if not usual[first] or skews[first] > MOST_SKEW_DEG:
        raise _no_square(skews, ratios, usual)
    if usual[second] and skews[second] - skews[first] < CLEAR_SKEW_DEG:
        raise CalibrationError(
            f"the dots' rows must be told from their diagonals; both fit a square lattice to {skews[second]:.0f} "
            "degrees (lay the rows along the image's axes)"
        )
    axes = AXES[first]
    if abs((axes @ step)[0, 0]) < abs((axes @ step)[1, 0]):
        axes = axes[::-1]
    # Counted along the image's axes, as nearly as may be: so the rotation has a sign.
    axes = axes * np.sign(np.diag(axes @ step))[:, None]
    return fit_map(fitted.cells @ axes.T, fitted.places_px)


def _no_square(skews: NDArray[np.float64], ratios: NDArray[np.float64], usual: NDArray[np.bool]) -> CalibrationError:
    """Why no pair of lattice axes gives pixels of a camera."""
    long = (ratios < LONGEST_PIXEL) & (ratios > 1 / LONGEST_PIXEL)
    squarest = int(np.argmin(np.where(long, skews, 90.0)))
    if long[squarest] and skews[squarest] <= MOST_SKEW_DEG:
        return CalibrationError(
            "the board's rows and columns must be one pitch apart, with no row missing throughout; they would make a "
            f"pixel {ratios[squarest]:.2f} times as high as wide, and cameras' pixels are {PIXEL_RATIO[0]:g} to "
            f"{PIXEL_RATIO[1]:g} (use a board of dots on a square lattice, not a hexagonal one)"
        )
    skew = float(np.where(usual, skews, 90.0).min() if usual.any() else skews.min())
    return CalibrationError(
        f"the dots must form a square lattice seen straight on, to {MOST_SKEW_DEG:g} degrees; theirs is {skew:.1f} "
        "degrees askew (use a board with one pitch along both axes and square rows, and press it without tilt)"
    )


def rotation_deg(step: NDArray[np.float64]) -> float:
    """Angle in the image from the x axis towards the y axis at which the nearest lattice axis lies, in [-45, 45]."""
    angle = -float(np.degrees(np.arctan2(step[1, 0], step[0, 0])))
    return (angle + 45.0) % 90.0 - 45.0


def skew_deg(step: NDArray[np.float64]) -> float:
    """How far the image's two axes are from a right angle on the face."""
    one, other = step.T
    sine = (one @ other) / (np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))))

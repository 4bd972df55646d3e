"""The point about which a signal is most nearly the same after half a turn.

Where the signal grows with PRESSURE or depth a contact is a hill, and its halo may be deeper on one side: the steepest
fall is drawn there, the symmetry of the hill is not. Discs, ellipses and rings all have that point.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.optimize import minimize

from tsis.imaging.edge_circle import CENTRE_REACH, COARSE_STEPS, TOLERANCE, blurred, pixel_shape

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import TactileImage

WINDOW = 1.2  # radius of what is compared, in patch radii: the hill with its foot
SAMPLES = 24  # across the window's radius; the blur leaves nothing finer
LEAST_COMPARED = 0.5  # share of the window that must lie inside the image, with its turned twin


def symmetry_centre(
    image: TactileImage, centre: tuple[float, float], reach: float, blur: float
) -> tuple[float, float] | None:
    """Centre of symmetry (x, y) near a patch, in pixels; None when too little of it lies inside the image.

    Minimised is ``sum (s - turned s)² / sum (s + turned s)²`` over a disc on the face, for s the part of the signal
    above zero: halos that are darker than the untouched probe belong to no contact.
    """
    pixel = pixel_shape(image)
    hill = blurred(np.maximum(image.grey, 0.0), blur, pixel).astype(np.float32)
    offsets = _disc(WINDOW * reach, pixel)
    height, width = hill.shape

    def unlikeness(point: NDArray[np.float64]) -> float:
        columns, rows = ((point[axis] + offsets[axis]).astype(np.float32)[None] for axis in (0, 1))
        values = cv2.remap(hill, columns, rows, cv2.INTER_LINEAR)[0].astype(np.float64)
        inside = ((columns >= 0) & (columns <= width - 1) & (rows >= 0) & (rows <= height - 1))[0]
        pair = inside & inside[::-1]
        if np.count_nonzero(pair) < LEAST_COMPARED * pair.size:
            return 1.0
        turned = values[::-1]
        alike = float(np.square(values + turned)[pair].sum())
        return float(np.square(values - turned)[pair].sum()) / alike if alike > 0.0 else 1.0

    shifts = np.linspace(-CENTRE_REACH * reach, CENTRE_REACH * reach, COARSE_STEPS)
    starts = [np.array([centre[0] + x, centre[1] + y]) for x in shifts for y in shifts]
    start = min(starts, key=unlikeness)
    if unlikeness(start) >= 1.0:
        return None
    simplex = start + float(shifts[1] - shifts[0]) * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    found = minimize(
        unlikeness,
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": TOLERANCE * reach, "fatol": 1e-12, "maxiter": 400},
    )
    return float(found.x[0]), float(found.x[1])


def _disc(radius: float, pixel: tuple[float, float]) -> NDArray[np.float64]:
    """Offsets (x and y rows, in pixels) of a grid over a disc; read backwards it is the same disc after half a turn."""
    step = np.arange(-SAMPLES, SAMPLES + 1) * (radius / SAMPLES)
    x, y = (axis.ravel() for axis in np.meshgrid(step, step))
    inside = np.hypot(x, y) <= radius
    return np.array([x[inside] / pixel[0], y[inside] / pixel[1]])

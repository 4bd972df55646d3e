"""Corners of a lit face that is seen from aside, by which it is warped upright."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
import skimage

from tsis.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLUR = 0.004  # of the frame's columns, before the threshold
SMALLEST = 0.05  # of the frame, that a face covers
LARGEST = 0.97  # of the frame: more is a face that fills it
FITTED = 0.8  # of a side, its middle, by which its line is drawn: the corners are rounded by optics
LEAST_FILLED = 0.93  # of the quadrilateral that is lit


def find_face_corners(frame: Any) -> tuple[tuple[float, float], ...]:
    """Corners of the lit face in a frame of the untouched sensor.

    The lit region is what Otsu's threshold leaves of the brightest channel; its hull is cut to four corners, and a line
    through the middle of each side meets its neighbours in corners that are exact to about a pixel.

    Parameters
    ----------
    frame
        Levels, shape (rows, columns) or (rows, columns, channels).

    Returns
    -------
    tuple
        Places (x, y) in pixels of upper left, upper right, lower right, lower left as the frame shows them. A mirror or
        a turned camera needs another order: look at a warped frame.

    Raises
    ------
    InputError
        When the frame has no dark border around one lit quadrilateral.
    """
    levels = np.asarray(frame, dtype=np.float64)
    if levels.ndim not in (2, 3) or min(levels.shape[:2]) < 16:
        raise InputError(f"a frame must have the shape (rows, columns) or (rows, columns, 3); got {levels.shape}")
    bright = levels if levels.ndim == 2 else levels[..., :3].max(axis=2)
    bright = scipy.ndimage.gaussian_filter(bright, BLUR * bright.shape[1])
    if np.ptp(bright) < 1e-9:
        raise InputError("the frame must show a lit face before a dark surround; got one level everywhere")
    lit = scipy.ndimage.binary_fill_holes(bright > skimage.filters.threshold_otsu(bright))  # type: ignore[no-untyped-call]
    labels, count = scipy.ndimage.label(lit)
    region = labels == 1 + int(np.argmax(np.bincount(labels.ravel())[1:])) if count else lit
    if not SMALLEST < region.mean() < LARGEST:
        raise InputError(
            f"the face must cover {SMALLEST:.0%} to {LARGEST:.0%} of the frame; the lit part covers {region.mean():.0%}"
        )
    hull = skimage.morphology.convex_hull_image(region)  # type: ignore[no-untyped-call]
    lines = skimage.measure.find_contours(np.pad(hull, 1).astype(float), 0.5)  # type: ignore[no-untyped-call]
    outline = max(lines, key=len)[:-1, ::-1] - 1.0
    corners = _exact_corners(outline, _four_corners(outline))
    inside = skimage.draw.polygon2mask(hull.shape, corners[:, ::-1])  # type: ignore[no-untyped-call]
    if (region & inside).sum() < LEAST_FILLED * max(inside.sum(), region.sum()):
        raise InputError("the lit part must be one quadrilateral; got another shape: give the corners by hand")
    start = int(np.argmin(corners.sum(axis=1)))
    turned = np.roll(corners, -start, axis=0)
    (x, y), following = turned.T, np.roll(turned, -1, axis=0)
    if (x * following[:, 1] - y * following[:, 0]).sum() < 0.0:  # it must go clockwise as the frame shows it
        turned = turned[[0, 3, 2, 1]]
    return tuple((float(x), float(y)) for x, y in turned)


def _four_corners(outline: NDArray[np.float64]) -> NDArray[np.intp]:
    """Indices of four points of a convex outline whose quadrilateral is the largest, ascending."""
    step = max(1, len(outline) // 120)
    places = np.arange(0, len(outline), step)
    points = outline[places]

    def area(chosen: list[int]) -> float:
        x, y = points[chosen].T
        return abs(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())) / 2.0

    chosen = [int(np.argmax(value)) for value in (-points.sum(1), points @ (1, -1), points.sum(1), points @ (-1, 1))]
    chosen, best = sorted(set(chosen)), 0.0
    while len(chosen) < 4:
        chosen = sorted({*chosen, int((chosen[-1] + len(points) // 5) % len(points))})
    while area(chosen) > best:  # each corner in turn to where the quadrilateral is the largest
        best = area(chosen)
        for corner in range(4):
            others = [part for index, part in enumerate(chosen) if index != corner]
            free = [index for index in range(len(points)) if index not in others]
            chosen = sorted([*others, max(free, key=lambda index: area(sorted([*others, index])))])
    return np.asarray(places[chosen])


def _exact_corners(outline: NDArray[np.float64], corners: NDArray[np.intp]) -> NDArray[np.float64]:
    """Where lines through the middles of neighbouring sides meet, shape (4, 2)."""
    lines = []
    for number in range(4):
        first, last = int(corners[number]), int(corners[(number + 1) % 4])
        last += len(outline) if last <= first else 0
        margin = round((1.0 - FITTED) / 2.0 * (last - first))
        side = outline[np.arange(first + margin, last - margin + 1) % len(outline)]
        middle = side.mean(axis=0)
        along = np.linalg.svd(side - middle)[2][0]
        lines.append((middle, along))
    found = []
    for number in range(4):
        (before, way), (after, other) = lines[number - 1], lines[number]
        try:
            part = np.linalg.solve(np.column_stack([way, -other]), after - before)
        except np.linalg.LinAlgError:
            raise InputError("the lit part must have four corners; got parallel neighbours") from None
        found.append(before + part[0] * way)
    return np.asarray(found)

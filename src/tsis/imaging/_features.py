"""Position, strength, size and shape of the contact in one tactile image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from tsis.imaging._corrections import signal
from tsis.imaging._patch import Patch, segment
from tsis.imaging._profile import RadialProfile, radial_profile

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import TactileImage


PROFILE_RINGS = 24
OUTLINE_BLUR = 0.05  # of the patch's radius


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Features:
    """Features of the contact in one image; zeros and None without contact.

    Lengths in mm are None when the scale is unknown. Positions in mm are relative to the image's ``axis_px``, x to the
    right and y down the image. Angle, eccentricity and circularity describe the shape on the face, where pixels may be
    wider than high; without a scale pixels are assumed square.

    Attributes
    ----------
    contact
        False when no signal exceeds the noise.
    centroid_px, centroid_mm
        Mean position (x, y) weighted by grey level, (6.7) and (6.8).
    peak
        Greatest grey level of the signal in the patch after a blur of one pixel.
    total
        Sum of the signal's grey levels in the patch.
    area_px, area_mm2
        Area of the patch.
    equivalent_diameter_px, equivalent_diameter_mm
        Diameter of the disc of the same area.
    semi_axes_px, semi_axes_mm
        Semi-axes (long, short) of the ellipse with the patch's second moments; in mm on the face.
    angle_deg
        Direction of the long axis in [0, 180), from x towards y.
    eccentricity
        ``sqrt(1 - (short / long)²)``: 0 for a circle.
    circularity
        ``4 pi area / perimeter²`` of the outline: 1 for a circle, less for other shapes.
    saturated_fraction
        Fraction of the patch's pixels at which the camera clipped.
    cropped
        True when the patch touches the border of the image.
    profile
        Mean signal in rings about the centroid; None without scale or contact.
    patch
        Pixels, levels and outline of the patch.
    """

    contact: bool
    centroid_px: tuple[float, float] | None = None
    centroid_mm: tuple[float, float] | None = None
    peak: float = 0.0
    total: float = 0.0
    area_px: float = 0.0
    area_mm2: float | None
    equivalent_diameter_px: float = 0.0
    equivalent_diameter_mm: float | None
    semi_axes_px: tuple[float, float] | None = None
    semi_axes_mm: tuple[float, float] | None = None
    angle_deg: float | None = None
    eccentricity: float | None = None
    circularity: float | None = None
    saturated_fraction: float = 0.0
    cropped: bool = False
    profile: RadialProfile | None = None
    patch: Patch


def features(
    image: TactileImage,
    reference: TactileImage | None = None,
    *,
    invert: bool = False,
    method: str = "otsu",
    least_grey: float = 0.0,
) -> Features:
    """Compute position, strength, size and shape of the contact in an image.

    Parameters
    ----------
    image
        The pressed probe, as the camera delivered it: a corrected frame does not show clipped pixels.
    reference
        The untouched probe; without it the grey levels are the signal.
    invert
        True for probes whose light falls where they are pressed.
    method, least_grey
        Arguments of `segment`.

    Returns
    -------
    Features
        Zeros and None, and ``contact`` False, when no signal exceeds the noise.

    Raises
    ------
    InputError
        When ``image`` is no TactileImage, or ``invert`` lacks a reference.
    ImageMismatchError
        When the reference's size, scale or full scale differ from the image's.

    Examples
    --------
    >>> from tsis.model import TactileImage
    >>> y, x = np.mgrid[:60, :80]
    >>> disc = np.where((x - 30) ** 2 + (y - 25) ** 2 < 100, 80.0, 0.0)
    >>> result = features(TactileImage(grey=disc, mm_per_pixel=(0.1, 0.1)))
    >>> result.centroid_px, round(result.equivalent_diameter_mm, 1)
    ((30.0, 25.0), 2.0)
    """
    change = signal(image, reference, invert=invert)
    patch = segment(change, method=method, least_grey=least_grey)
    scale = image.mm_per_pixel
    if not patch.is_contact:
        zero_mm = None if scale is None else 0.0
        return Features(contact=False, area_mm2=zero_mm, equivalent_diameter_mm=zero_mm, patch=patch)
    rows, columns = np.nonzero(patch.mask)
    grey = change.grey[rows, columns]
    weight = np.maximum(grey, 0.0)
    centroid = float(np.average(columns, weights=weight)), float(np.average(rows, weights=weight))
    beside = centroid[0] - image.axis()[0], centroid[1] - image.axis()[1]
    area_px = float(rows.size)
    shape_px = _ellipse(rows, columns, (1.0, 1.0))
    shape = shape_px if scale is None else _ellipse(rows, columns, scale)
    area_mm2 = None if scale is None else area_px * scale[0] * scale[1]
    edges_mm = np.linspace(0.0, 2.0 * shape[0], PROFILE_RINGS + 1)  # to twice the long semi-axis
    return Features(
        contact=True,
        centroid_px=centroid,
        centroid_mm=None if scale is None else (beside[0] * scale[0], beside[1] * scale[1]),
        peak=patch.peak_grey,
        total=float(grey.sum()),
        area_px=area_px,
        area_mm2=area_mm2,
        equivalent_diameter_px=_disc_diameter(area_px),
        equivalent_diameter_mm=None if area_mm2 is None else _disc_diameter(area_mm2),
        semi_axes_px=shape_px[:2],
        semi_axes_mm=None if scale is None else shape[:2],
        angle_deg=shape[2],
        eccentricity=float(np.sqrt(max(0.0, 1.0 - (shape[1] / shape[0]) ** 2))),
        circularity=_circularity(patch.contour_px * (scale or (1.0, 1.0))),
        saturated_fraction=float(np.mean(image.grey[patch.mask] >= image.full_scale)),
        cropped=patch.cropped,
        profile=None if scale is None else radial_profile(change, centre_px=centroid, edges_mm=edges_mm),
        patch=patch,
    )


def _ellipse(
    rows: NDArray[np.intp], columns: NDArray[np.intp], scale: tuple[float, float]
) -> tuple[float, float, float]:
    """Long and short semi-axis and angle in degrees of the ellipse with the same second moments."""
    x, y = columns * scale[0], rows * scale[1]
    moments = np.cov(x, y, bias=True) if x.size > 1 else np.zeros((2, 2))
    # A pixel is a rectangle, not a point: its own second moment is a twelfth of its side squared.
    moments = moments + np.diag([scale[0] ** 2, scale[1] ** 2]) / 12.0
    (short, long), directions = np.linalg.eigh(moments)
    angle = np.degrees(np.arctan2(directions[1, 1], directions[0, 1])) % 180.0
    return 2.0 * float(np.sqrt(long)), 2.0 * float(np.sqrt(short)), float(angle)


def _disc_diameter(area: float) -> float:
    return float(2.0 * np.sqrt(area / np.pi))


def _circularity(points: NDArray[np.float64]) -> float:
    """Circularity of one closed polygon, smoothed so that noise does not add to its length."""
    radius = np.sqrt(_enclosed(points) / np.pi)
    step = np.hypot(*np.diff(points, axis=0).T).mean()
    smooth = ndimage.gaussian_filter1d(points[:-1], OUTLINE_BLUR * radius / step, axis=0, mode="wrap")
    closed = np.vstack([smooth, smooth[:1]])
    perimeter = float(np.hypot(*np.diff(closed, axis=0).T).sum())
    return 4.0 * np.pi * _enclosed(closed) / perimeter**2


def _enclosed(points: NDArray[np.float64]) -> float:
    """Area inside a closed polygon."""
    step = np.diff(points, axis=0)
    return float(abs((points[:-1, 0] * step[:, 1] - points[:-1, 1] * step[:, 0]).sum())) / 2.0

"""Sum of grey levels and shape of the bright patch in one frame of a press."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
import skimage

from tsis.errors import InputError
from tsis.imaging import segment, smoothed
from tsis.model.image import TactileImage
from tsis.model.require import require_one_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.calibration.reference import CameraReference


PATCH_METHODS = ("threshold", "canny")
MARGIN = 0.06  # of the patch's radius; the mask grows by it to include the light of the edge
LEAST_MARGIN_PX = 3
MIDDLE = 0.3  # of the contact's radius
HERTZ_SPREAD = 2.5  # square of the radius over the mean square distance of a Hertzian contact's light


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadingFrame:
    """One frame with the gauge's force.

    Attributes
    ----------
    force_n
        Force of the gauge, newtons.
    touched
        Whether the tip touched the probe.
    total_grey, field_grey
        Sum of grey levels above no contact, over the bright patch (0 without one) and over all good pixels.
    peak_grey, mean_square_mm2
        Grey level in the middle, and mean square distance of the light from its centroid; 0 without a patch.
    clipped
        Fraction of the patch's pixels that clip.
    """

    force_n: float
    touched: bool
    total_grey: float
    field_grey: float
    peak_grey: float
    mean_square_mm2: float
    clipped: float


def read_loading_frame(
    image: TactileImage, reference: CameraReference, *, force_n: float, touched: bool, method: str = "threshold"
) -> LoadingFrame:
    """Read one frame of the loading procedure; clipped pixels are counted, not refused.

    Raises `ImageMismatchError` or `InputError` when the frame does not belong to the reference, the lamps changed or
    the scale is unknown.

    Parameters
    ----------
    image
        The raw camera frame.
    reference
        Its correction.
    force_n, touched
        As in `LoadingFrame`.
    method
        ``"threshold"`` or ``"canny"``.
    """
    grey = reference.touch_grey(image)
    scale = reference.mm_per_pixel or image.mm_per_pixel
    if scale is None:
        raise InputError("mm_per_pixel must be known to read a press; calibrate the scale first")
    mask = patch_mask(TactileImage(grey=grey, full_scale=reference.full_scale), method=method)
    lit = bool(mask.any())
    peak, spread = _shape(grey, mask, scale) if lit else (0.0, 0.0)
    return LoadingFrame(
        force_n=force_n,
        touched=touched,
        total_grey=float(grey[mask].sum()),
        field_grey=float(grey[reference.usable].sum()),
        peak_grey=peak,
        mean_square_mm2=spread,
        clipped=float(np.mean(image.grey[mask] >= image.full_scale)) if lit else 0.0,
    )


def total_grey(image: TactileImage, reference: CameraReference, *, method: str = "threshold") -> float:
    """Sum of grey levels above no contact over the bright patch, 0 when nothing stands out of the noise.

    It is the argument of `ForceLine.force_n`: y of the source's (5.4). Where grey level follows pressure as in (5.2),
    it follows the force, the integral of the pressure (5.3). Raises `ImageMismatchError` or `InputError` when the frame
    does not belong to the reference, is saturated, or the lamps changed.
    """
    corrected = reference.corrected(image)
    mask = patch_mask(corrected, method=method)
    return float(corrected.grey[mask].sum())


def patch_mask(image: TactileImage, *, method: str = "threshold") -> NDArray[np.bool]:
    """The pixels of the bright patch of a corrected frame, with a margin for the light of its edge.

    ``"threshold"`` cuts six standard deviations of the noise above the dark side. ``"canny"`` fills the outline of
    Canny's edges, or uses the threshold's patch where they do not close.
    """
    require_one_of("segmentation method", method, PATCH_METHODS)
    patch = segment(image, method="noise")
    mask = np.asarray(patch.mask)
    if not patch.is_contact:
        return mask
    if method == "canny":
        mask = _within_edges(image.grey, mask, patch.threshold_grey)
    margin = max(LEAST_MARGIN_PX, round(MARGIN * float(np.sqrt(mask.sum() / np.pi))))
    return np.asarray(scipy.ndimage.distance_transform_edt(~mask) <= margin)


def _within_edges(grey: NDArray[np.float64], mask: NDArray[np.bool], threshold: float) -> NDArray[np.bool]:
    """The part of the patch that Canny's edges enclose."""
    smooth = smoothed(grey)
    top = float(smooth[mask].max())
    low = float(np.clip(threshold / top, 5 / 255, 100 / 255))
    levels = np.clip(smooth / top, 0, 1)
    edges = skimage.feature.canny(levels, 0, low, 2 * low, mode="nearest")  # type: ignore[no-untyped-call]
    filled = scipy.ndimage.binary_fill_holes(scipy.ndimage.grey_closing(edges, (5, 5), mode="nearest"))
    labels, count = scipy.ndimage.label(filled)
    if count == 0:
        return mask
    sizes = np.bincount(labels[mask], minlength=count + 1)
    sizes[0] = 0
    inside = labels == int(np.argmax(sizes))
    return np.asarray(inside) if inside[mask].mean() > 0.5 else mask


def _shape(grey: NDArray[np.float64], mask: NDArray[np.bool], scale: tuple[float, float]) -> tuple[float, float]:
    """Grey level in the middle, and mean square distance from the centroid, mm²."""
    rows, columns = np.nonzero(mask)
    light = grey[rows, columns]
    total = float(light.sum())
    x, y = columns * scale[0], rows * scale[1]
    away = (x - float(light @ x) / total) ** 2 + (y - float(light @ y) / total) ** 2
    spread = float(light @ away) / total
    middle = away < MIDDLE**2 * HERTZ_SPREAD * spread
    return float(light[middle].mean()) if middle.any() else float(light.max()), max(spread, 0.0)

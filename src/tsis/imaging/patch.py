"""The bright patch of a contact: its pixels, threshold and outline, and its features."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
import skimage

from tsis.imaging.corrections import require_image, signal
from tsis.imaging.pixels import gaussian_blur
from tsis.imaging.profile import RadialProfile, radial_profile
from tsis.model.require import freeze_arrays, require_number, require_one_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.image import TactileImage


SEGMENTATION_METHODS = ("otsu", "half", "noise")
SMOOTH_PX = 1.0  # standard deviation of the blur before thresholds; it shifts edges by less than a pixel
NOISE_FACTOR = 6.0  # the blurred noise of a million pixels peaks near 5 standard deviations
GAUSSIAN_MAD = 1.4826  # standard deviation over median absolute deviation of Gaussian noise
CLEAR_CHANGE = 0.1  # fraction of full scale; larger than any drift of the lamps
QUANTISATION = 12.0**-0.5  # standard deviation of rounding to whole grey levels
PROFILE_RINGS = 24
OUTLINE_BLUR = 0.05  # of the patch's radius


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Patch:
    """The pixels of a contact, and the levels that separate them from the background.

    Attributes
    ----------
    mask
        True inside the patch, shape (rows, columns); False everywhere when there is no contact.
    background_grey
        Median of the signal's dark side.
    threshold_grey
        Level above which a pixel counts as lit.
    contour_px
        Outer boundary, (n, 2) points (x, y) in pixels, closed; shape (0, 2) when there is no contact.
    peak_grey
        Highest level of the blurred signal inside the patch; 0 when there is no contact.
    """

    mask: NDArray[np.bool]
    background_grey: float
    threshold_grey: float
    contour_px: NDArray[np.float64]
    peak_grey: float = 0.0

    def __post_init__(self) -> None:
        freeze_arrays(self, "mask", "contour_px")

    @property
    def is_contact(self) -> bool:
        """True when there is a contact."""
        return bool(self.mask.any())

    @property
    def cropped(self) -> bool:
        """True when the patch touches the image's border, so that a part may lie outside."""
        border = (self.mask[0], self.mask[-1], self.mask[:, 0], self.mask[:, -1])
        return any(bool(edge.any()) for edge in border)


def segment(image: TactileImage, *, method: str = "otsu", least_grey: float = 0.0) -> Patch:
    """Find the bright patch of a contact in a signal.

    The signal is blurred by one pixel and cut at a threshold. The patch is the connected part with the greatest sum of
    grey levels, with its holes filled. The peak of a contact exceeds the dark side by six standard deviations of the
    pixel noise. It also exceeds the dark side by six of the dark side's own spread, because drift of the lamps is
    smooth, or by a tenth of full scale, because a frame lit all over has no dark side to measure. Raises
    `UnknownNameError` when no method has that name.

    Parameters
    ----------
    image
        The change of grey level (see `signal`), positive where the probe is pressed.
    method
        ``"otsu"``: the best threshold between two classes of levels; ``"half"``: halfway from the dark side to the
        peak; ``"noise"``: six standard deviations above the dark side, at the foot of the signal.
    least_grey
        Least peak of a contact above the dark side, grey levels, besides the limits by noise.

    Returns
    -------
    Patch
        The patch; ``is_contact`` is False when there is none.

    Examples
    --------
    >>> from tsis import TactileImage
    >>> grey = np.zeros((40, 40))
    >>> grey[10:20, 15:25] = 50.0
    >>> patch = segment(TactileImage(grey=grey))
    >>> patch.is_contact, int(patch.mask.sum()), patch.cropped
    (True, 100, False)
    >>> segment(TactileImage(grey=np.zeros((40, 40)))).is_contact
    False
    """
    require_image("image", image)
    require_one_of("segmentation method", method, SEGMENTATION_METHODS)
    require_number("least_grey", least_grey, 0.0, image.full_scale)
    smooth = smoothed(image.grey)
    cut = _otsu(smooth)
    background, spread, noise = _dark_side(image.grey, smooth, cut)
    contrast = float(smooth.max()) - background
    least = max(NOISE_FACTOR * noise, min(NOISE_FACTOR * spread, CLEAR_CHANGE * image.full_scale), least_grey)
    if method == "half":
        cut = background + contrast / 2
    elif method == "noise":
        cut = background + NOISE_FACTOR * max(noise, spread)
    mask = _strongest_part(smooth, cut) if contrast > least else np.zeros(smooth.shape, dtype=bool)
    return Patch(
        mask=mask,
        background_grey=background,
        threshold_grey=cut,
        contour_px=outline(smooth, mask, cut),
        peak_grey=float(smooth[mask].max(initial=0.0)),
    )


def smoothed(grey: NDArray[np.float64]) -> NDArray[np.float64]:
    """The frame after a Gaussian blur of one pixel."""
    return np.asarray(gaussian_blur(grey, (SMOOTH_PX, SMOOTH_PX)), dtype=np.float64)


def outline(smooth: NDArray[np.float64], mask: NDArray[np.bool], cut: float) -> NDArray[np.float64]:
    """The longest closed boundary of a patch, (n, 2) points (x, y) in pixels, along the border where it is cropped."""
    if not mask.any():
        return np.empty((0, 2))
    # The level line of the blurred signal at the cut: the mask's pixel edges are some per cent longer.
    peak = float(smooth[mask].max())
    field = np.minimum(smooth, cut - 1e-9 * (peak - cut))
    field[mask] = np.where(smooth[mask] > cut, smooth[mask], peak)
    curves = skimage.measure.find_contours(np.pad(field, 1, constant_values=2.0 * cut - peak), cut)  # type: ignore[no-untyped-call]
    longest: NDArray[np.float64] = max(curves, key=len)[:, ::-1] - 1.0
    return longest


def pixel_noise(grey: NDArray[np.float64]) -> float:
    """Standard deviation of one pixel's noise, grey levels; needs no untouched area."""
    if min(grey.shape) < 3:
        return 0.0
    # Second differences along both axes, of norm 6, to which slopes and smooth patches do not contribute.
    rows = grey[:-2] - 2.0 * grey[1:-1] + grey[2:]
    mixed = rows[:, :-2] - 2.0 * rows[:, 1:-1] + rows[:, 2:]
    return GAUSSIAN_MAD * float(np.median(np.abs(mixed))) / 6.0


def _otsu(smooth: NDArray[np.float64]) -> float:
    """Level halfway between the means of Otsu's two classes; negative levels count as zero.

    Between well separated classes all levels are equally good thresholds and a histogram picks the lowest.
    """
    lit = np.maximum(smooth, 0.0)
    if lit.min() == lit.max():
        return float(smooth.max())
    first = float(skimage.filters.threshold_otsu(lit))  # type: ignore[no-untyped-call]
    above = lit > first
    return float(lit[above].mean() + lit[~above].mean()) / 2.0


def _dark_side(grey: NDArray[np.float64], smooth: NDArray[np.float64], cut: float) -> tuple[float, float, float]:
    """Median and spread of the signal below the cut, and the pixel noise after the blur."""
    dark = smooth[smooth <= cut]
    level = float(np.median(dark))
    spread = GAUSSIAN_MAD * float(np.median(np.abs(dark - level)))
    whole_levels = np.array_equal(grey, np.rint(grey)) and grey.any()
    noise = max(pixel_noise(grey), QUANTISATION if whole_levels else 0.0)
    # A Gaussian blur of standard deviation s reduces white noise by the factor 1 / (2 s sqrt(pi)).
    return level, spread, noise / (2.0 * SMOOTH_PX * np.sqrt(np.pi))


def _strongest_part(smooth: NDArray[np.float64], cut: float) -> NDArray[np.bool]:
    """The connected part above the cut with the greatest sum above it, its holes filled."""
    above = smooth > cut
    labels, count = scipy.ndimage.label(above)
    if count == 0:
        return above
    strength = np.bincount(labels[above], weights=smooth[above] - cut, minlength=count + 1)
    filled: NDArray[np.bool] = scipy.ndimage.binary_fill_holes(labels == int(np.argmax(strength)))
    return filled


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
        Mean position (x, y) weighted by grey level.
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

    Raises `InputError` when ``image`` is no TactileImage, or ``invert`` lacks a reference; `ImageMismatchError` when
    the reference's size, scale or full scale differ from the image's.

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

    Examples
    --------
    >>> from tsis.model.image import TactileImage
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
    # (6.7), (6.8)
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
    smooth = scipy.ndimage.gaussian_filter1d(points[:-1], OUTLINE_BLUR * radius / step, axis=0, mode="wrap")
    closed = np.vstack([smooth, smooth[:1]])
    perimeter = float(np.hypot(*np.diff(closed, axis=0).T).sum())
    return 4.0 * np.pi * _enclosed(closed) / perimeter**2


def _enclosed(points: NDArray[np.float64]) -> float:
    """Area inside a closed polygon."""
    step = np.diff(points, axis=0)
    return float(abs((points[:-1, 0] * step[:, 1] - points[:-1, 1] * step[:, 0]).sum())) / 2.0

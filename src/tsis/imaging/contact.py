"""Centre and radius of a round contact: the circle across which a signal falls steepest, and the centre of symmetry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.imaging.colour import change_magnitude
from tsis.imaging.corrections import require_image, signal
from tsis.imaging.patch import Features, Patch, features, segment
from tsis.imaging.pixels import gaussian_blur
from tsis.model.image import TactileImage
from tsis.model.require import require_one_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


CONTACT_METHODS = ("symmetry", "edge")
BLUR = 0.1  # of the patch's radius, for the centre: it removes noise and preserves symmetry
EDGE_BLUR_PX = 1.5  # for the radius: a wider blur shifts the foot of a rounded hill inwards by 1.5 times its width
LEAST_RADIUS_PX = 2.0  # smaller patches have too few pixels for a radius
DIRECTIONS = 96  # on the circle; a multiple of 4 treats both axes equally
CENTRE_RANGE = 0.4  # largest offset of the centre from the patch's, in patch radii
RADIUS_RANGE = (0.5, 1.5)  # least and greatest radius, in patch radii
COARSE_STEPS = 9  # a side of the first grid of centres
RADII = 36  # of the first grid
FINE_RADII = 401  # about a given centre
LEAST_VISIBLE = 0.5  # fraction of the circle inside the image
TOLERANCE = 1e-3  # of the patch's radius: some hundredths of a pixel
WINDOW = 1.2  # radius of the comparison for symmetry, in patch radii: the hill with its foot
SAMPLES = 24  # across the window's radius; the blur removes finer detail
LEAST_COMPARED = 0.5  # fraction of the window inside the image together with its rotated copy


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """A round contact.

    Attributes
    ----------
    centre_px
        Centre (x, y) in pixels.
    radius_px
        Radius at which the signal falls steepest, in pixels, or square pixels of the same area where pixels are not
        square. Around a ball the face slopes outside the contact, so the radius is some per cent too great.
    radius_mm
        The same in mm; None when the scale is unknown.
    """

    centre_px: tuple[float, float]
    radius_px: float
    radius_mm: float | None


def find_contact(image: TactileImage, *, patch: Patch | None = None, method: str = "symmetry") -> Contact | None:
    """Find the centre and the radius of a round contact.

    Raises `InputError` when ``image`` is no TactileImage or the patch has another shape; `UnknownNameError` when no
    method has that name.

    Parameters
    ----------
    image
        The change of grey level (see `signal`), positive where the probe is pressed.
    patch
        The patch of the contact; that of `segment` when None.
    method
        ``"symmetry"``: the centre of symmetry under half a turn, for signals that grow with pressure or depth;
        ``"edge"``: the circle across which the signal falls steepest, for signals that grow with the slope of the face.

    Returns
    -------
    Contact or None
        None when there is no contact, or it is too small or too cropped to find its centre.

    Examples
    --------
    >>> y, x = np.mgrid[:80, :80]
    >>> ball = np.maximum(0.0, 20.0**2 - (x - 42.3) ** 2 - (y - 36.8) ** 2) / 4.0
    >>> contact = find_contact(TactileImage(grey=ball))
    >>> [round(value, 1) for value in contact.centre_px]
    [42.3, 36.8]
    """
    require_image("image", image)
    require_one_of("contact method", method, CONTACT_METHODS)
    patch = segment(image) if patch is None else patch
    if patch.mask.shape != image.grey.shape:
        raise InputError(f"patch must have the image's shape {image.grey.shape}; got {patch.mask.shape}")
    rows, columns = np.nonzero(patch.mask)
    extent = float(np.sqrt(rows.size / np.pi))
    if extent < LEAST_RADIUS_PX:
        return None
    start = float(columns.mean()), float(rows.mean())
    if method == "edge":
        centre = _steepest_circle(_SlopeField(image, BLUR * extent), start, extent)
    else:
        centre = _symmetry_centre(image, start, extent, BLUR * extent)
    radius = None if centre is None else _steepest_radius(_SlopeField(image, EDGE_BLUR_PX), centre, extent)
    if centre is None or radius is None:
        return None
    side_mm = None if image.mm_per_pixel is None else float(np.sqrt(np.prod(image.mm_per_pixel)))
    return Contact(centre_px=centre, radius_px=radius, radius_mm=None if side_mm is None else radius * side_mm)


def find_colour_contact(
    frame_rgb: NDArray[Any],
    reference_rgb: NDArray[Any],
    *,
    mm_per_pixel: tuple[float, float] | None = None,
) -> Contact | None:
    """Find a round contact in frames whose colour codes the slope of the face (GelSight).

    The patch comes from the magnitude of the change, the circle from the magnitude with the lamps equalised inside it.

    Parameters
    ----------
    frame_rgb, reference_rgb
        The pressed and the untouched probe, shape (rows, columns, channels).
    mm_per_pixel
        Size (x, y) of a pixel in mm; None when unknown.

    Returns
    -------
    Contact or None
        As `find_contact` with ``method="edge"``.
    """
    magnitude = change_magnitude(frame_rgb, reference_rgb)
    equal = change_magnitude(frame_rgb, reference_rgb, equalise_lamps=True)
    patch = segment(TactileImage(grey=magnitude, mm_per_pixel=mm_per_pixel))
    return find_contact(TactileImage(grey=equal, mm_per_pixel=mm_per_pixel), patch=patch, method="edge")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImageFinding:
    """Analysis of an image: its change of grey level, its features, and the round contact or None."""

    image: TactileImage
    change: TactileImage
    features: Features
    contact: Contact | None


def analyse_image(image: TactileImage, reference: TactileImage | None, *, invert: bool) -> ImageFinding:
    """What an image shows without a calibration."""
    found = features(image, reference, invert=invert)
    change = signal(image, reference, invert=invert)
    contact = find_contact(change, patch=found.patch) if found.contact else None
    return ImageFinding(image=image, change=change, features=found, contact=contact)


class _SlopeField:
    """Gradient of the blurred signal on circles of the face; lengths in the side of the square pixel of equal area."""

    def __init__(self, image: TactileImage, blur: float) -> None:
        self.pixel = _pixel_shape(image)
        smooth = _blurred(image.grey, blur, self.pixel)
        self.slope_x: NDArray[np.float32] = _slope(smooth, 1, self.pixel[0])
        self.slope_y: NDArray[np.float32] = _slope(smooth, 0, self.pixel[1])
        angle = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
        self.cos, self.sin = np.cos(angle), np.sin(angle)

    def fall(self, x: float, y: float, radii: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean fall of the signal across circles about (x, y); 0 where less than half of a circle is visible."""
        # A circle on the face is an ellipse in an image whose pixels are not square.
        columns = (x + np.outer(radii, self.cos) / self.pixel[0]).astype(np.float32)
        rows = (y + np.outer(radii, self.sin) / self.pixel[1]).astype(np.float32)
        slope = (
            scipy.ndimage.map_coordinates(self.slope_x, (rows, columns), order=1) * self.cos
            + scipy.ndimage.map_coordinates(self.slope_y, (rows, columns), order=1) * self.sin
        )
        height, width = self.slope_x.shape
        inside = (columns >= 0) & (columns <= width - 1) & (rows >= 0) & (rows <= height - 1)
        visible = inside.sum(axis=1)
        mean: NDArray[np.float64] = -np.where(inside, slope, 0.0).sum(axis=1) / np.maximum(visible, 1)
        return np.where(visible >= LEAST_VISIBLE * DIRECTIONS, mean, 0.0)


def _pixel_shape(image: TactileImage) -> tuple[float, float]:
    """Width and height of a pixel in the side of the square of the same area."""
    width, height = (1.0, 1.0) if image.mm_per_pixel is None else image.mm_per_pixel
    side = float(np.sqrt(width * height))
    return width / side, height / side


def _blurred(grey: NDArray[np.float64], blur: float, pixel: tuple[float, float]) -> NDArray[np.float64]:
    """The signal after a Gaussian blur that is round on the face."""
    return gaussian_blur(grey, (blur / pixel[1], blur / pixel[0]), mode="nearest")


def _slope(smooth: NDArray[np.float64], axis: int, step: float) -> NDArray[np.float32]:
    """Slope along an axis, flat where the image is one pixel wide."""
    if smooth.shape[axis] < 2:
        return np.zeros(smooth.shape, dtype=np.float32)
    return np.asarray(np.gradient(smooth, step, axis=axis), dtype=np.float32)


def _steepest_circle(field: _SlopeField, centre: tuple[float, float], extent: float) -> tuple[float, float] | None:
    """Centre (x, y) of the steepest circle near a patch; None when the signal falls across no circle."""
    start = _coarse(field, centre, extent)
    if start is None:
        return None
    step = 2.0 * CENTRE_RANGE * extent / (COARSE_STEPS - 1)

    def shallowness(circle: NDArray[np.float64]) -> float:
        return -float(field.fall(circle[0], circle[1], circle[2:3])[0])

    return _lowest(shallowness, np.array(start), step, extent=extent, tolerance=1e-6)


def _lowest(
    function: Callable[[NDArray[np.float64]], float],
    start: NDArray[np.float64],
    step: float,
    *,
    extent: float,
    tolerance: float,
) -> tuple[float, float]:
    """Position (x, y) of a minimum, from a simplex of that step at the start."""
    simplex = start + step * np.vstack([np.zeros(len(start)), np.eye(len(start))])
    found = scipy.optimize.minimize(
        function,
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": TOLERANCE * extent, "fatol": tolerance, "maxiter": 400},
    )
    return float(found.x[0]), float(found.x[1])


def _steepest_radius(field: _SlopeField, centre: tuple[float, float], extent: float) -> float | None:
    """Radius of the steepest circle about a given centre; None when the signal falls across none."""
    radii = np.linspace(RADIUS_RANGE[0] * extent, RADIUS_RANGE[1] * extent, FINE_RADII)
    falls = field.fall(*centre, radii)
    best = int(np.argmax(falls))
    return float(radii[best]) if falls[best] > 0.0 else None


def _coarse(field: _SlopeField, centre: tuple[float, float], extent: float) -> tuple[float, float, float] | None:
    """Best (x, y, radius) of a grid."""
    radii = np.linspace(RADIUS_RANGE[0] * extent, RADIUS_RANGE[1] * extent, RADII)
    shifts = np.linspace(-CENTRE_RANGE * extent, CENTRE_RANGE * extent, COARSE_STEPS)
    best, where = 0.0, None
    for x in centre[0] + shifts:
        for y in centre[1] + shifts:
            falls = field.fall(float(x), float(y), radii)
            steepest = int(np.argmax(falls))
            if falls[steepest] > best:
                best, where = float(falls[steepest]), (float(x), float(y), float(radii[steepest]))
    return where


def _symmetry_centre(
    image: TactileImage, centre: tuple[float, float], extent: float, blur: float
) -> tuple[float, float] | None:
    """Centre of symmetry (x, y) near a patch, in pixels; None when too little of it lies inside the image.

    It minimises ``sum (s - s')² / sum (s + s')²`` over a disc on the face, where s is the positive part of the signal
    and s' is s rotated by half a turn: halos darker than the untouched probe belong to no contact.
    """
    pixel = _pixel_shape(image)
    hill = _blurred(np.maximum(image.grey, 0.0), blur, pixel).astype(np.float32)
    offsets = _disc(WINDOW * extent, pixel)
    height, width = hill.shape

    def asymmetry(point: NDArray[np.float64]) -> float:
        columns, rows = ((point[axis] + offsets[axis]).astype(np.float32)[None] for axis in (0, 1))
        values = scipy.ndimage.map_coordinates(hill, (rows[0], columns[0]), order=1).astype(np.float64)
        inside = ((columns >= 0) & (columns <= width - 1) & (rows >= 0) & (rows <= height - 1))[0]
        pair = inside & inside[::-1]
        if np.count_nonzero(pair) < LEAST_COMPARED * pair.size:
            return 1.0
        rotated = values[::-1]
        total = float(np.square(values + rotated)[pair].sum())
        return float(np.square(values - rotated)[pair].sum()) / total if total > 0.0 else 1.0

    shifts = np.linspace(-CENTRE_RANGE * extent, CENTRE_RANGE * extent, COARSE_STEPS)
    starts = [np.array([centre[0] + x, centre[1] + y]) for x in shifts for y in shifts]
    start = min(starts, key=asymmetry)
    if asymmetry(start) >= 1.0:
        return None
    return _lowest(asymmetry, start, float(shifts[1] - shifts[0]), extent=extent, tolerance=1e-12)


def _disc(radius: float, pixel: tuple[float, float]) -> NDArray[np.float64]:
    """Offsets (x and y rows, in pixels) of a grid over a disc; its reverse is the disc rotated by half a turn."""
    step = np.arange(-SAMPLES, SAMPLES + 1) * (radius / SAMPLES)
    x, y = (axis.ravel() for axis in np.meshgrid(step, step))
    inside = np.hypot(x, y) <= radius
    return np.array([x[inside] / pixel[0], y[inside] / pixel[1]])

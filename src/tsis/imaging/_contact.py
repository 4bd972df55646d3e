"""Centre and radius of a round contact; more accurate than a threshold's centroid under uneven light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import InputError
from tsis.imaging._circle import SlopeField, steepest_circle, steepest_radius, symmetry_centre
from tsis.imaging._colour import change_magnitude
from tsis.imaging._corrections import require_image
from tsis.imaging._patch import Patch, segment
from tsis.model import TactileImage, require_one_of

if TYPE_CHECKING:
    from numpy.typing import NDArray


CONTACT_METHODS = ("symmetry", "edge")
BLUR = 0.1  # of the patch's radius, for the centre: it removes noise and preserves symmetry
EDGE_BLUR_PX = 1.5  # for the radius: a wider blur shifts the foot of a rounded hill inwards by 1.5 times its width
LEAST_RADIUS_PX = 2.0  # smaller patches have too few pixels for a radius


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

    Raises
    ------
    InputError
        When ``image`` is no TactileImage or the patch has another shape.
    UnknownNameError
        When no method has that name.

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
        centre = steepest_circle(SlopeField(image, BLUR * extent), start, extent)
    else:
        centre = symmetry_centre(image, start, extent, BLUR * extent)
    radius = None if centre is None else steepest_radius(SlopeField(image, EDGE_BLUR_PX), centre, extent)
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

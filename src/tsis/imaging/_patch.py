"""The bright patch of a contact: its pixels, threshold and outline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage
from skimage.filters import threshold_otsu
from skimage.measure import find_contours

from tsis.imaging._corrections import require_image
from tsis.imaging._filters import gaussian_blur
from tsis.model import freeze_arrays, require_number, require_one_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import TactileImage


SEGMENTATION_METHODS = ("otsu", "half", "noise")
SMOOTH_PX = 1.0  # standard deviation of the blur before thresholds; it shifts edges by less than a pixel
NOISE_FACTOR = 6.0  # the blurred noise of a million pixels peaks near 5 standard deviations
GAUSSIAN_MAD = 1.4826  # standard deviation over median absolute deviation of Gaussian noise
CLEAR_CHANGE = 0.1  # fraction of full scale; larger than any drift of the lamps
QUANTISATION = 12.0**-0.5  # standard deviation of rounding to whole grey levels


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
    """The longest closed boundary of a patch, (n, 2) points (x, y) in pixels.

    It is the level line of the blurred signal at the cut; the mask's pixel edges are some per cent longer. The signal
    is dark outside the image, so that the boundary of a cropped patch closes along the border.
    """
    if not mask.any():
        return np.empty((0, 2))
    peak = float(smooth[mask].max())
    field = np.minimum(smooth, cut - 1e-9 * (peak - cut))
    field[mask] = np.where(smooth[mask] > cut, smooth[mask], peak)
    curves = find_contours(np.pad(field, 1, constant_values=2.0 * cut - peak), cut)  # type: ignore[no-untyped-call]
    longest: NDArray[np.float64] = max(curves, key=len)[:, ::-1] - 1.0
    return longest


def pixel_noise(grey: NDArray[np.float64]) -> float:
    """Standard deviation of one pixel's noise, grey levels.

    It comes from second differences along both axes, with weights (1 -2 1) x (1 -2 1) of norm 6. Slopes and smooth
    patches do not contribute, so it needs no untouched area.
    """
    if min(grey.shape) < 3:
        return 0.0
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
    first = float(threshold_otsu(lit))  # type: ignore[no-untyped-call]
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
    labels, count = ndimage.label(above)
    if count == 0:
        return above
    strength = np.bincount(labels[above], weights=smooth[above] - cut, minlength=count + 1)
    filled: NDArray[np.bool] = ndimage.binary_fill_holes(labels == int(np.argmax(strength)))
    return filled

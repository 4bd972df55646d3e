"""Drift of the lamps, read from a reference patch outside every contact, and its correction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tsis.calibration._measured import MeasuredValue
from tsis.errors import InputError
from tsis.imaging import pixel_noise, require_image, require_same_frame
from tsis.model import require_integer, require_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import TactileImage


LEAST_LIT = 0.02  # of full scale: a darker patch shows the black level, not the lamps
LEAST_PIXELS = 16
ROUNDING = 12.0**-0.5  # standard deviation of rounding to whole grey levels

PixelBox = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferencePatch:
    """A rectangle of the frame that the lamps light outside every contact.

    Raises `InputError` when the ends do not ascend or hold too few pixels.

    Parameters
    ----------
    first_row, last_row, first_column, last_column
        Its ends in pixels, the last ones excluded; at least 16 pixels together.

    Examples
    --------
    >>> ReferencePatch(first_row=0, last_row=20, first_column=700, last_column=768).pixels
    1360
    """

    first_row: int
    last_row: int
    first_column: int
    last_column: int

    def __post_init__(self) -> None:
        for first, last in (("first_row", "last_row"), ("first_column", "last_column")):
            start = require_integer(first, getattr(self, first), 0, 65534, hint="pixels")
            end = require_integer(last, getattr(self, last), start + 1, 65535, hint="pixels, beyond the first")
            object.__setattr__(self, first, start)
            object.__setattr__(self, last, end)
        if self.pixels < LEAST_PIXELS:
            raise InputError(f"a reference patch must hold at least {LEAST_PIXELS} pixels; got {self.pixels}")

    @classmethod
    def from_px(cls, patch_px: PixelBox) -> Self:
        """The patch from (left, top, right, bottom) in pixels, right and bottom excluded, as in files.

        Examples
        --------
        >>> ReferencePatch.from_px((700, 0, 768, 20)).pixels
        1360
        """
        if len(patch_px) != 4:
            raise InputError(f"patch_px must hold left, top, right, bottom; got {patch_px!r:.80}")
        left, top, right, bottom = patch_px
        return cls(first_row=top, last_row=bottom, first_column=left, last_column=right)

    @property
    def patch_px(self) -> PixelBox:
        """Left, top, right, bottom."""
        return self.first_column, self.first_row, self.last_column, self.last_row

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return (self.last_row - self.first_row) * (self.last_column - self.first_column)

    def of(self, image: TactileImage) -> TactileImage:
        """The patch of a frame; `InputError` when it extends beyond the frame."""
        require_image("image", image)
        self.require_inside(image.grey.shape)
        return replace(image, grey=self.cut(image.grey), axis_px=None)

    def require_inside(self, shape: tuple[int, ...]) -> None:
        """Refuse a frame of (rows, columns) that does not contain the patch."""
        rows, columns = shape
        if self.last_row > rows or self.last_column > columns:
            raise InputError(
                f"reference patch must lie inside the frame of {rows} x {columns} pixels; it ends at row "
                f"{self.last_row}, column {self.last_column}"
            )

    def cut(self, pixels: NDArray[Any]) -> NDArray[Any]:
        """The patch of an array of shape (..., rows, columns); a view."""
        return pixels[..., self.first_row : self.last_row, self.first_column : self.last_column]


def require_lit(light_grey: float, full_scale: float) -> None:
    """Refuse a patch so near the dark level that it shows the black level, not the lamps."""
    if light_grey < LEAST_LIT * full_scale:
        raise InputError(
            f"reference patch must be lit by at least {LEAST_LIT:.0%} of full scale to follow the lamps; it is "
            f"{light_grey:.3g} grey levels above dark: choose a part of the frame that the lamps light"
        )


def patch_ratio(
    image: TactileImage, reference: TactileImage, *, patch: ReferencePatch, dark_grey: float = 0.0
) -> MeasuredValue:
    """Brightness of the lamps relative to the reference.

    Parameters
    ----------
    image, reference
        Raw frames of one camera and mode; the patch is untouched in both.
    patch
        Part of the frame that is compared.
    dark_grey
        Camera level without light, grey levels; includes ambient light that is the same in both.

    Returns
    -------
    MeasuredValue
        Ratio of the patch's means above ``dark_grey``, with the uncertainty from noise and rounding of the pixels.

    Raises
    ------
    InputError
        When the patch leaves the frame, is clipped, or is too dark to show the lamps.
    ImageMismatchError
        When the frames differ in size, scale or full scale.

    Examples
    --------
    >>> from tsis.model import TactileImage
    >>> before, after = (TactileImage(grey=np.full((40, 40), grey)) for grey in (100.0, 103.0))
    >>> corner = ReferencePatch(first_row=0, last_row=10, first_column=0, last_column=10)
    >>> round(patch_ratio(after, before, patch=corner).value, 4)
    1.03
    """
    require_same_frame(image, reference, "reference")
    require_number("dark_grey", dark_grey, 0.0, image.full_scale)
    now, now_sd = _level("image", image, patch, dark_grey)
    before, before_sd = _level("reference", reference, patch, dark_grey)
    require_lit(before, reference.full_scale)
    ratio = now / before
    return MeasuredValue(value=ratio, sd=float(np.hypot(now_sd, ratio * before_sd)) / before)


def _level(name: str, image: TactileImage, patch: ReferencePatch, dark_grey: float) -> tuple[float, float]:
    """Mean of the patch above dark and its standard deviation."""
    grey = patch.of(image).grey
    clipped = int(np.count_nonzero(grey >= image.full_scale))
    if clipped:
        raise InputError(f"reference patch of the {name} must not be clipped; {clipped} of {grey.size} pixels are")
    noise = max(pixel_noise(grey), ROUNDING)
    return float(grey.mean()) - dark_grey, noise / float(np.sqrt(grey.size))


def drift_corrected(image: TactileImage, ratio: MeasuredValue | float, *, dark_grey: float = 0.0) -> TactileImage:
    """Scale the light of a frame to the lamps of the reference, by the ratio of `patch_ratio`.

    Raises `InputError` when the ratio or the dark level lies outside its range.

    Parameters
    ----------
    image
        A raw camera frame.
    ratio
        Of the lamps to those of the reference, in [0.05, 20].
    dark_grey
        Camera level without light, grey levels; it does not drift with the lamps.

    Returns
    -------
    TactileImage
        ``dark_grey + (image - dark_grey) / ratio``. Test the original frame for clipped pixels.

    Examples
    --------
    >>> from tsis.model import TactileImage
    >>> float(drift_corrected(TactileImage(grey=np.full((8, 8), 103.0)), 1.03).grey.max())
    100.0
    """
    require_image("image", image)
    value = require_number("ratio", ratio.value if isinstance(ratio, MeasuredValue) else ratio, 0.05, 20.0)
    require_number("dark_grey", dark_grey, 0.0, image.full_scale)
    return replace(image, grey=dark_grey + (image.grey - dark_grey) / value)

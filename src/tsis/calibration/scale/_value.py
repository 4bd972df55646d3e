"""The size of a pixel on the face, along each axis of the image."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration._measured import MeasuredValue
from tsis.errors import CalibrationError, ImageMismatchError, InputError
from tsis.imaging import SCALE_TOLERANCE
from tsis.model.image import LARGEST_PIXEL_MM, SMALLEST_PIXEL_MM, TactileImage
from tsis.model.require import require_integer, require_number, require_one_of, require_pair, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence


METHODS = ("dots", "ball")
FIELD_MM = (5.0, 150.0)  # of the longer side of the picture: from fingertip to palm
UNIT = "mm/px"


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelScale:
    """The size of a pixel on the face, along each axis of the image.

    Raises `InputError` when a value lies outside its range.

    Parameters
    ----------
    mm_per_pixel_x, mm_per_pixel_y
        Length on the face of one step to the next column and of one to the next row, mm/px, each with its standard
        uncertainty.
    shape
        Size (rows, columns) of the frames.
    at_px
        Image position (x, y) of the measurement; a lens with distortion has another scale elsewhere.
    method
        ``"dots"`` or ``"ball"``.
    count
        Number of dots, or of presses of the ball.
    residual_px
        Root mean square distance of the dots from the fit, pixels; 0 for a ball, whose residuals are grey levels.
    rotation_deg
        Angle in degrees from the image's x axis, towards its y axis, to the nearest axis of the dot board, in
        [-45, 45]; 0 for a ball.
    skew_deg
        Departure of the image's two axes from a right angle on the face, degrees; 0 for a ball, which assumes one.

    Examples
    --------
    >>> size = MeasuredValue(value=0.05, sd=0.0001, unit="mm/px")
    >>> scale = PixelScale(
    ...     mm_per_pixel_x=size, mm_per_pixel_y=size, shape=(480, 640), at_px=(319.5, 239.5), method="dots", count=63
    ... )
    >>> scale.mm_per_pixel
    (0.05, 0.05)
    """

    mm_per_pixel_x: MeasuredValue
    mm_per_pixel_y: MeasuredValue
    shape: tuple[int, int]
    at_px: tuple[float, float]
    method: str
    count: int
    residual_px: float = 0.0
    rotation_deg: float = 0.0
    skew_deg: float = 0.0

    def __post_init__(self) -> None:
        for name in ("mm_per_pixel_x", "mm_per_pixel_y"):
            size = getattr(self, name)
            require_type(name, size, MeasuredValue)
            require_number(name, size.value, SMALLEST_PIXEL_MM, LARGEST_PIXEL_MM, hint="millimetres per pixel")
            if size.unit != UNIT:
                raise InputError(f"{name} must be in {UNIT}; got {size.unit!r}")
        if not isinstance(self.shape, (tuple, list)) or len(self.shape) != 2:
            raise InputError(f"shape must hold rows and columns; got {self.shape!r}")
        rows, columns = (require_integer("shape", side, 1, 65536) for side in self.shape)
        object.__setattr__(self, "shape", (rows, columns))
        object.__setattr__(self, "at_px", require_pair("at_px", self.at_px))
        require_one_of("method of a scale", self.method, METHODS)
        object.__setattr__(self, "count", require_integer("count", self.count, 1, 10**6))
        require_number("residual_px", self.residual_px, 0.0, 1e4, hint="pixels")
        require_number("rotation_deg", self.rotation_deg, -45.0, 45.0, hint="degrees")
        require_number("skew_deg", self.skew_deg, -90.0, 90.0, hint="degrees")

    @property
    def mm_per_pixel(self) -> tuple[float, float]:
        """Size (x, y) of a pixel on the face, mm, for `TactileImage`."""
        return self.mm_per_pixel_x.value, self.mm_per_pixel_y.value

    def on(self, image: TactileImage) -> TactileImage:
        """The frame with this scale.

        Raises
        ------
        ImageMismatchError
            When the frame differs in size from those of the measurement, or has another scale.
        """
        require_type("image", image, TactileImage)
        if image.grey.shape != self.shape:
            raise ImageMismatchError(
                f"image must have the shape {self.shape} that the scale was measured on; got {image.grey.shape} "
                "(measure the scale in the camera mode that you use)"
            )
        theirs = image.mm_per_pixel
        if theirs is not None and not np.allclose(theirs, self.mm_per_pixel, rtol=SCALE_TOLERANCE, atol=0.0):
            ours = " x ".join(f"{size:.4g}" for size in self.mm_per_pixel)
            raise ImageMismatchError(
                f"image must have the calibration's scale of {ours} mm per pixel; got "
                f"{' x '.join(f'{size:.4g}' for size in theirs)} (give the calibration of the probe that took it)"
            )
        return replace(image, mm_per_pixel=self.mm_per_pixel)


def check_field(mm_per_pixel: Sequence[float], shape: tuple[int, ...], length: str, value_mm: float) -> None:
    """Refuse a scale that is impossible for a tactile probe, mostly because of a length in another unit."""
    field = max(mm_per_pixel[0] * shape[1], mm_per_pixel[1] * shape[0])
    if not FIELD_MM[0] <= field <= FIELD_MM[1]:
        raise CalibrationError(
            f"{length} must be in millimetres: with {value_mm:g} mm the picture would be {field:.3g} mm wide, and a "
            f"probe's is {FIELD_MM[0]:g} to {FIELD_MM[1]:g} mm (is it in another unit, or another board's?)"
        )

"""One frame of the camera, with what is needed to read it in millimetres."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.model import check
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

SMALLEST_PIXEL_MM, LARGEST_PIXEL_MM = 1e-4, 10.0


def pixel_scale(value: tuple[float, float]) -> tuple[float, float]:
    """Check a pair (x, y) of mm per pixel."""
    x, y = (
        check.number("mm_per_pixel", part, SMALLEST_PIXEL_MM, LARGEST_PIXEL_MM, hint="millimetres per pixel")
        for part in check.array("mm_per_pixel", value, ndim=1)
    )
    return x, y


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TactileImage:
    """A grey frame of the pressed probe.

    Parameters
    ----------
    grey
        Grey levels, shape (rows, columns), finite; kept as a read-only array of its own dtype family
        (floating point after corrections).
    mm_per_pixel
        Size (x, y) of a pixel on the face in mm; None when nobody measured it.
    full_scale
        Grey level at which the camera clips, 255 for 8 bits.
    force_n
        Force of the press in newtons as the gauge read it; None when unknown.
    axis_px
        Where the probe's axis meets the image, (x, y) in pixels; the image's centre when None.
    name
        What reports call it, e.g. the file's name.
    settings
        What the camera was set to, for provenance.

    Raises
    ------
    InputError
        When the frame is empty, not two-dimensional or not finite, or a value lies outside its range.
    """

    grey: NDArray[np.float64]
    mm_per_pixel: tuple[float, float] | None = None
    full_scale: float = 255.0
    force_n: float | None = None
    axis_px: tuple[float, float] | None = None
    name: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "grey", check.array("grey", self.grey, ndim=2))
        check.number("full_scale", self.full_scale, 1.0, 65535.0)
        if self.mm_per_pixel is not None:
            object.__setattr__(self, "mm_per_pixel", pixel_scale(self.mm_per_pixel))
        if self.force_n is not None:
            check.number("force_n", self.force_n, 0.0, 100.0, hint="newtons")
        if self.axis_px is None:
            rows, columns = self.grey.shape
            object.__setattr__(self, "axis_px", ((columns - 1) / 2, (rows - 1) / 2))
        elif len(self.axis_px) != 2 or not np.all(np.isfinite(self.axis_px)):
            raise InputError(f"axis_px must hold two finite numbers (x, y); got {self.axis_px!r}")
        object.__setattr__(self, "settings", MappingProxyType(dict(self.settings)))

    def scale(self) -> tuple[float, float]:
        """The pixel size (x, y) in mm, or a clear error when it is unknown."""
        if self.mm_per_pixel is None:
            raise InputError("mm_per_pixel is not known for this image; give the size of a pixel in millimetres")
        return self.mm_per_pixel

"""A camera frame with the scale of its pixels."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import InputError
from tsis.model._content import ContentValue
from tsis.model._exchange import grey_for_xarray, summary_html, thumbnail
from tsis.model._require import freeze_mappings, require_array, require_number, require_pair

if TYPE_CHECKING:
    from numpy.typing import NDArray


SMALLEST_PIXEL_MM, LARGEST_PIXEL_MM = 1e-4, 10.0
LARGEST_GREY = 1e9  # beyond any sensor, and its square is finite


def require_pixel_scale(value: tuple[float, float]) -> tuple[float, float]:
    """Check a pair (x, y) of mm per pixel."""
    x, y = (
        require_number("mm_per_pixel", part, SMALLEST_PIXEL_MM, LARGEST_PIXEL_MM, hint="millimetres per pixel")
        for part in require_pair("mm_per_pixel", value)
    )
    return x, y


def require_image_numbers(
    *,
    full_scale: float,
    mm_per_pixel: tuple[float, float] | None,
    force_n: float | None,
    axis_px: tuple[float, float] | None,
) -> None:
    """Check the ranges; parameters as in `TactileImage`."""
    require_number("full_scale", full_scale, 1.0, 65535.0)
    if mm_per_pixel is not None:
        require_pixel_scale(mm_per_pixel)
    if force_n is not None:
        require_number("force_n", force_n, 0.0, 100.0, hint="newtons")
    if axis_px is not None:
        for position in require_pair("axis_px", axis_px):
            require_number("axis_px", position, -1e6, 1e6, hint="pixels")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TactileImage(ContentValue):
    """A grey frame of the pressed probe.

    Parameters
    ----------
    grey
        Grey levels, shape (rows, columns), finite; stored as a read-only float64 copy.
    mm_per_pixel
        Size (x, y) of a pixel on the face in mm; None where unknown.
    full_scale
        Grey level at which the camera clips, 255 for 8 bits.
    force_n
        Measured force of the press in newtons; None where unknown.
    axis_px
        Position (x, y) of the probe's axis in the image in pixels; the centre of the image when None.
    name
        Name in reports, e.g. that of the file.
    settings
        Camera settings, for provenance.

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
        grey = require_array("grey", self.grey, ndim=2)
        if np.abs(grey).max() > LARGEST_GREY:
            raise InputError(f"grey must lie within +-{LARGEST_GREY:g} grey levels; got {np.abs(grey).max():g}")
        object.__setattr__(self, "grey", grey)
        require_image_numbers(
            full_scale=self.full_scale, mm_per_pixel=self.mm_per_pixel, force_n=self.force_n, axis_px=self.axis_px
        )
        if self.mm_per_pixel is not None:
            object.__setattr__(self, "mm_per_pixel", require_pixel_scale(self.mm_per_pixel))
        rows, columns = grey.shape
        centre = ((columns - 1) / 2, (rows - 1) / 2)
        object.__setattr__(self, "axis_px", centre if self.axis_px is None else require_pair("axis_px", self.axis_px))
        if not isinstance(self.settings, Mapping):
            raise InputError(f"settings must be a mapping of names to values; got {self.settings!r:.80}")
        freeze_mappings(self, "settings")

    def axis(self) -> tuple[float, float]:
        """Position (x, y) of the probe's axis in the image in pixels."""
        assert self.axis_px is not None  # set in __post_init__
        return self.axis_px

    def scale(self) -> tuple[float, float]:
        """The pixel size (x, y) in mm; `InputError` when it is unknown."""
        if self.mm_per_pixel is None:
            raise InputError("mm_per_pixel is not known for this image; give the size of a pixel in millimetres")
        return self.mm_per_pixel

    def to_xarray(self) -> Any:
        """The grey levels as an ``xarray.DataArray`` with the dimensions ``y`` and ``x``.

        Coordinates are in mm from the probe's axis, or in pixels where the scale is unknown. `image_from_xarray` gives
        the image back. Raises `MissingExtraError` without the extra ``analysis``.
        """
        force = {} if self.force_n is None else {"force_n": self.force_n}
        return grey_for_xarray(
            self.grey,
            axis_px=self.axis(),
            mm_per_pixel=self.mm_per_pixel,
            attributes={
                **force,
                "full_scale": self.full_scale,
                "frame": self.name,
                "settings": json.dumps(dict(self.settings), default=str),
            },
        )

    def _repr_html_(self) -> str:
        """A small picture with size, scale and force."""
        rows, columns = self.grey.shape
        scale = "unknown" if self.mm_per_pixel is None else " x ".join(f"{size:.4g}" for size in self.mm_per_pixel)
        entries = [
            ("pixels", f"{columns} x {rows}"),
            ("mm per pixel", scale),
            ("force", "unknown" if self.force_n is None else f"{self.force_n:.4g} N"),
            ("grey levels", f"{self.grey.min():.4g} to {self.grey.max():.4g} of {self.full_scale:g}"),
        ]
        return summary_html(self.name or "TactileImage", entries, picture=thumbnail(self.grey, self.full_scale))

"""A camera frame with the scale of its pixels; series of frames that fit each other and the calibration."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import ImageMismatchError, InputError, NotCalibratedError, import_extra
from tsis.model.calibration import Calibration
from tsis.model.content import ContentValue
from tsis.model.exchange import EXTRA, grey_for_xarray, summary_html, thumbnail
from tsis.model.probe import Probe
from tsis.model.require import freeze_mappings, require_array, require_number, require_pair, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

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


def as_images(name: str, images: TactileImage | Sequence[TactileImage] | None) -> list[TactileImage]:
    """An image, several or None as a list; `InputError` for any other type."""
    if images is None:
        return []
    if isinstance(images, TactileImage):
        return [images]
    frames = list(images) if isinstance(images, Iterable) else [images]
    for frame in frames:
        if not isinstance(frame, TactileImage):
            raise InputError(f"{name} must hold TactileImage values; got {type(frame).__name__}")
    return frames


def require_same_probe(probe: Probe, calibration: Calibration) -> None:
    """Check that there is a calibration of this probe.

    Raises
    ------
    InputError
        When ``probe`` is no `Probe`.
    NotCalibratedError
        When ``calibration`` is no `Calibration`, or both names are known and differ.
    """
    require_type("probe", probe, Probe)
    if not isinstance(calibration, Calibration):
        raise NotCalibratedError(
            f"calibration must be a Calibration, the response of this probe to pressure; got {calibration!r:.80}"
        )
    if calibration.probe and probe.name and calibration.probe != probe.name:
        raise NotCalibratedError(
            f"calibration must be that of the probe {probe.name!r}; got one of {calibration.probe!r}: calibrate this "
            "probe, or give the one that was calibrated"
        )


def require_frames_of_probe(frames: Sequence[TactileImage], probe: Probe) -> None:
    """Refuse, with `ImageMismatchError`, frames whose settings name another probe."""
    for frame in frames:
        other = frame.settings.get("probe")
        if other and probe.name and other != probe.name:
            raise ImageMismatchError(
                f"images must be of the probe {probe.name!r:.80}; {frame.name or 'an image'!r} was taken with "
                f"{other!r:.80}: give the probe and the calibration that belong to the frame"
            )


def require_image_series(frames: list[TactileImage]) -> list[str]:
    """Check that the frames have a force and a scale, fit each other, and differ.

    Returns
    -------
    `grey_sha256` of each.

    Raises
    ------
    InputError
        When a force or a scale is unknown, or a frame occurs twice.
    ImageMismatchError
        When the frames differ in shape, scale, axis or range of values, or grey and colour files are mixed.
    """
    first, digests = frames[0], list[str]()
    for frame in frames:
        label = frame.name or "an image"
        if not frame.force_n:
            raise InputError(f"force_n must be known and positive for {label!r}; got {frame.force_n!r}")
        if frame.scale() != first.scale() or frame.full_scale != first.full_scale:
            raise ImageMismatchError(
                f"all images must share mm_per_pixel {first.mm_per_pixel} and full_scale {first.full_scale:g}; "
                f"{label!r} has {frame.mm_per_pixel} and {frame.full_scale:g}"
            )
        if frame.grey.shape != first.grey.shape or frame.axis_px != first.axis_px:
            raise ImageMismatchError(
                f"all images must share the shape {first.grey.shape} and axis_px {first.axis_px}; "
                f"{label!r} has {frame.grey.shape} and {frame.axis_px}"
            )
        kind, other = first.settings.get("kind"), frame.settings.get("kind")
        if kind and other and kind != other:
            raise ImageMismatchError(
                f"all images must be {kind} files; {label!r} is a {other} one, of another camera or mode: record all "
                "in one mode"
            )
        digest = grey_sha256(frame.grey)
        if digest in digests:
            raise InputError(f"images must be different frames; {label!r} is given twice, which tells nothing new")
        digests.append(digest)
    return digests


def grey_sha256(grey: NDArray[np.floating[Any]]) -> str:
    """SHA-256 of grey levels in single precision, exact for 16 bits; it identifies a frame in estimates."""
    return hashlib.sha256(grey.astype(np.float32).data).hexdigest()


SPACING = 1e-6  # largest relative difference of two distances of pixels


def image_stack(images: Sequence[TactileImage]) -> Any:
    """Images of one shape and scale as an `xarray.DataArray` with the dimensions ``press``, ``y`` and ``x``.

    The coordinates ``x`` and ``y`` are those of `TactileImage.to_xarray`; ``force_n`` (NaN where unknown) and ``frame``
    lie along ``press``.

    Raises
    ------
    MissingExtraError
        Without the extra ``analysis``.
    InputError
        When there is no image.
    ImageMismatchError
        When shape, scale, axis or full scale differ.
    """
    xarray = import_extra("xarray", feature="a stack of images for xarray", extra=EXTRA)
    if not images:
        raise InputError("images must hold at least one TactileImage; got none")
    first = images[0]
    for image in images[1:]:
        for name, value, other in (
            ("the shape", first.grey.shape, image.grey.shape),
            *((name, getattr(first, name), getattr(image, name)) for name in ("mm_per_pixel", "axis_px", "full_scale")),
        ):
            if value != other:
                raise ImageMismatchError(f"images of a stack must share {name} {value}; {image.name!r:.60} has {other}")
    stack = xarray.concat([image.to_xarray() for image in images], dim="press", combine_attrs="drop_conflicts")
    forces = [np.nan if image.force_n is None else image.force_n for image in images]
    stack.attrs.pop("force_n", None)
    return stack.assign_coords(
        force_n=("press", forces, {"units": "N"}), frame=("press", [image.name for image in images])
    )


def image_from_xarray(array: Any) -> TactileImage:
    """The image of an array of `TactileImage.to_xarray` or of a part of it, or of any with the dimensions y and x.

    Scale and axis follow from the coordinates, which must be evenly spaced; those without the unit mm are pixels.
    Raises `InputError` when they are not, or for other dimensions.
    """
    dims = getattr(array, "dims", type(array).__name__)
    if dims != ("y", "x"):
        raise InputError(f"array must have the dimensions ('y', 'x'); got {dims!r:.80}")
    attributes = dict(array.attrs)
    scale, axis = _grid(array)
    rounded = attributes.get("axis_px"), attributes.get("mm_per_pixel")
    if axis is not None and rounded[0] is not None and np.allclose(axis, rounded[0], rtol=0.0, atol=SPACING):
        axis = _pair(rounded[0])
    if scale is not None and rounded[1] is not None and np.allclose(scale, rounded[1], rtol=SPACING):
        scale = _pair(rounded[1])
    return TactileImage(
        grey=np.asarray(array),
        mm_per_pixel=scale,
        axis_px=axis,
        full_scale=float(attributes.get("full_scale", 255.0)),
        force_n=None if attributes.get("force_n") is None else float(attributes["force_n"]),
        name=str(attributes.get("frame", "")),
        settings=json.loads(attributes.get("settings", "{}")),
    )


def _pair(values: Any) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _grid(array: Any) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Scale (x, y) in mm and the position of the axis in pixels, None where the coordinates do not tell."""
    if not {"x", "y"} <= set(array.coords):
        return None, None
    (step_x, first_x), (step_y, first_y) = (_spacing(name, np.asarray(array[name])) for name in ("x", "y"))
    axis = (-first_x / step_x, -first_y / step_y)
    return (step_x, step_y) if array["x"].attrs.get("units") == "mm" else None, axis


def _spacing(name: str, values: NDArray[Any]) -> tuple[float, float]:
    """Distance of the pixels, and the first one."""
    steps = np.diff(values)
    if not len(steps) or steps[0] <= 0 or np.ptp(steps) > SPACING * steps[0]:
        raise InputError(f"the coordinate {name} must ascend by equal steps of at least two pixels; it does not")
    return float((values[-1] - values[0]) / len(steps)), float(values[0])

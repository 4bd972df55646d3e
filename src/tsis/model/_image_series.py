"""Series of images: checks that they fit each other and the calibration, and stacks for xarray."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import ImageMismatchError, InputError, NotCalibratedError, import_extra
from tsis.model._calibration import Calibration
from tsis.model._exchange import EXTRA
from tsis.model._image import TactileImage
from tsis.model._probe import Probe
from tsis.model._require import require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


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
            f"calibration must be a Calibration, the response of this probe to pressure; got {calibration!r}"
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

"""Checks that images fit each other and that a calibration fits the probe."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import ImageMismatchError, InputError, NotCalibratedError
from tsis.model._calibration import Calibration
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
        When the frames differ in shape, scale, axis or range of values.
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
        digest = grey_sha256(frame.grey)
        if digest in digests:
            raise InputError(f"images must be different frames; {label!r} is given twice, which tells nothing new")
        digests.append(digest)
    return digests


def grey_sha256(grey: NDArray[np.floating[Any]]) -> str:
    """SHA-256 of grey levels in single precision, exact for 16 bits; it identifies a frame in estimates."""
    return hashlib.sha256(grey.astype(np.float32).data).hexdigest()

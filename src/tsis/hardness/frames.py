"""Which frames may be read together, and what they say of the object's size."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from tsis.hardness.exploration import RadiusBelief
from tsis.hardness.seen_sphere import check_size
from tsis.hardness.table_build import WIDEST_SHARE
from tsis.model import Calibration, Probe, TactileImage, check
from tsis.model.errors import ImageMismatchError, InputError, NotCalibratedError

if TYPE_CHECKING:
    from collections.abc import Sequence

RADIUS_SD_MM = 0.03  # of a radius that somebody measured without saying how well: a calliper's
BALL_SD_MM = 0.003  # of a rigid ball without a stated one: bearing balls are rounder


def as_frames(name: str, given: TactileImage | Sequence[TactileImage] | None) -> list[TactileImage]:
    """One image, several or none as a list."""
    if given is None:
        return []
    frames = [given] if isinstance(given, TactileImage) or not isinstance(given, Iterable) else list(given)
    for frame in frames:
        check.kind(f"each of {name}", frame, TactileImage)
    return frames


def check_belonging(probe: Probe, calibration: Calibration) -> None:
    """Refuse a missing calibration, or one of another probe."""
    check.kind("probe", probe, Probe)
    if not isinstance(calibration, Calibration):
        raise NotCalibratedError(
            f"calibration must be a Calibration, the answer of this probe's grey level to pressure; got {calibration!r}"
        )
    if calibration.probe and probe.name and calibration.probe != probe.name:
        raise NotCalibratedError(
            f"calibration must be that of the probe {probe.name!r}; got one of {calibration.probe!r}: calibrate this "
            "probe, or give the one that was calibrated"
        )


def check_frames(frames: list[TactileImage], probe: Probe) -> list[str]:
    """Refuse frames of unknown force or scale, of another probe, that do not belong together or are given twice.

    Returns
    -------
    SHA-256 of the grey levels of each, in single precision, which holds 16 bits exactly.
    """
    first, seen = frames[0], list[str]()
    for frame in frames:
        label = frame.name or "an image"
        if not frame.force_n:
            raise InputError(f"force_n must be known and positive for {label!r}; got {frame.force_n!r}")
        if _camera(frame) != _camera(first):
            raise ImageMismatchError(
                "all images must share shape, mm_per_pixel, full_scale and axis_px, which are "
                f"{_camera(first)}; {label!r} has {_camera(frame)}"
            )
        other = frame.settings.get("probe")
        if other and probe.name and other != probe.name:
            raise ImageMismatchError(f"images must be of the probe {probe.name!r}; {label!r} was taken with {other!r}")
        digest = hashlib.sha256(frame.grey.astype(np.float32).data).hexdigest()
        if digest in seen:
            raise InputError(f"images must be different frames; {label!r} is given twice, which tells nothing new")
        seen.append(digest)
    return seen


def _camera(frame: TactileImage) -> tuple[object, ...]:
    return frame.grey.shape, frame.scale(), frame.full_scale, frame.axis()


def radius_belief(
    probe: Probe, frames: list[TactileImage], radius_mm: float | None, radius_sd_mm: float | None
) -> RadiusBelief:
    """What is known of the object's radius, by the caller or else by the frames."""
    largest = WIDEST_SHARE * probe.radius_mm
    if radius_mm is None:
        radius_mm, written_sd = _written(frames)
        radius_sd_mm = written_sd if radius_sd_mm is None else radius_sd_mm
    if radius_mm is None:
        return RadiusBelief(radius_mm=None, sd_mm=0.0, largest_mm=largest)
    sd = RADIUS_SD_MM if radius_sd_mm is None else radius_sd_mm
    _check_radius("radius_mm", probe, radius_mm)
    check.number(
        "radius_sd_mm",
        sd,
        0.0,
        radius_mm / 10,
        hint="millimetres, up to a tenth of the radius; leave both out where it is unknown",
    )
    return RadiusBelief(radius_mm=radius_mm, sd_mm=sd, largest_mm=largest)


def ball_radius(probe: Probe, balls: list[TactileImage], radius_mm: float | None) -> tuple[float, float]:
    """Radius in mm of the rigid ball of the reference presses, and its relative standard deviation."""
    sd_mm: float | None = None
    if radius_mm is None:
        radius_mm, sd_mm = _written(balls)
    if radius_mm is None:
        raise InputError("reference_radius_mm must be given, the radius of the rigid ball; no frame says it")
    _check_radius("reference_radius_mm", probe, radius_mm)
    return radius_mm, (BALL_SD_MM if sd_mm is None else sd_mm) / radius_mm


def _check_radius(name: str, probe: Probe, radius_mm: float) -> None:
    check.number(name, radius_mm, 1.0, 50.0, hint="millimetres")
    check_size(probe, radius_mm)


def _written(frames: list[TactileImage]) -> tuple[float | None, float | None]:
    """Radius and standard deviation that the frames carry, which must agree."""
    said = {(frame.settings.get("radius_mm"), frame.settings.get("radius_sd_mm")) for frame in frames}
    if len(said) > 1:
        raise ImageMismatchError(
            f"all images must be of one object; their settings say (radius_mm, radius_sd_mm) {sorted(said, key=str)}"
        )
    radius, sd = said.pop()
    if radius is not None:
        radius = check.number("radius_mm of the settings", radius, 1e-3, 1e3)
    if sd is not None:
        sd = check.number("radius_sd_mm of the settings", sd, 0.0, 1e3)
    return radius, sd

"""Which frames may be read together, and what they say of the object's size."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.hardness.exploration import RadiusPrior
from tsis.hardness.seen_sphere import require_small_sphere
from tsis.hardness.table_build import WIDEST_SHARE
from tsis.model.check import require_number
from tsis.model.errors import ImageMismatchError, InputError

if TYPE_CHECKING:
    from tsis.model import Probe, TactileImage

RADIUS_SD_MM = 0.03  # of a radius that somebody measured without saying how well: a calliper's
BALL_SD_MM = 0.003  # of a rigid ball without a stated one: bearing balls are rounder


def require_frames_of_probe(frames: list[TactileImage], probe: Probe) -> None:
    """Refuse frames that say they were taken with another probe."""
    for frame in frames:
        other = frame.settings.get("probe")
        if other and probe.name and other != probe.name:
            raise ImageMismatchError(
                f"images must be of the probe {probe.name!r}; {frame.name or 'an image'!r} was taken with {other!r}"
            )


def radius_prior(
    probe: Probe, frames: list[TactileImage], radius_mm: float | None, radius_sd_mm: float | None
) -> RadiusPrior:
    """What is known of the object's radius, by the caller or else by the frames."""
    largest = WIDEST_SHARE * probe.radius_mm
    if radius_mm is None:
        radius_mm, written_sd = _written(frames)
        radius_sd_mm = written_sd if radius_sd_mm is None else radius_sd_mm
    if radius_mm is None:
        return RadiusPrior(radius_mm=None, sd_mm=0.0, largest_mm=largest)
    sd = RADIUS_SD_MM if radius_sd_mm is None else radius_sd_mm
    require_radius("radius_mm", probe, radius_mm)
    require_number(
        "radius_sd_mm",
        sd,
        0.0,
        radius_mm / 10,
        hint="millimetres, up to a tenth of the radius; leave both out where it is unknown",
    )
    return RadiusPrior(radius_mm=radius_mm, sd_mm=sd, largest_mm=largest)


def ball_radius(probe: Probe, balls: list[TactileImage], radius_mm: float | None) -> tuple[float, float]:
    """Radius in mm of the rigid ball of the reference presses, and its relative standard deviation."""
    sd_mm: float | None = None
    if radius_mm is None:
        radius_mm, sd_mm = _written(balls)
    if radius_mm is None:
        raise InputError("reference_radius_mm must be given, the radius of the rigid ball; no frame says it")
    require_radius("reference_radius_mm", probe, radius_mm)
    return radius_mm, (BALL_SD_MM if sd_mm is None else sd_mm) / radius_mm


def require_radius(name: str, probe: Probe, radius_mm: float) -> None:
    """Refuse what is no radius of an object that this probe can measure, in mm; `InputError` names it."""
    require_number(name, radius_mm, 1.0, 50.0, hint="millimetres")
    require_small_sphere(probe, radius_mm)


def _written(frames: list[TactileImage]) -> tuple[float | None, float | None]:
    """Radius and standard deviation that the frames carry, which must agree."""
    said = {(frame.settings.get("radius_mm"), frame.settings.get("radius_sd_mm")) for frame in frames}
    if len(said) > 1:
        raise ImageMismatchError(
            f"all images must be of one object; their settings say (radius_mm, radius_sd_mm) {sorted(said, key=str)}"
        )
    radius, sd = said.pop()
    if radius is not None:
        radius = require_number("radius_mm of the settings", radius, 1e-3, 1e3)
    if sd is not None:
        sd = require_number("radius_sd_mm of the settings", sd, 0.0, 1e3)
    return radius, sd

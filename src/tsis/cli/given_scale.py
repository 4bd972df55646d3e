"""``--scale-mm``: the scale of images for which no calibration holds one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.model.errors import InputError
from tsis.model.image import require_pixel_scale

if TYPE_CHECKING:
    from tsis.calibration.cited import UsableCalibration


def chosen_scale(calibration: UsableCalibration | None, given: str | None) -> tuple[float, float] | None:
    """Millimetres per pixel: the calibration's, or ``--scale-mm`` where it holds none."""
    held = None if calibration is None else calibration.known.scale
    if held is not None and given is not None:
        raise InputError("--scale-mm is not used with this calibration, which holds the scale; leave it out")
    if held is not None:
        return held.mm_per_pixel
    return None if given is None else scale_of(given)


def scale_of(text: str) -> tuple[float, float]:
    """Read ``0.05`` or ``0.05,0.06`` as mm per pixel."""
    try:
        parts = [float(part) for part in text.split(",")]
    except ValueError:
        parts = []
    if len(parts) not in (1, 2):
        raise InputError(f"--scale-mm must be one number or x,y in millimetres per pixel; got {text!r}")
    return require_pixel_scale((parts[0], parts[-1]))

"""A calibration file as commands use it: read, found usable, applied to frames and cited in results."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from tsis.calibration.applied import applied
from tsis.calibration.file import ProbeCalibration, identity, read_calibration
from tsis.model.errors import InputError
from tsis.model.image import pixel_scale

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tsis.instrument.acquisition import Acquisition
    from tsis.model import Calibration, TactileImage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CitedCalibration:
    """A calibration with the identity under which results name it."""

    known: ProbeCalibration
    identity: str

    @property
    def response(self) -> Calibration:
        """What the estimates take; `CalibrationError` when it was not measured."""
        return self.known.known_response(self.identity)

    def pressed(self, frames: Sequence[TactileImage]) -> tuple[list[TactileImage], Calibration]:
        """Frames ready for an estimate, and the response with the doubt of the forces; errors as `applied`."""
        return applied(self.known, frames, identity=self.identity)

    def require_camera(self, acquisition: Acquisition, *, stored: bool) -> None:
        """Refuse to use it with another camera, or at other settings; stored frames tell neither."""
        present = {setting.name: setting.value for setting in acquisition.settings()}
        camera = None if stored else acquisition.name
        self.known.require_usable(datetime.now(UTC), camera=camera, settings=present)

    def citation(self) -> dict[str, Any]:
        """What a result says of it."""
        made, expires = self.known.made, self.known.expires
        return {
            "name": self.known.name,
            "sha256": self.identity,
            "made": None if made is None else made.isoformat(),
            "expires": None if expires is None else expires.isoformat(),
        }


def cited(path: Path) -> CitedCalibration:
    """Read a calibration file that may be used today; else `CalibrationError` or `FileInputError`."""
    known = read_calibration(path)
    known.require_usable(datetime.now(UTC))
    return CitedCalibration(known=known, identity=identity(known))


def chosen_scale(calibration: CitedCalibration | None, given: str | None) -> tuple[float, float] | None:
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
    return pixel_scale((parts[0], parts[-1]))

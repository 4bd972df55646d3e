"""A calibration file as results rest on it: read, found usable, applied to frames and cited."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from tsis.calibration.applied import apply_calibration
from tsis.calibration.file import ProbeCalibration, calibration_sha256, parse_calibration, read_calibration

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tsis.instrument.acquisition import Acquisition
    from tsis.model import Calibration, TactileImage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UsableCalibration:
    """A calibration with the identity under which results name it."""

    known: ProbeCalibration
    identity: str

    @property
    def response(self) -> Calibration:
        """What the estimates take; `CalibrationError` when it was not measured."""
        return self.known.known_response(self.identity)

    def pressed(self, frames: Sequence[TactileImage]) -> tuple[list[TactileImage], Calibration]:
        """Frames ready for an estimate, and the response with the doubt of the forces; errors as `apply_calibration`."""
        return apply_calibration(self.known, frames, identity=self.identity)

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


def read_usable_calibration(path: Path) -> UsableCalibration:
    """Read a calibration file that may be used today; else `CalibrationError` or `FileInputError`."""
    return _usable(read_calibration(path))


def parse_usable_calibration(content: bytes, name: str) -> UsableCalibration:
    """The same from the content of such a file, as somebody uploaded it under a name."""
    return _usable(parse_calibration(content, name))


def _usable(known: ProbeCalibration) -> UsableCalibration:
    known.require_usable(datetime.now(UTC))
    return UsableCalibration(known=known, identity=calibration_sha256(known))

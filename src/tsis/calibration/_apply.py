"""A calibration applied to frames as the camera gave them: what estimates are given."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from tsis.calibration.file import ProbeCalibration, calibration_sha256, parse_calibration, read_calibration
from tsis.calibration.force import ForceLine, total_grey
from tsis.calibration.reference import CameraReference

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tsis.calibration._measured import MeasuredValue
    from tsis.instrument.acquisition import Acquisition
    from tsis.model import Calibration, TactileImage


def apply_calibration(
    calibration: ProbeCalibration, frames: Sequence[TactileImage], *, identity: str
) -> tuple[list[TactileImage], Calibration]:
    """Frames ready for an estimate, and the response with the doubt of the forces.

    Dark frame and untouched light are taken away where the calibration holds them; a force that nobody gave is read
    off the light by the force line.

    Parameters
    ----------
    calibration
        The calibration; whether it may be used today is not asked.
    frames
        As the camera gave them.
    identity
        Under which results cite the calibration.

    Raises
    ------
    CalibrationError
        When it holds no response; when a force is to be read and it holds no force line or no reference.
    InputError
        When a frame lies outside the line's range, or does not belong to the reference.
    """
    forces = [_force(calibration, frame) for frame in frames if frame.force_n is None]
    by_line = iter(forces)
    ready = [
        replace(
            frame if calibration.reference is None else calibration.reference.corrected(frame),
            force_n=next(by_line).value if frame.force_n is None else frame.force_n,
        )
        for frame in frames
    ]
    response = calibration.known_response(identity)
    uncertainty = max((force.sd / force.value for force in forces), default=0.0)
    return ready, replace(response, force_sd=max(response.force_sd, uncertainty))


def _force(calibration: ProbeCalibration, frame: TactileImage) -> MeasuredValue:
    line = calibration.need(ForceLine, "a force without --force-n")
    reference = calibration.need(CameraReference, "a force without --force-n")
    return line.force_n(total_grey(frame, reference, method=line.method))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UsableCalibration:
    """A calibration with the identity under which results name it."""

    calibration: ProbeCalibration
    identity: str

    @property
    def response(self) -> Calibration:
        """What the estimates take; `CalibrationError` when it was not measured."""
        return self.calibration.known_response(self.identity)

    def pressed(self, frames: Sequence[TactileImage]) -> tuple[list[TactileImage], Calibration]:
        """Corrected frames and the calibration that fits them; errors as `apply_calibration`."""
        return apply_calibration(self.calibration, frames, identity=self.identity)

    def require_camera(self, acquisition: Acquisition, *, stored: bool) -> None:
        """Refuse to use it with another camera, or at other settings; stored frames tell neither."""
        present = {setting.name: setting.value for setting in acquisition.settings()}
        camera = None if stored else acquisition.name
        self.calibration.require_usable(datetime.now(UTC), camera=camera, settings=present)

    def citation(self) -> dict[str, Any]:
        """What a result says of it."""
        created, expires = self.calibration.made, self.calibration.expires
        return {
            "name": self.calibration.name,
            "sha256": self.identity,
            "made": None if created is None else created.isoformat(),
            "expires": None if expires is None else expires.isoformat(),
        }


def read_usable_calibration(path: Path) -> UsableCalibration:
    """Read a calibration file that may be used today; else `CalibrationError` or `FileInputError`."""
    return _usable(read_calibration(path))


def parse_usable_calibration(content: bytes, name: str) -> UsableCalibration:
    """The same from the content of such a file, as somebody uploaded it under a name."""
    return _usable(parse_calibration(content, name))


def _usable(calibration: ProbeCalibration) -> UsableCalibration:
    calibration.require_usable(datetime.now(UTC))
    return UsableCalibration(calibration=calibration, identity=calibration_sha256(calibration))

"""A calibration applied to frames as the camera gave them: what estimates are given."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from tsis.calibration.force import ForceLine, total_grey
from tsis.calibration.reference import CameraReference

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.calibration.file import ProbeCalibration
    from tsis.calibration.measured import MeasuredValue
    from tsis.model import Calibration, TactileImage


def apply_calibration(
    known: ProbeCalibration, frames: Sequence[TactileImage], *, identity: str
) -> tuple[list[TactileImage], Calibration]:
    """Frames ready for an estimate, and the response with the doubt of the forces.

    Dark frame and untouched light are taken away where the calibration holds them; a force that nobody gave is read
    off the light by the force line.

    Parameters
    ----------
    known
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
    forces = [_force(known, frame) for frame in frames if frame.force_n is None]
    by_line = iter(forces)
    ready = [
        replace(
            frame if known.reference is None else known.reference.corrected(frame),
            force_n=next(by_line).value if frame.force_n is None else frame.force_n,
        )
        for frame in frames
    ]
    response = known.known_response(identity)
    doubt = max((force.sd / force.value for force in forces), default=0.0)
    return ready, replace(response, force_sd=max(response.force_sd, doubt))


def _force(known: ProbeCalibration, frame: TactileImage) -> MeasuredValue:
    line = known.need(ForceLine, "a force without --force-n")
    reference = known.need(CameraReference, "a force without --force-n")
    return line.force_n(total_grey(frame, reference, method=line.method))

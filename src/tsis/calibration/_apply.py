"""A calibration applied to raw camera frames before an estimate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from tsis.calibration.file import ProbeCalibration, calibration_sha256, parse_calibration, read_calibration
from tsis.calibration.force import ForceLine, total_grey
from tsis.calibration.reference import CameraReference
from tsis.model.budget import QuantityBudget, UncertaintyComponent
from tsis.model.content import ContentValue

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tsis.calibration._measured import MeasuredValue
    from tsis.instrument.acquisition import Acquisition
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage

    CorrectedFrames = tuple[list[TactileImage], Calibration]


def apply_calibration(
    calibration: ProbeCalibration, frames: Sequence[TactileImage], *, identity: str, on_tissue: bool = False
) -> CorrectedFrames:
    """Correct frames by the reference and give the response with the uncertainty of forces by the force line.

    Parameters
    ----------
    calibration
        The calibration; its expiry is not checked here.
    frames
        Raw camera frames; the force line gives the force of each without one.
    identity
        SHA-256 by which results cite the calibration.
    on_tissue
        Whether the frames show tissue and not a tip or ball: its dents change the light otherwise.

    Raises
    ------
    CalibrationError
        When the response is missing, a force must be read and the force line or the reference is missing, or a frame's
        settings name another probe, camera or setting.
    ImageMismatchError
        When a frame differs in size, scale or full scale from those of the calibration.
    InputError
        When a frame lies outside the line's range, or is not of the reference.
    """
    frames = [_of_same_instrument(calibration, frame) for frame in frames]
    forces = [_force(calibration, frame, on_tissue=on_tissue) for frame in frames if frame.force_n is None]
    by_line = iter(forces)
    reference = calibration.reference
    corrected = frames if reference is None else [reference.corrected(frame) for frame in frames]
    ready = [frame if frame.force_n is not None else replace(frame, force_n=next(by_line).value) for frame in corrected]
    response = calibration.cited_response(identity, on_tissue=on_tissue)
    uncertainty = max((force.sd / force.value for force in forces), default=0.0)
    return ready, replace(response, force_sd=max(response.force_sd, uncertainty))


def _of_same_instrument(calibration: ProbeCalibration, frame: TactileImage) -> TactileImage:
    """The frame with the scale of the calibration, if any; frames of another instrument are refused."""
    stated = frame.settings
    calibration.require_same_instrument(
        probe=stated.get("probe"),
        camera=stated.get("camera"),
        settings={name: value for name, value in stated.items() if isinstance(value, float)},
    )
    return frame if calibration.scale is None else calibration.scale.on(frame)


def _force(calibration: ProbeCalibration, frame: TactileImage, *, on_tissue: bool) -> MeasuredValue:
    line = calibration.need(ForceLine, "a force without --force-n")
    reference = calibration.need(CameraReference, "a force without --force-n")
    total = total_grey(frame, reference, method=line.method)
    return line.soft_force_n(total) if on_tissue else line.force_n(total)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UsableCalibration(ContentValue):
    """A calibration with the identity by which results cite it."""

    calibration: ProbeCalibration
    identity: str

    @property
    def response(self) -> Calibration:
        """The response for estimates; `CalibrationError` when it was not measured."""
        return self.calibration.cited_response(self.identity)

    def _repr_html_(self) -> str:
        """The summary of the calibration."""
        return self.calibration._repr_html_()

    def pressed(self, frames: Sequence[TactileImage], *, on_tissue: bool = False) -> CorrectedFrames:
        """Corrected frames and the matching response; parameters and errors as `apply_calibration`."""
        return apply_calibration(self.calibration, frames, identity=self.identity, on_tissue=on_tissue)

    def force_budget(self, force_n: float, *, by_line: bool) -> QuantityBudget:
        """The uncertainty budget of a force in newtons: of the force line, or of a force that was stated."""
        if by_line:
            return self.calibration.need(ForceLine, "the budget of a force").budget(force_n)
        sd = self.response.force_sd
        sizes = {"standard_uncertainty": sd, "contribution": sd * force_n}
        stated = UncertaintyComponent(source="stated force", evaluation="B", distribution="normal", unit="1", **sizes)
        return QuantityBudget(name="force_n", value=force_n, unit="N", components=(stated,))

    def require_untouched(self, frames: Sequence[TactileImage]) -> None:
        """Refuse frames of the untouched probe that do not show the light of the calibration's reference.

        Raises `ImageMismatchError` for another probe, camera or mode. Without a reference nothing is compared.
        """
        if (reference := self.calibration.reference) is not None:
            for frame in frames:
                reference.require_untouched(frame)

    def require_camera(self, acquisition: Acquisition, *, stored: bool) -> None:
        """Refuse another camera or other settings; stored frames carry no camera name."""
        present = {setting.name: setting.value for setting in acquisition.settings()}
        camera = None if stored else acquisition.name
        self.calibration.require_usable(datetime.now(UTC), camera=camera, settings=present)

    def citation(self) -> dict[str, Any]:
        """Name, hash, date and expiry, for the result."""
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
    """Parse an uploaded calibration file; errors as `read_usable_calibration`."""
    return _usable(parse_calibration(content, name))


def _usable(calibration: ProbeCalibration) -> UsableCalibration:
    calibration.require_usable(datetime.now(UTC))
    return UsableCalibration(calibration=calibration, identity=calibration_sha256(calibration))

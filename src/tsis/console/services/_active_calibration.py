"""Which calibration is in force: the one that was given as long as it fits the camera, or the virtual probe's own."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from tsis.calibration.guard import guard_reference
from tsis.errors import CalibrationError
from tsis.virtual import bench_seed

if TYPE_CHECKING:
    from tsis.calibration import UsableCalibration
    from tsis.calibration.guard import GuardReference
    from tsis.console.services._camera import CameraController
    from tsis.console.services._subject import VirtualSubject


Pair = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ActiveCalibration:
    """What one judgement found: its parts belong together, whatever the camera is set to a moment later.

    Attributes
    ----------
    known
        The calibration in force; None without one.
    why
        Why there is none, in one sentence; empty where none is wanted.
    scale
        Size (x, y) of a pixel on the face, mm; None when nobody knows it.
    probe
        Name of the probe: of the virtual one, of the calibration, or as it was chosen with the camera.
    reference
        What the press guard compares frames with.
    """

    known: UsableCalibration | None
    why: str
    scale: Pair | None
    probe: str
    reference: GuardReference

    @property
    def compared(self) -> tuple[GuardReference, Pair | None]:
        """What frames that are watched are compared with, and their scale."""
        return self.reference, self.scale

    def told(self) -> dict[str, Any]:
        """Probe and calibration, as files beside frames tell of them."""
        return {"probe": self.probe, "calibration": None if self.known is None else self.known.citation()}


class ActiveCalibrationCheck:
    """Judges a calibration by the camera as it runs: another exposure puts it out of force until it is set back.

    Parameters
    ----------
    desk
        Where the camera is.
    given
        What was put in force; None for the virtual probe's own, or none.
    """

    def __init__(self, desk: CameraController, given: UsableCalibration | None) -> None:
        self._desk, self._given = desk, given
        self._kept: tuple[UsableCalibration | None, VirtualSubject | None, GuardReference] | None = None

    def use(self, given: UsableCalibration | None) -> None:
        """Put another one in force; None for the virtual probe's own, or none.

        Raises
        ------
        CalibrationError
            When it does not fit; the one before stays.
        """
        if given is not None:
            _require_fit(given, self._desk)
        self._given = given

    def now(self) -> ActiveCalibration:
        """Judge once by the camera as it is set now."""
        stage, choice = self._desk.stage, self._desk.choice
        known, why = self._judged(self._given or (None if stage is None else stage.calibration))
        measured = None if known is None else known.known.scale
        scale = None if stage is None else stage.mm_per_pixel
        return ActiveCalibration(
            known=known,
            why=why,
            scale=scale if measured is None else measured.mm_per_pixel,
            probe=choice.probe if choice.is_virtual or known is None else known.known.probe or choice.probe,
            reference=self._reference(known, stage),
        )

    def _judged(self, wanted: UsableCalibration | None) -> tuple[UsableCalibration | None, str]:
        if wanted is None:
            return None, ""
        try:
            _require_fit(wanted, self._desk)
        except CalibrationError as error:
            return None, str(error)
        return wanted, ""

    def _reference(self, known: UsableCalibration | None, stage: VirtualSubject | None) -> GuardReference:
        kept = self._kept
        if kept is None or kept[0] is not known or kept[1] is not stage:
            own = stage is not None and known is stage.calibration
            made = stage.guard_reference() if stage is not None and own else guard_reference(known)
            self._kept = kept = known, stage, made
        return kept[2]


def _require_fit(cited: UsableCalibration, desk: CameraController) -> None:
    """Refuse, with `CalibrationError`, what is expired, or of another probe, camera, setting or size of frames."""
    known, choice, acquisition = cited.known, desk.choice, desk.acquisition
    if bench_seed(known.camera) is not None:
        raise CalibrationError(
            f"calibration {known.name!r} is of the {known.camera}, an exercise: no page looks through its camera "
            "(the virtual probe brings its own calibration)"
        )
    known.require_usable(
        datetime.now(UTC),
        probe=choice.probe if choice.is_virtual else None,
        camera=acquisition.name if acquisition is not None and not choice.is_virtual else None,
        settings={each.name: each.value for each in desk.settings()},
    )
    latest = None if acquisition is None else acquisition.latest()
    if latest is None:
        return
    shape, full_scale = latest.frame.pixels.shape, latest.frame.full_scale
    scale, reference = known.scale, known.reference
    if scale is not None and scale.shape != shape:
        raise _other_frames(known.name, scale.shape, shape)
    if reference is not None and reference.untouched_grey.shape != shape:
        raise _other_frames(known.name, reference.untouched_grey.shape, shape)
    if reference is not None and reference.full_scale != full_scale:
        raise CalibrationError(
            f"calibration {known.name!r} is of frames with full scale {reference.full_scale:g}; the camera's have "
            f"{full_scale:g} (start the camera in the mode in which it was calibrated)"
        )


def _other_frames(name: str, ours: tuple[int, ...], theirs: tuple[int, ...]) -> CalibrationError:
    return CalibrationError(
        f"calibration {name!r} is of frames of {ours[1]} x {ours[0]} pixels; the camera's have "
        f"{theirs[1]} x {theirs[0]} (start the camera in the mode in which it was calibrated)"
    )

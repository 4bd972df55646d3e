"""The active calibration: the chosen one while it fits the camera, or the virtual probe's own."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from tsis.calibration.guard import guard_reference
from tsis.errors import CalibrationError
from tsis.virtual.calibration_bench import bench_seed

if TYPE_CHECKING:
    from tsis.calibration import UsableCalibration
    from tsis.calibration.guard import GuardReference
    from tsis.console.services._camera import CameraController
    from tsis.console.services._subject import CameraChoice, VirtualSubject


Pair = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ActiveCalibration:
    """Result of one check; its parts belong to the same camera settings."""

    calibration: UsableCalibration | None
    why: str  # why there is none; empty where none is requested
    scale: Pair | None  # size (x, y) of a pixel on the face, mm
    probe: str  # of the virtual probe, of the calibration, or as chosen with the camera
    reference: GuardReference  # of the press guard

    @property
    def compared(self) -> tuple[GuardReference, Pair | None]:
        """Reference of the watched frames, and their scale."""
        return self.reference, self.scale

    def sidecar_entries(self) -> dict[str, Any]:
        """Probe and calibration, for the files beside frames."""
        return {"probe": self.probe, "calibration": None if self.calibration is None else self.calibration.citation()}


class ActiveCalibrationCheck:
    """Checks a calibration against the running camera: it is inactive while a setting such as the exposure differs.

    Without a chosen calibration the virtual probe's own is checked, if any.
    """

    def __init__(self, camera_controller: CameraController, given: UsableCalibration | None) -> None:
        self._camera, self.chosen = camera_controller, given
        self._checked: tuple[UsableCalibration | None, VirtualSubject | None, GuardReference] | None = None

    def use(self, given: UsableCalibration | None) -> None:
        """Choose another one, or None; `CalibrationError` when it does not fit, and the one before stays."""
        if given is not None:
            _require_fit(given, self._camera)
        self.chosen = given

    def now(self) -> ActiveCalibration:
        """Check once with the camera's present settings."""
        subject, choice = self._camera.subject, self._camera.choice
        given, why = self._check(self.chosen or (None if subject is None else subject.calibration))
        measured = None if given is None else given.calibration.scale
        scale = None if subject is None else subject.mm_per_pixel
        return ActiveCalibration(
            calibration=given,
            why=why,
            scale=scale if measured is None else measured.mm_per_pixel,
            probe=choice.probe if choice.is_virtual or given is None else given.calibration.probe or choice.probe,
            reference=self._reference(given, subject),
        )

    def _check(self, calibration: UsableCalibration | None) -> tuple[UsableCalibration | None, str]:
        if calibration is None:
            return None, ""
        try:
            _require_fit(calibration, self._camera)
        except CalibrationError as error:
            return None, str(error)
        return calibration, ""

    def _reference(
        self, calibration: UsableCalibration | None, virtual_subject: VirtualSubject | None
    ) -> GuardReference:
        saved = self._checked
        if saved is None or saved[0] is not calibration or saved[1] is not virtual_subject:
            own = virtual_subject is not None and calibration is virtual_subject.calibration
            created = (
                virtual_subject.guard_reference()
                if virtual_subject is not None and own
                else guard_reference(calibration)
            )
            self._checked = saved = calibration, virtual_subject, created
        return saved[2]


def _require_fit(cited: UsableCalibration, camera_controller: CameraController) -> None:
    """Refuse, with `CalibrationError`, what is expired, or of another probe, camera, setting or size of frames."""
    given, choice, acquisition = cited.calibration, camera_controller.choice, camera_controller.acquisition
    seed = bench_seed(given.camera)
    if seed is not None and not given.settings:
        raise CalibrationError(
            f"calibration {given.name!r} is of the {given.camera}, an exercise: no page looks through its camera "
            "(begin a new calibration, which is one of the virtual probe)"
        )
    if seed is not None and (not choice.is_virtual or choice.is_sphere or choice.seed != seed):
        raise CalibrationError(
            f"calibration {given.name!r} is of the virtual probe of seed {seed} on tissue; the camera is {_of(choice)} "
            f"(choose that probe on the page Camera, or begin a calibration of this one)"
        )
    given.require_usable(
        datetime.now(UTC),
        probe=choice.probe if choice.is_virtual else None,
        camera=acquisition.name if acquisition is not None and not choice.is_virtual else None,
        settings={setting.name: setting.value for setting in camera_controller.settings()},
    )
    latest = None if acquisition is None else acquisition.latest()
    if latest is None:
        return
    shape, full_scale = latest.frame.pixels.shape, latest.frame.full_scale
    scale, reference = given.scale, given.reference
    if scale is not None and scale.shape != shape:
        raise _other_frames(given.name, scale.shape, shape)
    if reference is not None and reference.untouched_grey.shape != shape:
        raise _other_frames(given.name, reference.untouched_grey.shape, shape)
    if reference is not None and reference.full_scale != full_scale:
        raise CalibrationError(
            f"calibration {given.name!r} is of frames with full scale {reference.full_scale:g}; the camera's have "
            f"{full_scale:g} (start the camera in the mode in which it was calibrated)"
        )


def _of(choice: CameraChoice) -> str:
    if not choice.is_virtual:
        return choice.spec
    return f"the virtual probe of seed {choice.seed} on {'a bare sphere' if choice.is_sphere else 'tissue'}"


def _other_frames(name: str, ours: tuple[int, ...], theirs: tuple[int, ...]) -> CalibrationError:
    return CalibrationError(
        f"calibration {name!r} is of frames of {ours[1]} x {ours[0]} pixels; the camera's have "
        f"{theirs[1]} x {theirs[0]} (start the camera in the mode in which it was calibrated)"
    )

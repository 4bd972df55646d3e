"""Sources of the frames of a calibration's steps: the virtual rig, or the camera with an operator."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from tsis.calibration.force import loading_forces
from tsis.calibration.session import PAD_FORCES_N, LiveCalibration
from tsis.catalog import load_probe
from tsis.errors import CalibrationError, CameraError
from tsis.model import require_number
from tsis.virtual import VirtualBench

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.calibration.session import CalibrationFrame, CalibrationStep, SessionSetup
    from tsis.console.services._camera import CameraController
    from tsis.instrument.acquisition import Acquisition
    from tsis.instrument.gauge import ForceLog


LARGEST_TYPED_N = 100.0
FAR = 2**64  # more random numbers than any step draws


class CalibrationRig(Protocol):
    """Takes frames."""

    @property
    def by_itself(self) -> bool:
        """Whether it takes the steps without an operator."""

    @property
    def has_gauge(self) -> bool:
        """Whether forces of a loading are read for it; else a person types each."""

    def require(self) -> None:
        """Refuse frames that do not belong to the session: another camera, other settings, none at all."""

    def frames(self, step: CalibrationStep) -> int:
        """How many frames a step will have; 0 where a person says when it is over."""

    def shots(self, step: CalibrationStep, over: Callable[[], bool]) -> Iterator[CalibrationFrame]:
        """Yield a step's frames; a loading by the gauge until ``over`` says so."""

    def frame(self, force_n: float) -> CalibrationFrame:
        """The next frame, with a force that a person read."""


class VirtualCalibrationRig:
    """The virtual rig of a session, created when it is first needed.

    ``before`` steps were done when the program began: the noise of their frames does not repeat.
    """

    by_itself, has_gauge = True, True

    def __init__(self, terms: SessionSetup, seed: int, *, before: int = 0) -> None:
        self._terms, self._seed, self._before = terms, seed, before
        self._rig: VirtualBench | None = None

    def require(self) -> None:
        """Nothing: it is the session's own."""

    def frames(self, step: CalibrationStep) -> int:
        """As the step says, and of a loading all its forces."""
        return step.frames or len(loading_forces() if step.pad_kpa is None else PAD_FORCES_N)

    def shots(self, step: CalibrationStep, over: Callable[[], bool]) -> Iterator[CalibrationFrame]:
        """Yield a step's frames."""
        if self._rig is None:
            source = np.random.PCG64(self._seed)
            rng = np.random.Generator(source)
            self._rig = VirtualBench(load_probe(self._terms.probe), rng=rng, pitch_mm=self._terms.pitch_mm)
            source.advance(self._before * FAR)
        return self._rig.shots(step)

    def frame(self, force_n: float) -> CalibrationFrame:
        """Never: it loads by itself."""
        raise CalibrationError("the virtual bench loads by itself; no force is typed (take the step)")


class CameraRig:
    """The camera, and its gauge where there is one."""

    by_itself = False

    def __init__(
        self, terms: SessionSetup, camera_controller: CameraController, gauge: Callable[[], ForceLog | None]
    ) -> None:
        self._terms, self._camera, self._gauge = terms, camera_controller, gauge

    @property
    def has_gauge(self) -> bool:
        """Whether a gauge reads forces."""
        return self._gauge() is not None

    def require(self) -> None:
        """Refuse another camera, or other settings; errors as `acquisition_of`."""
        self._acquisition()

    def frames(self, step: CalibrationStep) -> int:
        """As the step says."""
        return step.frames

    def shots(self, step: CalibrationStep, over: Callable[[], bool]) -> Iterator[CalibrationFrame]:
        """Yield fresh frames, all of one uninterrupted stream at the session's settings."""
        acquisition = self._acquisition()
        before = len(acquisition.account().interruptions)
        instrument = LiveCalibration(acquisition, self._gauge())
        for shot in instrument.loading(over) if step.is_loading else instrument.still(step.frames):
            yield shot
            if len(acquisition.account().interruptions) != before:
                raise CameraError(f"{acquisition.name} was lost meanwhile (wait until it is back)")
        self._acquisition()  # the settings may have been changed elsewhere

    def frame(self, force_n: float) -> CalibrationFrame:
        """The next frame with a typed force, in [-100, 100] N."""
        require_number("force", force_n, -LARGEST_TYPED_N, LARGEST_TYPED_N, hint="newtons")
        return LiveCalibration(self._acquisition()).take_frame(force_n)

    def _acquisition(self) -> Acquisition:
        return acquisition_of(self._camera, self._terms)


def acquisition_of(camera_controller: CameraController, terms: SessionSetup) -> Acquisition:
    """The running camera of a session, at the session's settings.

    Raises `CameraError` when it is stopped or away, and `CalibrationError` for another camera or setting.
    """
    acquisition = camera_controller.acquisition
    if acquisition is None:
        raise CameraError(f"the camera {terms.camera!r} must run for this; it is stopped (start it)")
    if acquisition.lost or acquisition.ended:
        raise CameraError(f"{acquisition.name} is away (wait until it is back)")
    if acquisition.name != terms.camera:
        raise CalibrationError(
            f"the camera must be that of the session, {terms.camera!r}; it is {acquisition.name!r} (choose it again)"
        )
    if changed := terms.changed_setting({setting.name: setting.value for setting in acquisition.settings()}):
        setting, value, now = changed
        raise CalibrationError(
            f"the camera must be set as when the session began, {setting} = {value:g}; it is at {now:g} (set it back)"
        )
    return acquisition

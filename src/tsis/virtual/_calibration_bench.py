"""A calibration without hardware: each step's frames from the virtual loading machine and targets."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Self

from tsis.calibration.force import loading_forces
from tsis.calibration.session import (
    BOARD,
    BOARD_UNTOUCHED,
    DARK,
    EDGE,
    FLAT,
    PAD_FORCES_N,
    UNTOUCHED,
    CalibrationFrame,
    CalibrationStep,
)
from tsis.errors import InputError
from tsis.virtual._camera import camera_settings
from tsis.virtual._loading_machine import FLAT_LEVELS as LEVELS
from tsis.virtual._loading_machine import VirtualLoadingMachine
from tsis.virtual._scale_targets import dot_board_frame, untouched_frame

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import numpy as np

    from tsis.imaging import Sensor
    from tsis.model import Probe, TactileImage
    from tsis.virtual._probe import VirtualProbe


FRAMES_PER_S = 30.0
NAME_PREFIX = "virtual bench, seed "  # in session files
BOARD_ANGLE_DEG = 3.0


def bench_name(seed: int) -> str:
    """Name of the virtual calibration rig in a session; frames of different seeds do not mix.

    Examples
    --------
    >>> bench_name(4), bench_seed("virtual bench, seed 4"), bench_seed("aravis:Fake_1")
    ('virtual bench, seed 4', 4, None)
    """
    return f"{NAME_PREFIX}{seed}"


def bench_seed(name: str) -> int | None:
    """Seed of the virtual calibration rig of that name; None for the name of a camera."""
    number = name.removeprefix(NAME_PREFIX)
    return int(number) if name.startswith(NAME_PREFIX) and number.isascii() and number.isdecimal() else None


class VirtualBench:
    """The virtual calibration rig, which takes the frames of all steps automatically.

    Parameters
    ----------
    probe
        The probe to calibrate.
    rng
        Random generator of all errors.
    sensor
        The camera.
    pitch_mm
        Pitch of the dot board.
    machine
        The loading machine; one with the default errors when None.
    """

    def __init__(
        self,
        probe: Probe,
        *,
        rng: np.random.Generator,
        sensor: Sensor | None = None,
        pitch_mm: float = 2.5,
        machine: VirtualLoadingMachine | None = None,
    ) -> None:
        self.machine = VirtualLoadingMachine(probe, rng=rng, sensor=sensor) if machine is None else machine
        self._rng, self._pitch_mm = rng, pitch_mm

    @classmethod
    def of(cls, rig: VirtualProbe, *, rng: np.random.Generator, pitch_mm: float = 2.5) -> Self:
        """The rig on which a virtual probe is calibrated, at a shorter exposure; see `VirtualLoadingMachine.of`."""
        return cls(rig.probe, rng=rng, pitch_mm=pitch_mm, machine=VirtualLoadingMachine.of(rig, rng=rng))

    @property
    def settings(self) -> dict[str, float]:
        """Settings of its camera, as those of the virtual probe's camera are named."""
        return camera_settings(self.machine.sensor, exposure=self.machine.exposure)

    @property
    def patch_px(self) -> tuple[int, int, int, int] | None:
        """Reference patch as left, top, right, bottom; None when there is none."""
        return self.machine.patch_px

    def shots(self, step: CalibrationStep) -> Iterator[CalibrationFrame]:
        """Yield the frames of a step."""
        if step.tip_mm is not None:
            for image, gauge_n in self.machine.loading(step.tip_mm, loading_forces()):
                yield CalibrationFrame(image=_raw(image), force_n=gauge_n)
            return
        if step.pad_kpa is not None:
            for force_n in PAD_FORCES_N:
                image, gauge_n = self.machine.press_pad(step.pad_kpa, force_n)
                yield CalibrationFrame(image=_raw(image), force_n=gauge_n)
            return
        take = self._take(step)
        for number in range(step.frames):
            yield CalibrationFrame(image=_raw(take()), time_s=number / FRAMES_PER_S)

    def _take(self, step: CalibrationStep) -> Callable[[], TactileImage]:
        sensor, rng = self.machine.sensor, self._rng
        if step.name == BOARD:
            board = dot_board_frame(sensor, rng=rng, pitch_mm=self._pitch_mm, angle_deg=BOARD_ANGLE_DEG, bright=True)
            return lambda: board
        calls: dict[str, Callable[[], TactileImage]] = {
            DARK: self.machine.dark,
            UNTOUCHED: self.machine.no_contact,
            BOARD_UNTOUCHED: lambda: untouched_frame(sensor, rng=rng),
            EDGE: self.machine.edge,
        }
        for level, light in enumerate(LEVELS, start=1):
            calls[f"{FLAT}-{level}"] = partial(self.machine.flat, light)
        if step.name not in calls:
            raise InputError(f"step must be one of a calibration's plan; got {step.name!r:.60}")
        return calls[step.name]


def _raw(image: TactileImage) -> TactileImage:
    """The frame as a camera delivers it, without scale and force."""
    return replace(image, mm_per_pixel=None, force_n=None)

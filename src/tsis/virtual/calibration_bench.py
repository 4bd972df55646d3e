"""A calibration without hardware: frames of each step, from the virtual loading machine and of targets for the scale.

A target is a board of dots, or a ball pressed into a gel. Each part of a pixel is traced through the lens to the face,
to the nearest dot or the ball's depth. Light, blur and noise follow. The estimators use no part of this code.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Self

import numpy as np
import scipy

from tsis.calibration.force_line import loading_forces
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
from tsis.imaging.sensor import Sensor, expose
from tsis.model.image import TactileImage
from tsis.model.require import require_integer, require_number, require_type
from tsis.virtual.camera import camera_settings
from tsis.virtual.loading_machine import FLAT_LEVELS, VirtualLoadingMachine

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from tsis.model.probe import Probe
    from tsis.virtual.probe import VirtualProbe


PARTS = 2  # of a pixel, along each axis
LEVEL = 0.55  # grey level of the untouched probe in the middle, fraction of the sensor's range
SHADE = 0.25  # fraction of the light lost in the frame's corners, and gained from one side to the other
DISTORTION = 0.01  # relative shortening of a length at the frame's corner
SMALL_DEPTH_MM = 1.5  # depth scale of the gel's nonlinear response
LIGHT_LOSS = 0.45  # fraction of the light lost at large depth


def untouched_frame(sensor: Sensor, *, rng: np.random.Generator) -> TactileImage:
    """The probe without a target, in the same uneven light; ``rng`` draws the noise."""
    require_type("sensor", sensor, Sensor)
    return _exposed(np.ones((sensor.rows, sensor.columns)), sensor, rng, 0.0, "untouched probe")


def dot_board_frame(
    sensor: Sensor,
    *,
    rng: np.random.Generator,
    pitch_mm: float = 2.5,
    dot_diameter_mm: float = 0.8,
    angle_deg: float = 0.0,
    offset_mm: tuple[float, float] = (0.0, 0.0),
    scatter_mm: float = 0.01,
    missing: float = 0.0,
    strays: int = 0,
    distortion: float = DISTORTION,
    contrast: float = 0.3,
    bright: bool = False,
    blur_px: float = 2.0,
) -> TactileImage:
    """A board of dots pressed on the whole face.

    Parameters
    ----------
    sensor
        The camera; its ``mm_per_pixel`` is the true scale in the middle of the frame.
    rng
        Random generator of the noise, the dots' scatter and the missing dots.
    pitch_mm
        Distance of neighbouring dots, in [0.05, 50] mm.
    dot_diameter_mm
        Diameter of a dot, in [0.01, 50] mm.
    angle_deg
        Angle of the board in the image, degrees, from its x axis towards its y axis.
    offset_mm
        Position (x, y) of a dot relative to the frame's middle, mm.
    scatter_mm
        Standard deviation of the error of each coordinate of a dot, in [0, 1] mm.
    missing
        Fraction of the dots without a mark, in [0, 1].
    strays
        Number of specks of a dot's size at random positions.
    distortion
        Relative lengthening of the face's distance from the frame's middle to its corner, in [-0.3, 0.3]; negative
        values are pincushion distortion.
    contrast
        Relative change of the light at dots, in [0, 0.45].
    bright
        True when dots gain light, as on a waveguide; False when they lose it, as on a translucent gel.
    blur_px
        Standard deviation of the lens's blur, in [0, 50] pixels.

    Returns
    -------
    TactileImage
        The frame, without a scale.

    Examples
    --------
    >>> frame = dot_board_frame(Sensor(), rng=np.random.default_rng(1), pitch_mm=2.5)
    >>> frame.grey.shape, frame.mm_per_pixel
    ((492, 768), None)
    """
    require_type("sensor", sensor, Sensor)
    require_number("pitch_mm", pitch_mm, 0.05, 50.0, hint="millimetres")
    require_number("dot_diameter_mm", dot_diameter_mm, 0.01, 50.0, hint="millimetres")
    require_number("scatter_mm", scatter_mm, 0.0, 1.0, hint="millimetres")
    require_number("missing", missing, 0.0, 1.0, hint="a fraction of one")
    require_number("contrast", contrast, 0.0, 0.45, hint="a fraction of one")
    x, y = _face_mm(sensor, distortion)
    rotation = np.exp(-1j * np.radians(require_number("angle_deg", angle_deg, -360.0, 360.0, hint="degrees")))
    position = ((x - offset_mm[0]) + 1j * (y - offset_mm[1])) * rotation / pitch_mm
    column, row = np.rint(position.real).astype(int), np.rint(position.imag).astype(int)
    first = column.min(), row.min()
    board = int(np.ptp(column)) + 1, int(np.ptp(row)) + 1
    scatter = scatter_mm / pitch_mm * (rng.standard_normal(board) + 1j * rng.standard_normal(board))
    present = (rng.random(board) >= missing).astype(float)
    cell = column - first[0], row - first[1]
    distance = pitch_mm * np.abs(position - (column + 1j * row) - scatter[cell])
    mark = present[cell] * _soft_disc(distance, dot_diameter_mm)
    for _ in range(require_integer("strays", strays, 0, 1000)):
        speck = rng.uniform(x.min(), x.max()), rng.uniform(y.min(), y.max())
        mark = np.maximum(mark, _soft_disc(np.hypot(x - speck[0], y - speck[1]), dot_diameter_mm))
    change = contrast * _pixels(mark, sensor)
    return _exposed(1 + change if bright else 1 - change, sensor, rng, blur_px, f"dots at {pitch_mm:g} mm")


def ball_frame(
    sensor: Sensor,
    *,
    rng: np.random.Generator,
    ball_radius_mm: float = 4.0,
    depth_mm: float = 1.0,
    offset_mm: tuple[float, float] = (0.0, 0.0),
    conforming: float = 0.85,
    distortion: float = 0.0,
    blur_px: float = 2.0,
) -> TactileImage:
    """A ball pressed into a translucent gel, which is darker where it is thinner.

    Inside the contact the face follows the ball; outside it rises smoothly to the untouched level. The light decreases
    nonlinearly with depth.

    Parameters
    ----------
    sensor
        The camera; its ``mm_per_pixel`` is the true scale in the middle of the frame.
    rng
        Random generator of the noise.
    ball_radius_mm
        Radius of the ball, in [0.1, 100] mm.
    depth_mm
        Depth of its lowest point below the untouched face, in [0.001, ball_radius_mm] mm.
    offset_mm
        Position (x, y) of the ball relative to the frame's middle, mm.
    conforming
        Radius of the contact over that of the circle where the ball cuts the untouched face, in [0.1, 0.99].
    distortion, blur_px
        As for `dot_board_frame`.

    Examples
    --------
    >>> shallow, deep = (ball_frame(Sensor(), rng=np.random.default_rng(1), depth_mm=depth) for depth in (0.5, 1.5))
    >>> bool(deep.grey[246, 384] < 0.9 * shallow.grey[246, 384])
    True
    """
    require_type("sensor", sensor, Sensor)
    radius = require_number("ball_radius_mm", ball_radius_mm, 0.1, 100.0, hint="millimetres")
    depth = require_number("depth_mm", depth_mm, 1e-3, radius, hint="millimetres")
    require_number("conforming", conforming, 0.1, 0.99, hint="a fraction of one")
    x, y = _face_mm(sensor, distortion)
    distance = np.hypot(x - offset_mm[0], y - offset_mm[1])
    edge = conforming * np.sqrt(2 * radius * depth - depth**2)
    inside = depth - radius + np.sqrt(radius**2 - np.minimum(distance, edge) ** 2)
    rim = depth - radius + np.sqrt(radius**2 - edge**2)
    fall = edge / np.sqrt(radius**2 - edge**2) / rim
    below = inside * np.exp(-fall * np.maximum(distance - edge, 0.0))
    lost = LIGHT_LOSS * (1 - np.exp(-_pixels(below, sensor) / SMALL_DEPTH_MM))
    return _exposed(1 - lost, sensor, rng, blur_px, f"ball of {radius:g} mm, {depth:g} mm deep")


def _face_mm(sensor: Sensor, distortion: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions (x, y) on the face of the parts of pixels from the frame's middle, mm, shape (rows * PARTS, ...)."""
    require_number("distortion", distortion, -0.3, 0.3, hint="a fraction of one")
    parts = (np.arange(PARTS) + 0.5) / PARTS - 0.5
    x, y = (
        np.add.outer(axis, parts * size).ravel()
        for axis, size in zip(sensor.axes_mm(), sensor.mm_per_pixel, strict=True)
    )
    bent = 1 + distortion * (x[None, :] ** 2 + y[:, None] ** 2) / (x[-1] ** 2 + y[-1] ** 2)
    return x[None, :] * bent, y[:, None] * bent


def _soft_disc(distance_mm: NDArray[np.float64], diameter_mm: float) -> NDArray[np.float64]:
    """1 in the middle of a disc and 0 outside, with a rim a sixth of its diameter wide."""
    steepness = 24.0 / diameter_mm
    return np.asarray(1 / (1 + np.exp(np.clip(steepness * (distance_mm - diameter_mm / 2), -50.0, 50.0))))


def _pixels(fine: NDArray[np.float64], sensor: Sensor) -> NDArray[np.float64]:
    return np.asarray(fine.reshape(sensor.rows, PARTS, sensor.columns, PARTS).mean(axis=(1, 3)))


def _exposed(
    fraction: NDArray[np.float64], sensor: Sensor, rng: np.random.Generator, blur_px: float, name: str
) -> TactileImage:
    """The frame of a fraction of the probe's uneven light."""
    require_number("blur_px", blur_px, 0.0, 50.0, hint="pixels")
    if blur_px > 0.0:
        fraction = np.asarray(scipy.ndimage.gaussian_filter(fraction, blur_px, mode="nearest"))
    span, down = (np.linspace(-1.0, 1.0, sides) for sides in (sensor.columns, sensor.rows))
    light = 1 - SHADE * (span[None, :] ** 2 + down[:, None] ** 2) / 2 + SHADE * span[None, :] / 2
    grey = LEVEL * (sensor.full_scale - sensor.background_grey) * light * fraction
    return TactileImage(
        grey=expose(grey, sensor, rng), full_scale=sensor.full_scale, name=name, settings={"source": "virtual"}
    )


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
        for level, light in enumerate(FLAT_LEVELS, start=1):
            calls[f"{FLAT}-{level}"] = partial(self.machine.flat, light)
        if step.name not in calls:
            raise InputError(f"step must be one of a calibration's plan; got {step.name!r:.60}")
        return calls[step.name]


def _raw(image: TactileImage) -> TactileImage:
    """The frame as a camera delivers it, without scale and force."""
    return replace(image, mm_per_pixel=None, force_n=None)

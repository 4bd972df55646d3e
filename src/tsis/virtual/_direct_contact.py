"""The virtual rig of direct contact: a soft sphere squeezed between a plate and the bare probe becomes frames."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from tsis.hardness import DRIFT_SD, press_fields, require_small_sphere
from tsis.imaging import Sensor, expose, render
from tsis.mechanics.finite_strain import SphereResolution
from tsis.model import (
    Calibration,
    LightMap,
    Probe,
    SoftSphere,
    TactileImage,
    require_array,
    require_number,
    require_type,
)
from tsis.virtual._probe import LARGEST_FORCE_N, VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.model import PressField


# Finer and of another order than the mesh of the estimates, so that an estimate is never checked by itself.
DIRECT_CONTACT_RESOLUTION = SphereResolution(order=4, cells=6, rings=2, face_cells=6)
FILLED = 0.8  # share of the scale above the background that the brightest place of the nominal exposure takes
SATURATION = 5.0  # times the greatest pressure: there the answer is a line to within one per cent
LIT = 0.05  # of the brightest place: what is brighter belongs to the contact


class DirectContactRig:
    """A probe that touches objects without tissue between, with the errors that a bench would make.

    Its calibration states the size of the errors. Each rig has a gain, a stiffness and a fixed pattern of its own; each
    press misses the commanded force, finds the lamps a little brighter or darker, leaves a pattern and some stray
    light; each frame has the sensor's noise. A sphere lies a little beside the axis, and its radius is written down
    with an error.

    Parameters
    ----------
    probe
        What presses.
    rng
        Source of every error; a seed gives the same rig and the same frames.
    sensor
        The camera.
    light
        Light on the face; even when None. The dents of direct contact are deeper than traced light knows.
    calibration
        Answer of grey level to pressure as the laboratory believes it, with the sizes of the errors; that of
        `direct_contact_calibration` when None.
    radius_sd_mm
        Standard deviation in mm of the written radius, in [0, 5].
    drift_sd
        Relative standard deviation of the lamps from press to press, in [0, 1].
    offset_sd_mm
        Standard deviation in mm of each coordinate of the sphere's place, in [0, 5].
    resolution
        Mesh density, by default finer than the estimates' own.
    solve
        What solves presses, with the arguments and the answer of `press_fields`; who judges many rigs gives one that
        has solved before.

    Raises
    ------
    InputError
        When an argument is of the wrong kind or outside its range.

    Examples
    --------
    >>> import numpy, tsis
    >>> from tsis.catalog import load_sphere
    >>> rig = DirectContactRig(tsis.load_probe("tsis-direct"), rng=numpy.random.default_rng(1))
    >>> frame = rig.press(load_sphere("cl2000x"), force_n=0.1)  # seconds
    >>> frame.force_n, frame.settings["radius_sd_mm"]
    (0.1, 0.03)
    """

    def __init__(
        self,
        probe: Probe,
        *,
        rng: np.random.Generator,
        sensor: Sensor | None = None,
        light: LightMap | None = None,
        calibration: Calibration | None = None,
        radius_sd_mm: float = 0.03,
        drift_sd: float = DRIFT_SD,
        offset_sd_mm: float = 0.2,
        resolution: SphereResolution = DIRECT_CONTACT_RESOLUTION,
        solve: Callable[..., Sequence[PressField]] = press_fields,
    ) -> None:
        require_type("probe", probe, Probe)
        self._light = LightMap.uniform() if light is None else light
        require_type("light", self._light, LightMap)
        require_type("resolution", resolution, SphereResolution)
        if calibration is None:
            sensor = Sensor() if sensor is None else sensor
            calibration = direct_contact_calibration(sensor, probe=probe, light=light)
        # The errors of a rig are those of a virtual probe, which draws and checks them.
        self._rig = VirtualProbe(probe, rng=rng, sensor=sensor, light=self._light, calibration=calibration)
        self.probe = probe
        self._radius_sd_mm = require_number("radius_sd_mm", radius_sd_mm, 0.0, 5.0, hint="millimetres")
        self._drift_sd = require_number("drift_sd", drift_sd, 0.0, 1.0, hint="a share of one")
        self._offset_sd_mm = require_number("offset_sd_mm", offset_sd_mm, 0.0, 5.0, hint="millimetres")
        self._rng, self._resolution, self._solve = rng, resolution, solve
        self._written = dict[SoftSphere, float]()

    @property
    def sensor(self) -> Sensor:
        """The camera, whose noise and background every frame has."""
        return self._rig.sensor

    @property
    def calibration(self) -> Calibration:
        """What the laboratory knows of probe and camera; its noise and background are the sensor's."""
        return self._rig.calibration

    @property
    def stiffness(self) -> float:
        """The true moduli of this rig's probe over the nominal ones, which no estimate knows."""
        return self._rig._stiffness

    def solved_by(self, solve: Callable[..., Sequence[PressField]], *, radius_sd_mm: float) -> DirectContactRig:
        """The same rig with another solution of its presses, for objects whose radius is known so closely."""
        other = copy(self)
        other._solve = solve
        other._radius_sd_mm = require_number("radius_sd_mm", radius_sd_mm, 0.0, 5.0, hint="millimetres")
        return other

    def press(self, sphere: SoftSphere, *, force_n: float) -> TactileImage:
        """Press a sphere with a commanded force in newtons, in [1e-3, 20], and take a frame.

        Raises
        ------
        InputError
            When the force lies outside its range or the sphere is too large for the probe.
        MechanicsError
            When the force strains sphere or probe beyond what the mechanics describe.
        """
        return self.press_path(sphere, forces_n=[force_n])[0]

    def press_path(self, sphere: SoftSphere, *, forces_n: Sequence[float]) -> tuple[TactileImage, ...]:
        """Frames at several commanded forces in newtons, in any order; one solution serves them all."""
        fields = self._commanded(sphere, forces_n)
        return tuple(self._frame(field, sphere, force) for field, force in zip(fields, forces_n, strict=True))

    def light(self, sphere: SoftSphere, *, force_n: float) -> NDArray[np.float64]:
        """Expected grey levels above the background of one press that misses ``force_n`` a little; 0 is no contact."""
        if force_n == 0.0:
            return np.zeros((self.sensor.rows, self.sensor.columns))
        return self._lit(self._commanded(sphere, [force_n])[0])

    def _commanded(self, sphere: SoftSphere, forces_n: Sequence[float]) -> list[PressField]:
        """Presses that miss their commanded forces a little."""
        require_type("sphere", sphere, SoftSphere)
        require_small_sphere(self.probe, sphere.radius_mm)
        commanded = require_array("forces_n", forces_n, ndim=1)
        for force in commanded:
            require_number("forces_n", force, 1e-3, LARGEST_FORCE_N, hint="newtons")
        missed = 1 + self.calibration.force_sd * self._rng.standard_normal(len(commanded))
        return self._fields(sphere, commanded * np.maximum(missed, 0.1))

    def _fields(self, sphere: SoftSphere, forces_n: NDArray[np.float64]) -> list[PressField]:
        # A probe stiffer by a factor presses as the nominal one does a sphere softer by it with less force.
        stiffer = self.stiffness
        softer = replace(sphere, young_kpa=sphere.young_kpa / stiffer)
        ascending, position = np.unique(forces_n, return_inverse=True)
        result = self._solve(self.probe, softer, forces_n=(ascending / stiffer).tolist(), resolution=self._resolution)
        return [
            replace(result[i], pressure_kpa=stiffer * result[i].pressure_kpa, force_n=stiffer * result[i].force_n)
            for i in position
        ]

    def _lit(self, field: PressField) -> NDArray[np.float64]:
        rig, given = self._rig, self.calibration
        observed = self._beside(render(field, self.sensor, given)) * self._light.at(*self.sensor.axes_mm())
        drift = 1 + self._drift_sd * self._rng.standard_normal()
        observed *= rig._gain * drift * rig._pattern * rig._ring_pattern(given.repeatability_sd)
        lit = float(observed[observed > LIT * observed.max()].mean())
        return observed + given.offset_sd * self._rng.standard_normal() * lit

    def _frame(self, field: PressField, sphere: SoftSphere, force_n: float) -> TactileImage:
        return TactileImage(
            grey=expose(self._lit(field), self.sensor, self._rng),
            mm_per_pixel=self.sensor.mm_per_pixel,
            full_scale=self.sensor.full_scale,
            force_n=float(force_n),
            name=f"{sphere.name or 'sphere'} at {force_n:g} N",
            settings={
                "source": "virtual",
                "probe": self.probe.name,
                "radius_mm": self.written_radius_mm(sphere),
                "radius_sd_mm": self._radius_sd_mm,
            },
        )

    def _beside(self, picture: NDArray[np.float64]) -> NDArray[np.float64]:
        """The picture of a sphere that lies a little beside the axis, where the probe is as soft as on it."""
        shift = self._offset_sd_mm * self._rng.standard_normal(2) / self.sensor.mm_per_pixel
        transformed = cv2.warpAffine(
            picture, np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]]]), picture.shape[::-1]
        )
        return np.asarray(transformed, dtype=float)

    def written_radius_mm(self, sphere: SoftSphere) -> float:
        """What the laboratory measured, once for each sphere, mm."""
        if sphere not in self._written:
            error = self._radius_sd_mm * self._rng.standard_normal()
            self._written[sphere] = max(0.1 * sphere.radius_mm, sphere.radius_mm + error)
        return self._written[sphere]


def direct_contact_calibration(
    sensor: Sensor, *, probe: Probe, light: LightMap | None = None, peak_kpa: float | None = None
) -> Calibration:
    """The default answer of grey level to pressure in direct contact.

    A tissue press spreads 1 N over the face, some kilopascals; a sphere gathers it into some tens or hundreds of them.
    So direct contact takes a shorter exposure, by which the greatest pressure fills 80 % of the scale, and a rougher
    skin, whose real contact saturates at five times that pressure.

    Parameters
    ----------
    sensor
        The camera.
    probe
        The probe; the calibration carries its name.
    light
        Light on the face as the laboratory knows it; None is even light.
    peak_kpa
        Greatest pressure to be seen, in [0.1, 1e5] kPa; by default 0.6 of the skin's modulus, within [50, 220]: what a
        sphere of 3 mm and 500 kPa reaches at 1.2 N, with a reserve.

    Raises
    ------
    InputError
        When an argument is of the wrong kind or outside its range.
    """
    require_type("sensor", sensor, Sensor)
    require_type("probe", probe, Probe)
    if peak_kpa is None:
        peak_kpa = float(np.clip(0.6 * probe.layers[0].young_kpa, 50.0, 220.0))
    require_number("peak_kpa", peak_kpa, 0.1, 1e5, hint="kilopascals")
    brightest = 1.0 if light is None else float(light.relative.max())
    return Calibration(
        name="virtual rig of direct contact, nominal",
        probe=probe.name,
        gain_grey_per_kpa=FILLED * (sensor.full_scale - sensor.background_grey) / (peak_kpa * brightest),
        saturation_kpa=SATURATION * peak_kpa,
        background_grey=sensor.background_grey,
        light=light,
        read_noise_grey=sensor.read_noise_grey,
        shot_noise_grey=sensor.shot_noise_grey,
    )

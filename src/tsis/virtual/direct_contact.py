"""The virtual rig of direct contact: frames of a soft sphere squeezed between a plate and the bare probe."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.hardness.posterior import DRIFT_SD
from tsis.hardness.sphere import press_fields, require_small_sphere
from tsis.imaging.rendering import render
from tsis.imaging.sensor import Sensor, expose
from tsis.mechanics.finite_strain.soft_sphere import SphereResolution
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage
from tsis.model.phantom import SoftSphere
from tsis.model.probe import Probe
from tsis.model.require import require_array, require_number, require_type
from tsis.virtual.probe import LARGEST_FORCE_N, VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.model.press import PressField


# Finer and of another order than the mesh of the estimates: an estimate is never compared with its own model.
DIRECT_CONTACT_RESOLUTION = SphereResolution(order=4, cells=6, rings=2, face_cells=6)
FILLED = 0.8  # fraction of the scale above the background at the nominal exposure's brightest pixel
SATURATION = 5.0  # times the greatest pressure: the response is then linear to within one per cent
LIT = 0.05  # of the brightest pixel; brighter pixels belong to the contact


class DirectContactRig:
    """A probe in contact with objects without tissue between, with the errors of an experiment.

    Its calibration states the size of the errors. Each rig has its own gain, stiffness and fixed pattern. Each press
    has an error of force, a drift of the lamps, a pattern and some stray light. Each frame has the sensor's noise. A
    sphere lies slightly off the axis, and its recorded radius has an error.

    Parameters
    ----------
    probe
        The probe.
    rng
        Random generator of all errors; a seed gives the same rig and the same frames.
    sensor
        The camera.
    light
        Light on the face; even when None. The dents of direct contact are deeper than the range of traced light.
    calibration
        Nominal response of grey level to pressure, with the sizes of the errors; `direct_contact_calibration` when
        None.
    radius_sd_mm
        Standard deviation in mm of the recorded radius, in [0, 5].
    drift_sd
        Relative standard deviation of the lamps from press to press, in [0, 1].
    offset_sd_mm
        Standard deviation in mm of each coordinate of the sphere's position, in [0, 5].
    resolution
        Mesh density, by default finer than the estimates' own.
    solve
        Solver of presses, with the arguments and the result of `press_fields`; a cached one serves many rigs.

    Raises
    ------
    InputError
        When an argument is of the wrong kind or outside its range.

    Examples
    --------
    >>> import numpy, tsis
    >>> from tsis.catalog.phantoms import load_sphere
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
        # A virtual probe draws and checks the errors of the rig.
        self._rig = VirtualProbe(
            probe, rng=rng, sensor=sensor, light=self._light, calibration=calibration, strain="small"
        )
        self.probe = probe
        self._radius_sd_mm = require_number("radius_sd_mm", radius_sd_mm, 0.0, 5.0, hint="millimetres")
        self._drift_sd = require_number("drift_sd", drift_sd, 0.0, 1.0, hint="a fraction of one")
        self._offset_sd_mm = require_number("offset_sd_mm", offset_sd_mm, 0.0, 5.0, hint="millimetres")
        self._rng, self._resolution, self._solve = rng, resolution, solve
        self._written = dict[SoftSphere, float]()

    @property
    def frame_settings(self) -> dict[str, str]:
        """Origin of every frame."""
        return {"source": "virtual", "probe": self.probe.name}

    @property
    def sensor(self) -> Sensor:
        """The camera, whose noise and background every frame has."""
        return self._rig.sensor

    @property
    def calibration(self) -> Calibration:
        """Nominal calibration of probe and camera; its noise and background are the sensor's."""
        return self._rig.calibration

    @property
    def stiffness(self) -> float:
        """The true moduli of this rig's probe over the nominal ones; no estimate uses it."""
        return self._rig._stiffness

    def solved_by(self, solve: Callable[..., Sequence[PressField]], *, radius_sd_mm: float) -> DirectContactRig:
        """Copy of the rig with another solver of presses and another error of the recorded radius."""
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
            When the strain of sphere or probe is too large for the model.
        """
        return self.press_path(sphere, forces_n=[force_n])[0]

    def press_path(self, sphere: SoftSphere, *, forces_n: Sequence[float]) -> tuple[TactileImage, ...]:
        """Frames at several commanded forces in newtons, in any order; one solution serves them all."""
        fields = self._commanded(sphere, forces_n)
        return tuple(self._frame(field, sphere, force) for field, force in zip(fields, forces_n, strict=True))

    def light(self, sphere: SoftSphere, *, force_n: float) -> NDArray[np.float64]:
        """Expected grey levels above the background of one press with an error of ``force_n``; 0 is no contact."""
        if force_n == 0.0:
            return np.zeros((self.sensor.rows, self.sensor.columns))
        return self._lit(self._commanded(sphere, [force_n])[0])

    def _commanded(self, sphere: SoftSphere, forces_n: Sequence[float]) -> list[PressField]:
        """Presses with errors of the commanded forces."""
        require_type("sphere", sphere, SoftSphere)
        require_small_sphere(self.probe, sphere.radius_mm)
        commanded = require_array("forces_n", forces_n, ndim=1)
        for force in commanded:
            require_number("forces_n", force, 1e-3, LARGEST_FORCE_N, hint="newtons")
        factor = 1 + self.calibration.force_sd * self._rng.standard_normal(len(commanded))
        return self._fields(sphere, commanded * np.maximum(factor, 0.1))

    def _fields(self, sphere: SoftSphere, forces_n: NDArray[np.float64]) -> list[PressField]:
        # Dividing all moduli and the force by the probe's stiffness factor gives the nominal probe.
        stiffness = self.stiffness
        softer = replace(sphere, young_kpa=sphere.young_kpa / stiffness)
        ascending, order = np.unique(forces_n, return_inverse=True)
        fields = self._solve(self.probe, softer, forces_n=(ascending / stiffness).tolist(), resolution=self._resolution)
        return [
            replace(fields[i], pressure_kpa=stiffness * fields[i].pressure_kpa, force_n=stiffness * fields[i].force_n)
            for i in order
        ]

    def _lit(self, field: PressField) -> NDArray[np.float64]:
        rig, calibration = self._rig, self.calibration
        light = self._shifted(render(field, self.sensor, calibration)) * self._light.at(*self.sensor.axes_mm())
        drift = 1 + self._drift_sd * self._rng.standard_normal()
        light *= rig._gain * drift * rig._pattern * rig._ring_pattern(calibration.repeatability_sd)
        lit = float(light[light > LIT * light.max()].mean())
        return light + calibration.offset_sd * self._rng.standard_normal() * lit

    def _frame(self, field: PressField, sphere: SoftSphere, force_n: float) -> TactileImage:
        return TactileImage(
            grey=expose(self._lit(field), self.sensor, self._rng),
            mm_per_pixel=self.sensor.mm_per_pixel,
            full_scale=self.sensor.full_scale,
            force_n=float(force_n),
            name=f"{sphere.name or 'sphere'} at {force_n:g} N",
            settings={
                **self.frame_settings,
                "radius_mm": self.written_radius_mm(sphere),
                "radius_sd_mm": self._radius_sd_mm,
            },
        )

    def _shifted(self, picture: NDArray[np.float64]) -> NDArray[np.float64]:
        """The picture of a sphere slightly off the axis, where the probe is as soft as on it."""
        shift = self._offset_sd_mm * self._rng.standard_normal(2) / self.sensor.mm_per_pixel
        return np.asarray(scipy.ndimage.shift(picture, shift[::-1], order=1), dtype=float)

    def written_radius_mm(self, sphere: SoftSphere) -> float:
        """Recorded radius, drawn once for each sphere, mm."""
        if sphere not in self._written:
            error = self._radius_sd_mm * self._rng.standard_normal()
            self._written[sphere] = max(0.1 * sphere.radius_mm, sphere.radius_mm + error)
        return self._written[sphere]


def direct_contact_calibration(
    sensor: Sensor, *, probe: Probe, light: LightMap | None = None, peak_kpa: float | None = None
) -> Calibration:
    """The default response of grey level to pressure in direct contact.

    Tissue spreads 1 N over the face, to some kilopascals; a sphere concentrates it to some tens or hundreds. So direct
    contact has a shorter exposure, at which the greatest pressure fills 80 % of the scale, and a rougher skin, whose
    real contact saturates at five times that pressure.

    Parameters
    ----------
    sensor
        The camera.
    probe
        The probe; the calibration has its name.
    light
        Nominal light on the face; None is even light.
    peak_kpa
        Greatest pressure in range, in [0.1, 1e5] kPa; by default 0.6 of the skin's modulus, within [50, 220]: above
        the pressure of a sphere of 3 mm and 500 kPa at 1.2 N.

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

"""The virtual probe: frames of presses on a phantom, with the errors of an experiment."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.imaging.rendering import as_contact_model, render
from tsis.imaging.sensor import Sensor, expose
from tsis.mechanics import press
from tsis.mechanics.finite_strain.neo_hookean_press import PressSeries
from tsis.mechanics.finite_strain.patches import FiniteResolution
from tsis.mechanics.small_strain.slab import Resolution
from tsis.mechanics.solid import press_solid
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_one_of, require_type
from tsis.optics.face_light import Irradiance, irradiance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.imaging.rendering import ContactModel
    from tsis.model.phantom import Phantom
    from tsis.model.press import PressField, PressMap


# Finer and of another order than the mesh of the estimator: an estimate is never compared with its own model.
FINE_RESOLUTION = Resolution(order=6, edge=0.006, growth=1.9, largest=0.17, below_cells=4, ray_layers=6)
# By strain.
RESOLUTIONS: dict[str, Resolution | FiniteResolution] = {"small": FINE_RESOLUTION, "finite": FiniteResolution()}
LARGEST_FORCE_N = 20.0  # commanded; far below the limit of `press`, so that the error of the force stays in range
DARKEST = 0.02  # of the mean light
SENSOR_VALUES = ("read_noise_grey", "shot_noise_grey", "background_grey")  # common with a calibration


class VirtualProbe:
    """A probe, its light and its camera, without hardware.

    It has the errors of its calibration, of the stated size, except the error of the reference site: the caller presses
    the tissue without inclusion. Each virtual probe has its own gain, stiffness, fixed pattern and, under traced light,
    emphasis of its lamps' shading. Each press has an error of force, its own pattern and some stray light. Each frame
    has the sensor's noise.

    Parameters
    ----------
    probe
        The probe.
    rng
        Random generator of all errors; a seed gives the same probe and the same frames.
    sensor
        The camera; by default one with the noise and the background of the calibration, or the default one.
    light
        Light on the face from inside: traced for this probe when None, which takes some seconds once;
        `LightMap.uniform` for even light.
    calibration
        Nominal response of grey level to pressure, with the sizes of the errors; by default `nominal_calibration`.
        Noise and background are properties of the sensor and must be equal in both.
    exposure
        Exposure of the camera over the usual one, in [0.01, 1], where no calibration is given; see `exposure_for`.
    contact_model
        Contact model: ``"rough"``, ``"smooth"``, ``"curvature"`` or a value of `tsis.imaging.rendering`. The
        estimates assume rough contact.
    strain
        Mechanics of the presses: ``"finite"``, one to three seconds a press, only for phantoms around the probe's axis;
        or ``"small"``, tenths of a second, for live views and inclusions beside the axis. Every press is solved.
    resolution
        Mesh density of the presses, a `Resolution` at small strain and a `FiniteResolution` at finite; by default finer
        than the estimates' own at small strain, and that of `tsis.mechanics.press` at finite.

    Raises
    ------
    UnknownNameError
        When there is no such strain or contact model.
    InputError
        When an argument is of the wrong kind, the light belongs to another face, or the calibration and the sensor
        differ in noise or background.

    Examples
    --------
    >>> import numpy, tsis
    >>> probe = VirtualProbe(tsis.load_probe("tsis-2011"), rng=numpy.random.default_rng(1))
    >>> frame = probe.press(tsis.load_phantom("size-8"), force_n=1.0)
    >>> frame.grey.shape, frame.force_n
    ((492, 768), 1.0)
    """

    def __init__(
        self,
        probe: Probe,
        *,
        rng: np.random.Generator,
        sensor: Sensor | None = None,
        light: Irradiance | LightMap | None = None,
        calibration: Calibration | None = None,
        exposure: float = 1.0,
        contact_model: ContactModel | str = "rough",
        strain: str = "finite",
        resolution: Resolution | FiniteResolution | None = None,
    ) -> None:
        require_type("probe", probe, Probe)
        require_type("rng", rng, np.random.Generator)
        self.probe = probe
        if sensor is not None:
            require_type("sensor", sensor, Sensor)
        if calibration is not None:
            require_type("calibration", calibration, Calibration)
        self._sensor = _agreed_sensor(sensor, calibration)
        self._light = irradiance(probe) if light is None else _checked_light(light, probe)
        if calibration is None:
            nominal = nominal_calibration(self._sensor, self._light, exposure=exposure)
            calibration = replace(nominal, probe=probe.name)
        self._calibration = calibration
        self._contact_model = as_contact_model(contact_model)
        self._rng = rng
        self._strain = require_one_of("strain", strain, RESOLUTIONS)
        self._resolution = RESOLUTIONS[strain] if resolution is None else resolution
        require_type("resolution", self._resolution, type(RESOLUTIONS[strain]))
        self._gain = 1 + self.calibration.gain_sd * rng.standard_normal()
        self._emphasis = self.calibration.shading_sd * rng.standard_normal()
        self._pattern = self._ring_pattern(self.calibration.pattern_sd)
        self._stiffness = float(np.exp(self.calibration.probe_young_sd * rng.standard_normal()))

    @property
    def sensor(self) -> Sensor:
        """The camera, whose noise and background every frame has."""
        return self._sensor

    @property
    def frame_settings(self) -> dict[str, str]:
        """Origin of every frame: the source, the probe and the strain of its presses, which an estimate then takes."""
        return {"source": "virtual", "probe": self.probe.name, "strain": self._strain}

    @property
    def calibration(self) -> Calibration:
        """Nominal calibration of probe and camera; its noise and background are the sensor's."""
        return self._calibration

    def aged(self, rng: np.random.Generator, *, lamps: float = 1.0, stiffness: float = 1.0) -> VirtualProbe:
        """Age the probe: a copy with other errors of its presses, and factors in [0.2, 5] on light and moduli."""
        require_type("rng", rng, np.random.Generator)
        later = copy(self)
        later._rng = rng
        later._gain = self._gain * require_number("lamps", lamps, 0.2, 5.0)
        later._stiffness = self._stiffness * require_number("stiffness", stiffness, 0.2, 5.0)
        return later

    def press(self, phantom: Phantom, *, force_n: float) -> TactileImage:
        """Press the phantom with a commanded force in newtons, in [1e-4, 20], and take a frame.

        Raises
        ------
        InputError
            When the force or the phantom lies outside its range, or at finite strain an inclusion is off the axis.
        MechanicsError
            When the strain of the tissue is too large for the model.
        MissingExtraError
            When an inclusion lies off the axis, is no body of revolution or is one of several, and NGSolve is not
            installed.
        """
        require_number("force_n", force_n, 1e-4, LARGEST_FORCE_N, hint="newtons")
        light = self.light(phantom, force_n=force_n)
        return self._image(light, force_n=force_n, name=phantom.name or "phantom")

    def light(self, phantom: Phantom, *, force_n: float) -> NDArray[np.float64]:
        """Expected grey levels above the background of one press with an error of ``force_n``; 0 is no contact."""
        require_number("force_n", force_n, 0.0, LARGEST_FORCE_N, hint="newtons")
        force = force_n * max(0.0, 1 + self.calibration.force_sd * self._rng.standard_normal())
        light = self._rendered_press(phantom, force)
        light *= self._gain * self._pattern * self._ring_pattern(self.calibration.repeatability_sd)
        stray = self.calibration.offset_sd * self._rng.standard_normal() * float(np.median(light))
        return light + stray

    def _rendered_press(self, phantom: Phantom, force_n: float) -> NDArray[np.float64]:
        """Light of the press; the model in three dimensions serves only inclusions that need it."""
        if phantom.is_axisymmetric:
            return self._rendered(self._round_press(phantom, force_n))
        if not isinstance(self._resolution, Resolution):
            raise InputError(
                "inclusion must be a sphere or spheroid on the probe's axis, and the only one, for strain='finite'; "
                f"got {phantom.inclusions!r:.200} (VirtualProbe(strain='small') accepts others)"
            )
        stiffness = self._stiffness
        solid = press_solid(
            self.probe,
            _stiffened(phantom, 1 / stiffness),
            force_n=force_n / stiffness,
            reference_resolution=self._resolution,
        )
        solid = replace(solid, pressure_kpa=stiffness * solid.pressure_kpa, force_n=force_n)
        # The grid blurs the rim and the axisymmetric reference press does not, so the grid gives only the change.
        reference = self._round_press(phantom.without_inclusion(), force_n)
        change = self._rendered(solid) - self._rendered(reference.on_grid(solid.x_mm, solid.y_mm))
        return np.maximum(self._rendered(reference) + change, 0.0)

    def _round_press(self, phantom: Phantom, force_n: float) -> PressField:
        """Press on a phantom that is symmetric around the axis.

        Dividing all moduli and the force by the probe's stiffness factor gives the nominal probe, so that one condensed
        probe serves all virtual probes.
        """
        stiffness = self._stiffness
        slab, force = _stiffened(phantom, 1 / stiffness), force_n / stiffness
        if isinstance(self._resolution, FiniteResolution) and force > 0:
            field = _series(self.probe.unlit(), self._resolution).press(slab, force_n=force)
        else:
            field = press(self.probe, slab, force_n=force, strain=self._strain, resolution=self._resolution)
        return replace(field, pressure_kpa=stiffness * field.pressure_kpa, force_n=force_n)

    def _rendered(self, field: PressField | PressMap) -> NDArray[np.float64]:
        light = self._light_on(field)
        return render(field, self.sensor, self.calibration, contact_model=self._contact_model, light=light)

    def _light_on(self, field: PressField | PressMap) -> LightMap:
        """Light on the face of a press, with this probe's emphasis of the dent's shading."""
        if not isinstance(self._light, Irradiance):
            return self._light
        lit = self._light.on(field, saturation_kpa=self.calibration.saturation_kpa)
        # Beyond the rim the map may be dark and the ratio meaningless.
        dented, undented = (np.maximum(part, DARKEST) for part in (lit.relative, self._light.at(lit.x_mm, lit.y_mm)))
        return replace(lit, relative=lit.relative * (dented / undented) ** self._emphasis)

    def _ring_pattern(self, sd: float) -> NDArray[np.float64]:
        """Factor near one that varies with the radius with standard deviation ``sd``; ring means by 0.9 of it."""
        radius, grain = self.sensor.radius_mm(), self.calibration.grain_mm
        knots = np.arange(0.0, radius.max() + grain, grain)
        # Linear interpolation reduces the variance of independent values to two thirds on average.
        values = np.sqrt(1.5) * sd * self._rng.standard_normal(len(knots))
        return np.asarray(1 + np.interp(radius, knots, values))

    def no_contact(self) -> TactileImage:
        """A frame of the untouched probe."""
        return self._image(np.zeros((self.sensor.rows, self.sensor.columns)), force_n=0.0, name="no contact")

    def _image(self, light: NDArray[np.float64], *, force_n: float, name: str) -> TactileImage:
        return TactileImage(
            grey=expose(light, self.sensor, self._rng),
            mm_per_pixel=self.sensor.mm_per_pixel,
            full_scale=self.sensor.full_scale,
            force_n=force_n,
            name=name,
            settings=self.frame_settings,
        )


@lru_cache(maxsize=4)
def _series(probe: Probe, resolution: FiniteResolution) -> PressSeries:
    """Presses at finite strain that all virtual probes of this kind share."""
    return PressSeries(probe, resolution)


def _stiffened(phantom: Phantom, factor: float) -> Phantom:
    """The phantom with all moduli times ``factor``."""
    inclusions = [replace(inclusion, young_kpa=factor * inclusion.young_kpa) for inclusion in phantom.inclusions]
    return replace(
        phantom,
        young_kpa=factor * phantom.young_kpa,
        inclusion=inclusions[0] if inclusions else None,
        more_inclusions=tuple(inclusions[1:]),
    )


def _agreed_sensor(sensor: Sensor | None, calibration: Calibration | None) -> Sensor:
    """The sensor, after a check against the calibration; without one, a sensor with the calibration's values."""
    if calibration is None:
        return Sensor() if sensor is None else sensor
    stated = {name: getattr(calibration, name) for name in SENSOR_VALUES}
    if sensor is None:
        return Sensor(**stated)
    for name, value in stated.items():
        if value != getattr(sensor, name):
            raise InputError(
                f"{name} of the calibration must equal the sensor's, {getattr(sensor, name):g}; got {value:g} "
                "(leave the sensor out, or replace the value in one of the two)"
            )
    return sensor


def _checked_light(light: Irradiance | LightMap, probe: Probe) -> Irradiance | LightMap:
    if not isinstance(light, Irradiance | LightMap):
        raise InputError(f"light must be an Irradiance, a LightMap or None; got {light!r:.80}")
    if isinstance(light, Irradiance) and not np.isclose(light.radius_mm, probe.radius_mm):
        raise InputError(
            f"light must be for a face of radius_mm = {probe.radius_mm:g}; got {light.radius_mm:g} "
            "(trace it for this probe: irradiance(probe))"
        )
    return light


def exposure_for(force_n: float) -> float:
    """Exposure at which a press with ``force_n`` does not clip: the usual one up to 1 N."""
    return min(1.0, 1.0 / require_number("force_n", force_n, 1e-4, LARGEST_FORCE_N, hint="newtons"))


def nominal_calibration(
    sensor: Sensor, light: Irradiance | LightMap | None = None, *, exposure: float = 1.0
) -> Calibration:
    """The default response of grey level to pressure: 1 N on soft tissue fills half of the scale at its brightest.

    ``exposure`` is that of the camera over the usual one, in [0.01, 1]. The response includes the light, but traced
    light only to first order in the slope of the face. None is even light that no dent changes.
    """
    exposure = require_number("exposure", exposure, 0.01, 1.0)
    light_map = light.near_undented() if isinstance(light, Irradiance) else light or LightMap.uniform()
    brightest = float(light_map.relative.max())
    return Calibration(
        name="virtual probe, nominal",
        gain_grey_per_kpa=exposure * 60.0 / brightest * sensor.full_scale / 255.0,
        saturation_kpa=20.0,
        background_grey=sensor.background_grey,
        light=light_map,
        read_noise_grey=sensor.read_noise_grey,
        shot_noise_grey=sensor.shot_noise_grey,
    )

"""The virtual probe: a press on a phantom becomes a frame, with the errors that a bench would make."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.imaging import Sensor, as_contact_model, expose, render
from tsis.mechanics import press
from tsis.mechanics.finite_strain import FiniteResolution
from tsis.mechanics.small_strain import Resolution
from tsis.mechanics.solid import press_solid
from tsis.model import Calibration, LightMap, Probe, TactileImage, require_number, require_one_of, require_type
from tsis.optics.irradiance import Irradiance, irradiance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.imaging import ContactModel
    from tsis.model import Phantom, PressField, PressMap


# Finer and of another order than the mesh inside the estimator, so that an estimate is never checked by itself.
FINE_RESOLUTION = Resolution(order=6, edge=0.006, growth=1.9, largest=0.17, below_cells=4, ray_layers=6)
RESOLUTIONS: dict[str, Resolution | FiniteResolution] = {
    "small": FINE_RESOLUTION,
    "finite": FiniteResolution(),
}  # by strain
LARGEST_FORCE_N = 20.0  # commanded; the press itself takes more, so that no drawn error runs into its limit
DARKEST = 0.02  # of the mean light
SENSOR_VALUES = ("read_noise_grey", "shot_noise_grey", "background_grey")  # which a calibration states too


class VirtualProbe:
    """A probe, its light and its camera, without hardware.

    It makes the errors that its calibration states, of the stated size, but for that of the reference site: plain
    tissue is what the caller presses. Each virtual probe has a gain, a stiffness and, under traced light, an emphasis
    of its lamps' shading of its own, and a fixed pattern that all its frames share; each press misses the commanded
    force, leaves a pattern that no other press leaves, and adds a little stray light; each frame has the sensor's
    noise.

    Parameters
    ----------
    probe
        What presses.
    rng
        Source of every error; a seed gives the same probe and the same frames.
    sensor
        The camera; without it one with the noise and the background of the calibration, or the default one.
    light
        Light that reaches the face from inside: traced for this probe when None, which takes some seconds once;
        `LightMap.uniform` for even light.
    calibration
        Response of grey level to pressure as the laboratory believes it, with the sizes of the errors; by default that
        of the sensor and the light. Noise and background are properties of the sensor: where both are given, they must
        agree.
    contact_model
        What makes light leave the probe: ``"rough"``, ``"smooth"``, ``"curvature"`` or a value of
        `tsis.imaging._contact_models`. The estimates assume rough contact.
    strain
        Mechanics of the presses: ``"small"``, tenths of a second a phantom, or ``"finite"``, for phantoms around the
        probe's axis alone, half a minute.
    resolution
        Mesh density of the presses, a `Resolution` at small strain and a `FiniteResolution` at finite; by default finer
        than the estimates' own at small strain, and that of `tsis.mechanics.press` at finite.

    Raises
    ------
    UnknownNameError
        When there is no such strain or contact model.
    InputError
        When an argument is of the wrong kind, the light is that of another face, or the calibration states another
        noise or background than the sensor has.

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
        contact_model: ContactModel | str = "rough",
        strain: str = "small",
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
            calibration = replace(nominal_calibration(self._sensor, self._light), probe=probe.name)
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
    def calibration(self) -> Calibration:
        """What the laboratory knows of probe and camera; its noise and background are the sensor's."""
        return self._calibration

    def press(self, phantom: Phantom, *, force_n: float) -> TactileImage:
        """Press the phantom with a commanded force in newtons, in [1e-4, 20], and take a frame.

        Raises
        ------
        InputError
            When the force or the phantom lies outside what the mechanics accept; at finite strain that is also an
            inclusion which is not around the axis.
        MechanicsError
            When the force strains the tissue beyond what the mechanics describe.
        MissingExtraError
            When an inclusion lies off the axis, is no body of revolution or is one of several, and NGSolve, which
            presses those, is not installed.
        """
        require_number("force_n", force_n, 1e-4, LARGEST_FORCE_N, hint="newtons")
        light = self.light(phantom, force_n=force_n)
        return self._image(light, force_n=force_n, name=phantom.name or "phantom")

    def light(self, phantom: Phantom, *, force_n: float) -> NDArray[np.float64]:
        """Expected grey levels above the background of one press that misses ``force_n`` a little; 0 is no contact."""
        require_number("force_n", force_n, 0.0, LARGEST_FORCE_N, hint="newtons")
        force = force_n * max(0.0, 1 + self.calibration.force_sd * self._rng.standard_normal())
        observed = self._deformed_face(phantom, force)
        observed *= self._gain * self._pattern * self._ring_pattern(self.calibration.repeatability_sd)
        stray = self.calibration.offset_sd * self._rng.standard_normal() * float(np.median(observed))
        return observed + stray

    def _deformed_face(self, phantom: Phantom, force_n: float) -> NDArray[np.float64]:
        """Light of the press by the model that can describe it; three dimensions only where they are needed."""

        def seen(field: PressField | PressMap) -> NDArray[np.float64]:
            return render(
                field, self.sensor, self.calibration, contact_model=self._contact_model, light=self._falling(field)
            )

        # A probe stiffer by a factor presses as the nominal one does tissue softer by it with less force: all moduli
        # and the force share a unit. So one condensed probe serves every virtual one.
        stiffer = self._stiffness
        tissue, force_n = _stiffened(phantom, 1 / stiffer), force_n / stiffer

        def field_of(slab: Phantom) -> PressField:
            field = press(self.probe, slab, force_n=force_n, strain=self._strain, resolution=self._resolution)
            return replace(field, pressure_kpa=stiffer * field.pressure_kpa, force_n=stiffer * force_n)

        if phantom.is_axisymmetric:
            return seen(field_of(tissue))
        if not isinstance(self._resolution, Resolution):
            raise InputError(
                "inclusion must be a sphere or spheroid on the probe's axis, and the only one, for strain='finite'; "
                f"got {phantom.inclusions!r:.200} (strain='small' takes any)"
            )
        result = press_solid(self.probe, tissue, force_n=force_n, plain_resolution=self._resolution)
        result = replace(result, pressure_kpa=stiffer * result.pressure_kpa, force_n=stiffer * force_n)
        # The grid blurs the rim, of which the axisymmetric press of plain tissue knows all; so only a change is taken.
        reference = field_of(tissue.without_inclusion())
        change = seen(result) - seen(reference.on_grid(result.x_mm, result.y_mm))
        return np.maximum(seen(reference) + change, 0.0)

    def _falling(self, field: PressField | PressMap) -> LightMap:
        """Light on the face of a press; the lamps of this probe make a little more or less of a dent than is known."""
        if not isinstance(self._light, Irradiance):
            return self._light
        lit = self._light.on(field, saturation_kpa=self.calibration.saturation_kpa)
        # Beyond the rim the map may be dark, where a ratio says nothing.
        dented, undented = (np.maximum(part, DARKEST) for part in (lit.relative, self._light.at(lit.x_mm, lit.y_mm)))
        return replace(lit, relative=lit.relative * (dented / undented) ** self._emphasis)

    def _ring_pattern(self, sd: float) -> NDArray[np.float64]:
        """Factor near one that varies with the radius with standard deviation ``sd``; ring means by 0.9 of it."""
        radius, grain = self.sensor.radius_mm(), self.calibration.grain_mm
        knots = np.arange(0.0, radius.max() + grain, grain)
        # Lines between independent values have on average two thirds of their variance.
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
            settings={"source": "virtual", "probe": self.probe.name},
        )


def _stiffened(phantom: Phantom, factor: float) -> Phantom:
    """The phantom with every modulus times ``factor``."""
    lumps = [replace(inclusion, young_kpa=factor * inclusion.young_kpa) for inclusion in phantom.inclusions]
    return replace(
        phantom,
        young_kpa=factor * phantom.young_kpa,
        inclusion=lumps[0] if lumps else None,
        more_inclusions=tuple(lumps[1:]),
    )


def _agreed_sensor(sensor: Sensor | None, calibration: Calibration | None) -> Sensor:
    """The given sensor, which the calibration must not contradict; else one as the calibration states it."""
    if calibration is None:
        return Sensor() if sensor is None else sensor
    stated = {name: getattr(calibration, name) for name in SENSOR_VALUES}
    if sensor is None:
        return Sensor(**stated)
    for name, value in stated.items():
        if value != getattr(sensor, name):
            raise InputError(
                f"{name} of the calibration must be that of the sensor, {getattr(sensor, name):g}; got {value:g} "
                "(leave the sensor out, or replace the value in one of the two)"
            )
    return sensor


def _checked_light(light: Irradiance | LightMap, probe: Probe) -> Irradiance | LightMap:
    if not isinstance(light, Irradiance | LightMap):
        raise InputError(f"light must be an Irradiance, a LightMap or None; got {light!r:.80}")
    if isinstance(light, Irradiance) and not np.isclose(light.radius_mm, probe.radius_mm):
        raise InputError(
            f"light must be that of a face of radius_mm = {probe.radius_mm:g}; got one of {light.radius_mm:g} "
            "(trace it for this probe: irradiance(probe))"
        )
    return light


def nominal_calibration(sensor: Sensor, light: Irradiance | LightMap | None = None) -> Calibration:
    """The default answer of grey level to pressure: 1 N on soft tissue fills half of the scale where it is brightest.

    The laboratory knows the light, but of traced light only what holds to first order in the slope of the face.
    """
    given = light.near_undented() if isinstance(light, Irradiance) else light
    brightest = 1.0 if given is None else float(given.relative.max())
    return Calibration(
        name="virtual probe, nominal",
        gain_grey_per_kpa=60.0 / brightest * sensor.full_scale / 255.0,
        saturation_kpa=20.0,
        background_grey=sensor.background_grey,
        light=given,
        read_noise_grey=sensor.read_noise_grey,
        shot_noise_grey=sensor.shot_noise_grey,
    )

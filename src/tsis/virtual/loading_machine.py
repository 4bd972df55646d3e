"""The loading machine of section 5.1 without hardware: tips on the bare probe, frames of its camera, a force gauge."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Self

import numpy as np
import scipy

from tsis.calibration.dents import PAD_THICKNESS_MM
from tsis.calibration.force_line import LARGEST_GAUGE_N
from tsis.calibration.lamps import ReferencePatch
from tsis.errors import InputError
from tsis.imaging.rendering import rough_contact
from tsis.imaging.sensor import LedDrift, Sensor, expose
from tsis.mechanics import press
from tsis.mechanics.closed_forms import HertzContact, effective_modulus_kpa, hertz_under_force
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage
from tsis.model.phantom import Phantom
from tsis.model.press import MN_PER_N
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type
from tsis.optics.face_light import Irradiance
from tsis.virtual.camera import USUAL_MS, camera_settings
from tsis.virtual.direct_contact import direct_contact_calibration
from tsis.virtual.probe import FINE_RESOLUTION, VirtualProbe

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.file import ProbeCalibration
    from tsis.model.press import PressField


LONGEST = 20_000  # frames of one machine
PATCH = ReferencePatch(first_row=4, last_row=36, first_column=4, last_column=36)
PATCH_LEVEL = 0.55  # its light as a fraction of the scale
BAD_PIXELS, HOT_GREY = 8, 40.0
DARKEST_CORNER = 0.3  # lower limit of uneven light, over the light in the middle


class LoadingCamera:
    """A camera that takes frames in sequence, each at the lamps' brightness of its time.

    ``rng`` draws all errors. With ``patch`` a corner of the frame shows the lamps directly. The first frame is
    ``warm_s`` seconds after switching the lamps on, in [0, 1e6]; the others follow every ``frame_s`` seconds, in [1e-3,
    1e4].

    Examples
    --------
    >>> camera = LoadingCamera(Sensor(), rng=np.random.default_rng(1))
    >>> even = camera.lit(np.full((492, 768), 100.0))
    >>> float(np.median(even)), camera.lamps == ()
    (108.0, False)
    """

    def __init__(
        self,
        sensor: Sensor,
        *,
        rng: np.random.Generator,
        drift: LedDrift | None = None,
        patch: bool = True,
        warm_s: float = 1800.0,
        frame_s: float = 10.0,
    ) -> None:
        require_type("sensor", sensor, Sensor)
        require_type("rng", rng, np.random.Generator)
        self.sensor, self.patch = sensor, PATCH if patch else None
        self._rng = rng
        start, step = require_number("warm_s", warm_s, 0.0, 1e6), require_number("frame_s", frame_s, 1e-3, 1e4)
        self._lamps = (drift or LedDrift()).factors(start + step * np.arange(LONGEST), rng)
        self._taken = 0
        self._hot, self._dead = rng.integers(0, sensor.rows * sensor.columns, (2, BAD_PIXELS))

    @property
    def range_grey(self) -> float:
        """Grey levels between black and full scale."""
        return self.sensor.full_scale - self.sensor.background_grey

    @property
    def lamps(self) -> tuple[float, ...]:
        """True brightness of the lamps in each frame so far, dark frames included."""
        return tuple(self._lamps[: self._taken].tolist())

    @property
    def bad_pixels(self) -> NDArray[np.bool]:
        """Hot and dead pixels, shape (rows, columns)."""
        bad = np.zeros((self.sensor.rows, self.sensor.columns), dtype=bool)
        bad.ravel()[[*self._hot, *self._dead]] = True
        return bad

    def dark(self) -> NDArray[np.float64]:
        """Grey levels with the lamps off, shape (rows, columns)."""
        self._next_lamp()
        return self._exposed(np.zeros((self.sensor.rows, self.sensor.columns)))

    def lit(self, light: NDArray[np.float64]) -> NDArray[np.float64]:
        """Grey levels of a frame from the light at lamps of brightness 1, shape (rows, columns) both."""
        light = np.array(light)
        if self.patch is not None:
            self.patch.cut(light)[:] = PATCH_LEVEL * self.range_grey
        return self._exposed(light * self._next_lamp())

    def _next_lamp(self) -> float:
        if self._taken == LONGEST:
            raise InputError(f"a loading machine takes at most {LONGEST} frames; create another")
        self._taken += 1
        return float(self._lamps[self._taken - 1])

    def _exposed(self, light: NDArray[np.float64]) -> NDArray[np.float64]:
        light.ravel()[self._dead] = 0.0
        light.ravel()[self._hot] += HOT_GREY
        return expose(light, self.sensor, self._rng)


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineErrors:
    """Errors of a loading machine: standard deviations from which it draws its own."""

    probe_young_sd: float = 0.03  # of the probe's moduli, relative
    gain_sd: float = 0.05  # of the response to pressure, relative
    shading_sd: float = 0.04  # of the unevenness of the light from the middle of the frame to its edge, relative
    tip_sd: float = 0.01  # of the light from tip to tip, relative
    repeatability_sd: float = 0.002  # of the light from press to press, relative
    pattern_sd: float = 0.0005  # of each press's pattern in rings, relative
    # Of the difference of light between unloading and loading at half of the largest force, relative
    hysteresis_sd: float = 0.003
    force_sd: float = 0.003  # of the force from the commanded force, relative; the gauge shows it
    position_sd_mm: float = 0.2  # of a tip's mounting position
    stray_grey: float = 3.0  # light of the untouched probe, grey levels; no standard deviation
    pad_young_sd: float = 0.05  # of a pad's modulus, relative
    gauge_gain_sd: float = 0.001  # of the gauge's gain
    gauge_zero_sd_n: float = 0.003  # of its zero
    gauge_noise_n: float = 0.001  # of its readings
    gauge_resolution_n: float = 0.001  # step of its display; no standard deviation

    def __post_init__(self) -> None:
        for field in fields(self):
            require_number(field.name, getattr(self, field.name), 0.0, 100.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MachineTruth:
    """True values of one machine, unknown to calibrations."""

    response: Calibration  # response of grey level to pressure at the mean light of the face and lamps of 1
    stiffness: float  # moduli of the probe over the nominal ones
    hysteresis_fraction: float  # light of unloading over that of loading, less one, at half of the largest force
    # The gauge shows ``gain * F + zero``
    gauge_gain: float
    gauge_zero_n: float
    # Light over the face, shape (rows, columns), of mean 1 outside the reference patch
    relative_light: NDArray[np.float64]


def drawn_truth(
    nominal: Calibration,
    camera: LoadingCamera,
    errors: MachineErrors,
    rng: np.random.Generator,
    level: NDArray[np.float64] | None = None,
) -> MachineTruth:
    """Draw one machine: its response to pressure around ``nominal``, its gauge, and its light over the face.

    ``level`` is the light of the lamps over the frame, shape (rows, columns); None for even light.
    """
    return MachineTruth(
        response=Calibration(
            gain_grey_per_kpa=nominal.gain_grey_per_kpa * float(np.exp(errors.gain_sd * rng.standard_normal())),
            saturation_kpa=nominal.saturation_kpa,
        ),
        stiffness=float(np.exp(errors.probe_young_sd * rng.standard_normal())),
        hysteresis_fraction=errors.hysteresis_sd * float(rng.standard_normal()),
        gauge_gain=1 + errors.gauge_gain_sd * float(rng.standard_normal()),
        gauge_zero_n=errors.gauge_zero_sd_n * float(rng.standard_normal()),
        relative_light=_shading(camera, errors.shading_sd * rng.standard_normal(3), level),
    )


def _shading(
    camera: LoadingCamera, unevenness: NDArray[np.float64], level: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """Light with linear and quadratic unevenness, of mean 1, times that of the lamps if given."""
    x, y = (axis / np.abs(axis).max() for axis in camera.sensor.axes_mm())
    linear_x, linear_y, quadratic = unevenness
    light = 1 + linear_x * x[None, :] + linear_y * y[:, None] + quadratic * (x[None, :] ** 2 + y[:, None] ** 2)
    light = np.maximum(light, DARKEST_CORNER) * camera.sensor.vignetting()
    field = np.ones(light.shape, dtype=bool)
    if camera.patch is not None:
        camera.patch.cut(field)[:] = False
    return np.asarray(light / light[field].mean() * (1.0 if level is None else level))


NOMINAL_TIP_MM, NOMINAL_N = 2.0, 2.0  # the press that determines the exposure
HEADROOM = 1.2  # range for the errors of the machine before pixels clip
FLAT_LEVELS = (0.15, 0.4, 0.65)  # of the scale
EDGE_LEVEL = 0.6
DARKEST = 0.02  # of the mean light
FULL_CONTACT = 0.4  # of the scale: full contact in the brightest light of the untouched face; dents brighten it
PROBE_PAD_SD = 0.02  # of the moduli of the pads that calibrate a virtual probe, relative


class VirtualLoadingMachine:
    """A rigid tip that presses the bare probe under a force gauge, and the probe's camera.

    The pressure is Hertz's on a half-space of the probe's effective modulus, also where the tip sinks in too deep for
    his assumptions. The light follows rough contact. Lamps drift, light is uneven, some pixels are bad, the gauge has
    errors of zero and gain and noise, and unloading has hysteresis. Each call takes a frame and some time.

    Parameters
    ----------
    probe
        The probe.
    rng
        Random generator of all errors; a seed gives the same machine and the same frames.
    sensor
        The camera.
    drift
        Drift of the lamps.
    errors
        Sizes of the errors.
    patch
        Whether the frame has a reference patch, a corner that sees the lamps directly.
    saturation_kpa
        Pressure at which the skin's asperities saturate; five times the largest nominal pressure when None.
    blur_mm
        Standard deviation of the point spread on the face, mm, in [0, 2].
    warm_s, frame_s
        Seconds from switching the lamps on to the first frame, and from frame to frame.
    light
        Light on the face from inside and its change by a dent; None for light that no dent changes.

    Raises
    ------
    InputError
        When an argument is of the wrong kind or outside its range.

    Examples
    --------
    >>> import numpy, tsis
    >>> machine = VirtualLoadingMachine(tsis.load_probe("tsis-direct"), rng=numpy.random.default_rng(1))
    >>> image, gauge_n = machine.press(2.0, 1.0)
    >>> image.grey.shape, round(gauge_n, 2)
    ((492, 768), 1.0)
    """

    def __init__(
        self,
        probe: Probe,
        *,
        rng: np.random.Generator,
        sensor: Sensor | None = None,
        drift: LedDrift | None = None,
        errors: MachineErrors | None = None,
        patch: bool = True,
        saturation_kpa: float | None = None,
        blur_mm: float = 0.05,
        warm_s: float = 1800.0,
        frame_s: float = 10.0,
        light: Irradiance | LightMap | None = None,
    ) -> None:
        require_type("probe", probe, Probe)
        require_type("rng", rng, np.random.Generator)
        self.probe, self.sensor, self.errors = probe, sensor or Sensor(), errors or MachineErrors()
        require_type("sensor", self.sensor, Sensor)
        require_type("errors", self.errors, MachineErrors)
        self._rng, self._blur_mm = rng, require_number("blur_mm", blur_mm, 0.0, 2.0, hint="millimetres")
        self.camera = LoadingCamera(self.sensor, rng=rng, drift=drift, patch=patch, warm_s=warm_s, frame_s=frame_s)
        self._tips: dict[float, tuple[float, NDArray[np.float64]]] = {}
        self._pads: dict[float, tuple[float, float]] = {}  # modulus over the nominal one, and light
        self._largest_n = 0.0
        peak = _contact(probe, 1.0, NOMINAL_TIP_MM, NOMINAL_N).peak_pressure_kpa
        self._dented, self._emphasis, self.exposure = light, 0.0, 1.0
        known = light.near_undented() if isinstance(light, Irradiance) else light
        exposed = direct_contact_calibration(self.sensor, probe=probe, light=known, peak_kpa=HEADROOM * peak)
        nominal = Calibration(
            gain_grey_per_kpa=exposed.gain_grey_per_kpa,
            saturation_kpa=5 * peak if saturation_kpa is None else saturation_kpa,
        )
        level = None if light is None else light.at(*self.sensor.axes_mm())
        # Even contact that fills the scale where the light is brightest
        self._even_grey = self.camera.range_grey / max(1.0, 1.0 if level is None else float(level.max()))
        self.truth = drawn_truth(nominal, self.camera, self.errors, rng, level)

    @classmethod
    def of(cls, rig: VirtualProbe, *, rng: np.random.Generator) -> Self:
        """The machine that calibrates a virtual probe: it loads this very probe, under its own light.

        Under a tip the skin's contact is nearly full, and at the exposure of tissue its light would clip: the machine's
        camera has a shorter one, ``exposure`` times that of the probe. Its light is even but for the probe's lamps.
        """
        require_type("rig", rig, VirtualProbe)
        errors = MachineErrors(shading_sd=0.0, stray_grey=0.0, gain_sd=0.0, pad_young_sd=PROBE_PAD_SD)
        response = rig.calibration
        machine = cls(
            rig.probe,
            rng=rng,
            sensor=rig.sensor,
            errors=errors,
            patch=False,
            saturation_kpa=response.saturation_kpa,
            light=rig._light,
        )
        level = rig._light.at(*rig.sensor.axes_mm())
        full = response.gain_grey_per_kpa * response.saturation_kpa * float(level.max())
        machine.exposure = FULL_CONTACT * machine.camera.range_grey / full
        machine._emphasis = rig._emphasis
        gain = machine.exposure * rig._gain * response.gain_grey_per_kpa
        machine.truth = replace(
            machine.truth,
            response=replace(machine.truth.response, gain_grey_per_kpa=gain),
            stiffness=rig._stiffness,
            relative_light=level * rig._pattern,
        )
        return machine

    @property
    def patch_px(self) -> tuple[int, int, int, int] | None:
        """Reference patch as left, top, right, bottom; None when there is none."""
        return None if self.camera.patch is None else self.camera.patch.patch_px

    @property
    def lamps(self) -> tuple[float, ...]:
        """True brightness of the lamps in each frame so far, dark frames included."""
        return self.camera.lamps

    def dark(self) -> TactileImage:
        """A frame with the lamps off."""
        return self._named(self.camera.dark(), "dark", lit=0.0)

    def no_contact(self) -> TactileImage:
        """A frame of the untouched probe, the lamps on."""
        self._largest_n = 0.0
        return self._lit(np.zeros(self.truth.relative_light.shape), "no contact")

    def flat(self, level: float = 0.4) -> TactileImage:
        """A frame of even contact with the whole face, at a fraction ``level`` of the scale, in [0.02, 0.9]."""
        require_number("level", level, 0.02, 0.9, hint="a fraction of the scale")
        return self._lit(level * self._even_grey * self.truth.relative_light, f"flat {level:g}")

    def edge(self, angle_deg: float = 5.0) -> TactileImage:
        """A frame of a block pressed evenly on one half of the face, with its straight edge tilted to the columns."""
        require_number("angle_deg", angle_deg, -45.0, 45.0, hint="degrees")
        x, y = self.sensor.axes_mm()
        span = x[None, :] * np.cos(np.radians(angle_deg)) + y[:, None] * np.sin(np.radians(angle_deg))
        # The clip gives the covered fraction of pixels on the edge.
        block = EDGE_LEVEL * self._even_grey * np.clip(0.5 + span / self.sensor.mm_per_pixel[0], 0.0, 1.0)
        return self._lit(self._blurred(block) * self.truth.relative_light, "edge")

    def press(self, tip_radius_mm: float, force_n: float) -> tuple[TactileImage, float]:
        """Press a tip with a commanded force, and read the camera and the gauge.

        Parameters
        ----------
        tip_radius_mm
            Radius of the tip, mm, in [0.5, 100]; its position and light are constant for one machine.
        force_n
            Newtons, in [0, 50]; 0 is no contact and starts a new loading.

        Returns
        -------
        The frame, and the gauge reading in newtons.

        Raises
        ------
        InputError
            When a value lies outside its range, or the contact would leave the frame.
        """
        tip = require_number("tip_radius_mm", tip_radius_mm, 0.5, 100.0, hint="millimetres")
        force = require_number("force_n", force_n, 0.0, LARGEST_GAUGE_N, hint="newtons")
        force *= max(0.0, 1 + self.errors.force_sd * self._rng.standard_normal())
        if force == 0:
            return self.no_contact(), self._gauge_reading(0.0)
        light = self._light(tip, force, *self._mounted(tip)) * self._press_factor(force)
        image = self._lit(light * self.truth.relative_light, f"{tip:g} mm tip at {force_n:g} N", force_n=force_n)
        return image, self._gauge_reading(force)

    def press_pad(self, young_kpa: float, force_n: float) -> tuple[TactileImage, float]:
        """Press a soft flat pad of a nominal modulus in kPa, in [0.5, 200], which its true one misses a little.

        Returns and raises as `press`, and `MechanicsError` beyond the model's strain.
        """
        require_number("young_kpa", young_kpa, 0.5, 200.0, hint="kilopascals")
        force = require_number("force_n", force_n, 0.0, LARGEST_GAUGE_N, hint="newtons")
        force *= max(0.0, 1 + self.errors.force_sd * self._rng.standard_normal())
        if force == 0:
            return self.no_contact(), self._gauge_reading(0.0)
        if young_kpa not in self._pads:
            softer = float(np.exp(self.errors.pad_young_sd * self._rng.standard_normal()))
            self._pads[young_kpa] = softer, 1 + self.errors.tip_sd * float(self._rng.standard_normal())
        factor, brighter = self._pads[young_kpa]
        stiffer = self.truth.stiffness
        pad = Phantom(young_kpa=factor * young_kpa / stiffer, poisson=0.49, thickness_mm=PAD_THICKNESS_MM)
        field = press(self.probe, pad, force_n=force / stiffer, resolution=FINE_RESOLUTION)
        field = replace(field, pressure_kpa=stiffer * field.pressure_kpa, force_n=force)
        light = brighter * self._press_factor(force) * self._on_pad(field)
        image = self._lit(light * self.truth.relative_light, f"{young_kpa:g} kPa pad at {force_n:g} N", force_n=force_n)
        return image, self._gauge_reading(force)

    def _on_pad(self, field: PressField) -> NDArray[np.float64]:
        """Light of a press that is round about the axis, under even light, shape (rows, columns)."""
        x, y = self.sensor.axes_mm()
        radius = self.sensor.radius_mm()
        slope = np.gradient(field.face_displacement_mm, field.radius_mm)
        pressure, displacement, outwards = (
            np.interp(radius, field.radius_mm, part, right=0.0)
            for part in (field.pressure_kpa, field.face_displacement_mm, slope)
        )
        light = rough_contact(pressure, self.truth.response)
        if self._dented is not None:
            away = np.maximum(radius, 1e-9)
            slopes = outwards * x / away, outwards * y[:, None] / away
            dented = self._dented.at(x, y, displacement_mm=displacement, slope_x=slopes[0], slope_y=slopes[1])
            dented = dented / np.maximum(self._dented.at(x, y), DARKEST)
            light *= dented ** (1 + self._emphasis) * self._remaining(light)
        return self._blurred(light * self._rings(radius, radius.max()))

    def loading(self, tip_radius_mm: float, forces_n: Sequence[float]) -> list[tuple[TactileImage, float]]:
        """Frames and gauge readings of forces in order of time."""
        return [self.press(tip_radius_mm, force) for force in forces_n]

    def expected_grey(self, tip_radius_mm: float, force_n: float) -> float:
        """True sum of grey levels of loading at lamps of 1, without errors of tips, presses and noise."""
        return float(self._light(tip_radius_mm, force_n, 0.0, np.zeros(2), patterned=False).sum())

    def contact(self, tip_radius_mm: float, force_n: float) -> HertzContact:
        """True contact of a tip."""
        return _contact(self.probe, self.truth.stiffness, tip_radius_mm, force_n)

    def _mounted(self, tip: float) -> tuple[float, NDArray[np.float64]]:
        """Light and position in mm of a tip, drawn on first use."""
        if tip not in self._tips:
            light = self.errors.tip_sd * float(self._rng.standard_normal())
            self._tips[tip] = light, self.errors.position_sd_mm * self._rng.standard_normal(2)
        return self._tips[tip]

    def _press_factor(self, force: float) -> float:
        """Factor on the light of one press: scatter and hysteresis."""
        self._largest_n = max(self._largest_n, force)
        part = force / self._largest_n  # a parabola of the force, zero without load and at the largest one
        hysteresis = self.truth.hysteresis_fraction * 4 * part * (1 - part)
        return (1 + hysteresis) * (1 + self.errors.repeatability_sd * self._rng.standard_normal())

    def _light(
        self, tip: float, force: float, brighter: float, position: NDArray[np.float64], *, patterned: bool = True
    ) -> NDArray[np.float64]:
        """Light of a contact under even light, shape (rows, columns)."""
        contact = self.contact(tip, force)
        x, y = self.sensor.axes_mm()
        extent = contact.contact_radius_mm + 4 * self._blur_mm + 2 * max(self.sensor.mm_per_pixel)
        columns, rows = np.abs(x - position[0]) <= extent, np.abs(y - position[1]) <= extent
        if columns[[0, -1]].any() or rows[[0, -1]].any():
            raise InputError(
                f"the contact must lie in the frame; a {tip:g} mm tip at {force:.2g} N touches "
                f"{contact.contact_radius_mm:.2g} mm around its middle (press less, or use a wider field of view)"
            )
        radius = np.hypot(x[columns][None, :] - position[0], y[rows][:, None] - position[1])
        light = rough_contact(contact.pressure_kpa(radius), self.truth.response) * (1 + brighter)
        if self._dented is not None:
            light *= self._dent(tip, contact, x[columns], y[rows], position) * self._remaining(light)
        if patterned:
            light *= self._rings(radius, extent)
        picture = np.zeros((self.sensor.rows, self.sensor.columns))
        picture[np.ix_(rows, columns)] = self._blurred(light)
        return picture

    def _rings(self, radius: NDArray[np.float64], extent: float) -> NDArray[np.float64]:
        """Pattern of one press in rings of half a millimetre, a factor near one."""
        knots = self.errors.pattern_sd * np.sqrt(1.5) * self._rng.standard_normal(int(2 * extent) + 3)
        return np.asarray(1 + np.interp(2 * radius, np.arange(len(knots)), knots))

    def _dent(
        self,
        tip: float,
        contact: HertzContact,
        x: NDArray[np.float64],
        y: NDArray[np.float64],
        position: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Light on the face against the tip over the light on the untouched face, shape (len(y), len(x))."""
        assert self._dented is not None  # asked by the caller
        along, across = x - position[0], (y - position[1])[:, None]
        within = np.hypot(along, across) <= contact.contact_radius_mm
        sunk = np.where(within, (contact.contact_radius_mm**2 - (along**2 + across**2) / 2) / tip, 0.0)
        slope_x, slope_y = (np.where(within, -part / tip, 0.0) for part in (along, across))
        here = self._dented.at(x, y, displacement_mm=sunk, slope_x=slope_x, slope_y=slope_y)
        return np.asarray((here / np.maximum(self._dented.at(x, y), DARKEST)) ** (1 + self._emphasis))

    def _remaining(self, light: NDArray[np.float64]) -> float:
        """Fraction of the light that the real contact leaves on the face."""
        assert self._dented is not None  # asked by the caller
        response, (size_x, size_y) = self.truth.response, self.sensor.mm_per_pixel
        area = float(light.sum()) * size_x * size_y / (response.gain_grey_per_kpa * response.saturation_kpa)
        return 1 / (1 + self._dented.depletion * area / (np.pi * self.probe.radius_mm**2))

    def _blurred(self, light: NDArray[np.float64]) -> NDArray[np.float64]:
        if self._blur_mm == 0:
            return light
        sigma_x, sigma_y = (self._blur_mm / size for size in self.sensor.mm_per_pixel)
        return np.asarray(scipy.ndimage.gaussian_filter(light, (sigma_y, sigma_x), mode="mirror"), dtype=float)

    def _gauge_reading(self, force: float) -> float:
        reading = self.truth.gauge_gain * force + self.truth.gauge_zero_n
        reading += self.errors.gauge_noise_n * float(self._rng.standard_normal())
        step = self.errors.gauge_resolution_n
        return reading if step == 0 else round(reading / step) * step

    def _lit(self, light: NDArray[np.float64], name: str, *, force_n: float = 0.0) -> TactileImage:
        stray = self.errors.stray_grey * self.truth.relative_light
        return self._named(self.camera.lit(light + stray), name, lit=1.0, force_n=force_n)

    def _named(self, grey: NDArray[np.float64], name: str, *, lit: float, force_n: float = 0.0) -> TactileImage:
        return TactileImage(
            grey=grey,
            mm_per_pixel=self.sensor.mm_per_pixel,
            full_scale=self.sensor.full_scale,
            force_n=force_n,
            name=name,
            settings={"source": "virtual loading machine", "probe": self.probe.name, "lamps": lit},
        )


def _contact(probe: Probe, stiffness: float, tip_radius_mm: float, force_n: float) -> HertzContact:
    """Hertz's contact on a half-space of ``stiffness`` times the probe's effective modulus."""
    return hertz_under_force(
        radius_mm=tip_radius_mm,
        force_mn=force_n * MN_PER_N,
        young_kpa=stiffness * effective_modulus_kpa(probe.layers),
        poisson=probe.layers[0].poisson,
    )


def tissue_calibration(measured: ProbeCalibration, sensor: Sensor) -> ProbeCalibration:
    """The calibration of a virtual probe at its usual exposure, from the one that `VirtualBench.of` gave.

    Light is proportional to the exposure of this camera. The force line of the tips is left out: their light would
    clip. Stray light of a press is even before the light is evened out, and uneven after that by what its pattern gets.
    """
    exposure = measured.settings["exposure_ms"] / USUAL_MS
    uneven = 0.0
    if measured.reference is not None:
        visible = measured.reference.usable & (sensor.radius_mm() < sensor.axes_mm()[1].max())
        stray = 1 / measured.reference.relative_light[visible]
        uneven = float(stray.std() / stray.mean())

    def exposed(response: Calibration | None) -> Calibration | None:
        if response is None:
            return None
        pattern = float(np.hypot(response.repeatability_sd, response.offset_sd * uneven))
        return replace(response, gain_grey_per_kpa=response.gain_grey_per_kpa / exposure, repeatability_sd=pattern)

    return replace(
        measured,
        settings=camera_settings(sensor),
        force_line=None,
        response=exposed(measured.response),
        tissue=exposed(measured.tissue),
    )

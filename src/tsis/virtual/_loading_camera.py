"""The camera of the loading machine: lamps that drift, a corner that sees them past the probe, bad pixels."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.lamps import ReferencePatch
from tsis.errors import InputError
from tsis.imaging import LedDrift, Sensor, expose
from tsis.model import Calibration, require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray


LONGEST = 20_000  # frames that the lamps are drawn for
PATCH = ReferencePatch(first_row=4, last_row=36, first_column=4, last_column=36)
PATCH_LEVEL = 0.55  # its light as a share of the scale
BAD_PIXELS, HOT_GREY = 8, 40.0


class LoadingCamera:
    """Takes one frame after the other, each under the lamps of its time.

    Parameters
    ----------
    sensor
        Pixels and noise.
    rng
        Source of every error.
    drift
        How the lamps drift; as usual when None.
    patch
        Whether a corner of the frame sees the lamps past the probe.
    warm_s, frame_s
        Seconds from switching the lamps on to the first frame, in [0, 1e6], and from frame to frame, in [1e-3, 1e4].

    Raises
    ------
    InputError
        When an argument is of the wrong kind or outside its range.

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
        start, step = (
            require_number("warm_s", warm_s, 0.0, 1e6),
            require_number("frame_s", frame_s, 1e-3, 1e4),
        )
        self._lamps = (drift or LedDrift()).factors(start + step * np.arange(LONGEST), rng)
        self._taken = 0
        self._hot, self._dead = rng.integers(0, sensor.rows * sensor.columns, (2, BAD_PIXELS))

    @property
    def range_grey(self) -> float:
        """Grey levels between black and full scale."""
        return self.sensor.full_scale - self.sensor.background_grey

    @property
    def lamps(self) -> tuple[float, ...]:
        """True brightness of the lamps in each frame so far, those without light too."""
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
        """Grey levels of light that lamps of brightness 1 would make, shape (rows, columns) both."""
        observed = np.array(light)
        if self.patch is not None:
            self.patch.cut(observed)[:] = PATCH_LEVEL * self.range_grey
        return self._exposed(observed * self._next_lamp())

    def _next_lamp(self) -> float:
        if self._taken == LONGEST:
            raise InputError(f"a loading machine takes at most {LONGEST} frames; make another")
        self._taken += 1
        return float(self._lamps[self._taken - 1])

    def _exposed(self, light: NDArray[np.float64]) -> NDArray[np.float64]:
        light.ravel()[self._dead] = 0.0
        light.ravel()[self._hot] += HOT_GREY
        return expose(light, self.sensor, self._rng)


DARKEST = 0.3  # of the light in the middle, however uneven it is


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineErrors:
    """What a bench does to the numbers; each is a standard deviation from which the machine draws its own.

    Parameters
    ----------
    probe_young_sd
        Relative, of the probe's moduli.
    gain_sd
        Relative, of the answer to pressure.
    shading_sd
        Relative, of the unevenness of the light from the middle of the frame to its edge.
    tip_sd
        Relative, of the light from tip to tip.
    repeatability_sd
        Relative, of the light from press to press.
    pattern_sd
        Relative, of a pattern in rings that each press leaves anew.
    hysteresis_sd
        Of the light that unloading shows more or less than loading, at half of the largest force, as a share of it.
    force_sd
        Relative, by which the machine misses the commanded force; the gauge sees it.
    position_sd_mm
        Of the place where a tip is mounted.
    stray_grey
        Light of the untouched probe, grey levels; no standard deviation.
    gauge_gain_sd, gauge_zero_sd_n, gauge_noise_n, gauge_resolution_n
        Of the gauge's calibration, its zero and its readings, and the step of its display.
    """

    probe_young_sd: float = 0.03
    gain_sd: float = 0.05
    shading_sd: float = 0.04
    tip_sd: float = 0.01
    repeatability_sd: float = 0.002
    pattern_sd: float = 0.0005
    hysteresis_sd: float = 0.003
    force_sd: float = 0.003
    position_sd_mm: float = 0.2
    stray_grey: float = 3.0
    gauge_gain_sd: float = 0.001
    gauge_zero_sd_n: float = 0.003
    gauge_noise_n: float = 0.001
    gauge_resolution_n: float = 0.001

    def __post_init__(self) -> None:
        for field in fields(self):
            require_number(field.name, getattr(self, field.name), 0.0, 100.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MachineTruth:
    """What this machine drew and no calibration knows.

    Attributes
    ----------
    response
        Grey level to pressure under the mean light of the face and lamps of 1.
    stiffness
        Moduli of the probe over the nominal ones.
    hysteresis_fraction
        Light of unloading over that of loading, less one, at half of the largest force.
    gauge_gain, gauge_zero_n
        The gauge shows ``gain * F + zero``.
    relative_light
        Light over the face, shape (rows, columns), of mean 1 outside the reference patch.
    """

    response: Calibration
    stiffness: float
    hysteresis_fraction: float
    gauge_gain: float
    gauge_zero_n: float
    relative_light: NDArray[np.float64]


def drawn_truth(
    nominal: Calibration, camera: LoadingCamera, errors: MachineErrors, rng: np.random.Generator
) -> MachineTruth:
    """Draw one machine: its answer to pressure around the ``nominal`` one, its gauge, and its light over the face."""
    return MachineTruth(
        response=Calibration(
            gain_grey_per_kpa=nominal.gain_grey_per_kpa * float(np.exp(errors.gain_sd * rng.standard_normal())),
            saturation_kpa=nominal.saturation_kpa,
        ),
        stiffness=float(np.exp(errors.probe_young_sd * rng.standard_normal())),
        hysteresis_fraction=errors.hysteresis_sd * float(rng.standard_normal()),
        gauge_gain=1 + errors.gauge_gain_sd * float(rng.standard_normal()),
        gauge_zero_n=errors.gauge_zero_sd_n * float(rng.standard_normal()),
        relative_light=_shading(camera, errors.shading_sd * rng.standard_normal(3)),
    )


def _shading(camera: LoadingCamera, unevenness: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light that leans to the sides and rises or falls towards the edge, of mean 1."""
    x, y = (axis / np.abs(axis).max() for axis in camera.sensor.axes_mm())
    lean_x, lean_y, bowl = unevenness
    light = 1 + lean_x * x[None, :] + lean_y * y[:, None] + bowl * (x[None, :] ** 2 + y[:, None] ** 2)
    light = np.maximum(light, DARKEST) * camera.sensor.vignetting()
    field = np.ones(light.shape, dtype=bool)
    if camera.patch is not None:
        camera.patch.cut(field)[:] = False
    return np.asarray(light / light[field].mean())

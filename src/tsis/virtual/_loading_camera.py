"""The camera of the loading machine, with drifting lamps, a reference patch and bad pixels; the machine's errors."""

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


LONGEST = 20_000  # frames of one machine
PATCH = ReferencePatch(first_row=4, last_row=36, first_column=4, last_column=36)
PATCH_LEVEL = 0.55  # its light as a fraction of the scale
BAD_PIXELS, HOT_GREY = 8, 40.0
DARKEST = 0.3  # lower limit of uneven light, over the light in the middle


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
    light = np.maximum(light, DARKEST) * camera.sensor.vignetting()
    field = np.ones(light.shape, dtype=bool)
    if camera.patch is not None:
        camera.patch.cut(field)[:] = False
    return np.asarray(light / light[field].mean() * (1.0 if level is None else level))

"""The camera's sensor: field of view, lens, noise, clipping and quantisation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.imaging.pixels import develop
from tsis.model.gel_sensor import CAMERA_2011_MM_PER_PIXEL, CAMERA_2011_PX
from tsis.model.image import require_pixel_scale
from tsis.model.require import require_array, require_integer, require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


COARSEST_ELECTRON = 0.1  # largest skewness of a pixel's noise with a normal model
SECONDS_PER_HOUR = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A grey camera behind the probe's face.

    The defaults are the dissertation's camera (768 x 492 pixels of 8.4 x 9.8 um, 8 bits) behind a lens that demagnifies
    four times, so that the picture shows the whole width of a 24 mm face and 19 mm of its height.

    Parameters
    ----------
    columns, rows
        Size of the frame in pixels, each in [8, 8192].
    mm_per_pixel
        Size (x, y) of a pixel on the face, mm.
    full_scale
        Grey level at which the camera clips: 255 for 8 bits, 4095 for 12.
    read_noise_grey
        Standard deviation of a pixel's noise without light, grey levels.
    shot_noise_grey
        Variance of the photon noise per grey level: full scale over the full well in electrons.
    background_grey
        Grey level without contact.
    field_angle_deg
        Angle from the lens's axis to the frame's corner, in [0, 80]; the light falls with the fourth power of its
        cosine. 0 is a telecentric lens.
    """

    columns: int = CAMERA_2011_PX[0]
    rows: int = CAMERA_2011_PX[1]
    mm_per_pixel: tuple[float, float] = CAMERA_2011_MM_PER_PIXEL
    full_scale: float = 255.0
    read_noise_grey: float = 0.5
    shot_noise_grey: float = 0.017
    background_grey: float = 8.0
    field_angle_deg: float = 0.0

    def __post_init__(self) -> None:
        for name in ("columns", "rows"):
            object.__setattr__(self, name, require_integer(name, getattr(self, name), 8, 8192))
        object.__setattr__(self, "mm_per_pixel", require_pixel_scale(self.mm_per_pixel))
        require_number("full_scale", self.full_scale, 1.0, 65535.0)
        require_number("read_noise_grey", self.read_noise_grey, 0.0, self.full_scale)
        require_number("shot_noise_grey", self.shot_noise_grey, 0.0, self.full_scale)
        require_number("background_grey", self.background_grey, 0.0, self.full_scale)
        require_number("field_angle_deg", self.field_angle_deg, 0.0, 80.0, hint="degrees")

    def axes_mm(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coordinates (x, y) from the optical axis of the columns' and the rows' centres, mm."""
        x = (np.arange(self.columns) - (self.columns - 1) / 2) * self.mm_per_pixel[0]
        y = (np.arange(self.rows) - (self.rows - 1) / 2) * self.mm_per_pixel[1]
        return np.asarray(x), np.asarray(y)

    def radius_mm(self) -> NDArray[np.float64]:
        """Distance of each pixel's centre from the optical axis, shape (rows, columns)."""
        x, y = self.axes_mm()
        return np.asarray(np.hypot(x[None, :], y[:, None]))

    def vignetting(self) -> NDArray[np.float64]:
        """Transmission of the lens at each pixel, 1 on the axis, shape (rows, columns); read-only.

        Examples
        --------
        >>> corner = Sensor(field_angle_deg=20.0).vignetting()[0, 0]
        >>> round(float(corner), 3) == round(float(np.cos(np.radians(20.0)) ** 4), 3)
        True
        """
        return _vignetting(self)

    @property
    def counts_electrons(self) -> bool:
        """Whether photon noise must be drawn as whole electrons, because read noise does not hide its skewness.

        Photon noise of N electrons of g grey levels has the variance ``g**2 N`` and the third moment ``g**3 N``; with
        read noise and rounding of variance s**2 the skewness is at most ``0.385 g / s``, at ``g**2 N = 2 s**2``.
        """
        quiet = np.sqrt(self.read_noise_grey**2 + 1 / 12)
        return bool(2 * self.shot_noise_grey / (np.sqrt(27.0) * quiet) > COARSEST_ELECTRON)


@lru_cache(maxsize=1)  # it costs half of a frame
def _vignetting(sensor: Sensor) -> NDArray[np.float64]:
    x, y = sensor.axes_mm()
    extent = np.tan(np.radians(sensor.field_angle_deg)) / np.hypot(x[-1], y[-1])
    secant_squared = (1 + (extent * x[None, :]) ** 2) + (extent * y[:, None]) ** 2
    fraction = np.asarray(1 / secant_squared**2)
    fraction.flags.writeable = False
    return fraction


def expose(light: NDArray[np.float64], sensor: Sensor, rng: np.random.Generator) -> NDArray[np.float64]:
    """One frame: ``light`` in grey levels, plus background, photon and read noise, rounded and clipped.

    Parameters
    ----------
    light
        Expected grey levels above the background, shape (rows, columns), >= 0.
    sensor
        The camera. Its photon noise is normal where read noise hides single electrons, else it is drawn as whole
        electrons (`Sensor.counts_electrons`), which takes longer.
    rng
        Source of the noise.
    """
    grey, shot = light, sensor.shot_noise_grey
    if sensor.counts_electrons:
        grey, shot = np.asarray(shot * rng.poisson(np.maximum(light, 0.0) / shot), dtype=float), 0.0
    frame = rng.standard_normal(light.shape)
    develop(frame, grey, sensor.background_grey, sensor.read_noise_grey, shot, sensor.full_scale)
    return frame


def interlace(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light on an interlaced sensor: even lines (0, 2, ...) from the ``first`` field, odd lines from the second.

    Examples
    --------
    >>> interlace(np.zeros((3, 1)), np.ones((3, 1))).ravel().tolist()
    [0.0, 1.0, 0.0]
    """
    if first.shape != second.shape:
        raise InputError(f"both fields must be of one shape; got {first.shape} and {second.shape}")
    frame = first.copy()
    frame[1::2] = second[1::2]
    return frame


@dataclass(frozen=True, slots=True, kw_only=True)
class LedDrift:
    """Drift of the light: ``(1 + warm_up exp(-t / tau)) exp(wander W(t))``, where W is a random walk of 1 an hour.

    Lamps are brightest when cold, so the light settles from above. The defaults suit small white lamps at constant
    current; they are assumed, not measured. Raises `InputError` when a value lies outside its range.

    Parameters
    ----------
    warm_up
        Relative excess of the light when switched on over the warm lamps, in [0, 1].
    warm_up_s
        Time constant tau of warming up, s, in [1e-3, 1e5].
    wander
        Relative standard deviation of the random walk after an hour, in [0, 0.5].
    """

    warm_up: float = 0.05
    warm_up_s: float = 300.0
    wander: float = 0.005

    def __post_init__(self) -> None:
        require_number("warm_up", self.warm_up, 0.0, 1.0, hint="a fraction of one")
        require_number("warm_up_s", self.warm_up_s, 1e-3, 1e5, hint="seconds")
        require_number("wander", self.wander, 0.0, 0.5, hint="a fraction of one")

    def factors(self, time_s: ArrayLike, rng: np.random.Generator) -> NDArray[np.float64]:
        """Factors of the light at times in seconds after switching on, (n,), ascending and not negative.

        Multiply a frame's light by its factor before exposing it.

        Examples
        --------
        >>> LedDrift(wander=0.0).factors([0.0, 300.0, 3000.0], np.random.default_rng(1)).round(4).tolist()
        [1.05, 1.0184, 1.0]
        """
        time = require_array("time_s", time_s, ndim=1)
        if time[0] < 0 or (np.diff(time) < 0).any():
            raise InputError(f"time_s must ascend from 0 or later; got {time!r:.80}")
        steps = np.sqrt(np.diff(time, prepend=0.0) / SECONDS_PER_HOUR) * rng.standard_normal(len(time))
        return np.asarray((1 + self.warm_up * np.exp(-time / self.warm_up_s)) * np.exp(self.wander * np.cumsum(steps)))

"""The camera's sensor: a field of view, and what noise, clipping and quantisation make of light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.model import check
from tsis.model.image import pixel_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A grey camera that looks at the probe's face.

    The defaults are the dissertation's camera (768 x 492 pixels of 8.4 x 9.8 um, 8 bits) behind a lens that demagnifies
    four times, so that the picture holds the whole width of a 24 mm face and 19 mm of its height.

    Parameters
    ----------
    columns, rows
        Size of the frame in pixels, each in [8, 8192].
    mm_per_pixel
        Size (x, y) of a pixel on the face, mm.
    full_scale
        Grey level at which the camera clips.
    read_noise_grey
        Standard deviation of a pixel's noise without light, grey levels.
    shot_noise_grey
        Variance of the photon noise per grey level: full scale over the full well in electrons.
    background_grey
        Grey level without contact.
    """

    columns: int = 768
    rows: int = 492
    mm_per_pixel: tuple[float, float] = (0.0336, 0.0392)
    full_scale: float = 255.0
    read_noise_grey: float = 0.5
    shot_noise_grey: float = 0.017
    background_grey: float = 8.0

    def __post_init__(self) -> None:
        check.number("columns", self.columns, 8, 8192)
        check.number("rows", self.rows, 8, 8192)
        object.__setattr__(self, "mm_per_pixel", pixel_scale(self.mm_per_pixel))
        check.number("full_scale", self.full_scale, 1.0, 65535.0)
        check.number("read_noise_grey", self.read_noise_grey, 0.0, self.full_scale)
        check.number("shot_noise_grey", self.shot_noise_grey, 0.0, self.full_scale)
        check.number("background_grey", self.background_grey, 0.0, self.full_scale)

    def axes_mm(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coordinates (x, y) from the optical axis of the columns' and the rows' centres, mm."""
        x = (np.arange(self.columns) - (self.columns - 1) / 2) * self.mm_per_pixel[0]
        y = (np.arange(self.rows) - (self.rows - 1) / 2) * self.mm_per_pixel[1]
        return np.asarray(x), np.asarray(y)

    def radius_mm(self) -> NDArray[np.float64]:
        """Distance of each pixel's centre from the optical axis, shape (rows, columns)."""
        x, y = self.axes_mm()
        return np.asarray(np.hypot(x[None, :], y[:, None]))


def expose(light: NDArray[np.float64], sensor: Sensor, rng: np.random.Generator) -> NDArray[np.float64]:
    """One frame: ``light`` in grey levels, plus background, photon and read noise, rounded and clipped.

    Parameters
    ----------
    light
        Expected grey levels above the background, shape (rows, columns), >= 0.
    sensor
        The camera.
    rng
        Source of the noise; photon noise is taken as normal, which holds from some ten electrons on.
    """
    expected = light + sensor.background_grey
    deviation = np.sqrt(sensor.read_noise_grey**2 + sensor.shot_noise_grey * np.maximum(light, 0.0))
    noisy = expected + deviation * rng.standard_normal(light.shape)
    return np.clip(np.rint(noisy), 0.0, sensor.full_scale)

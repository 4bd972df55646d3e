"""The camera of the loading machine: lamps that drift, a corner that sees them past the probe, bad pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.lamps.patch import ReferencePatch
from tsis.imaging.led_drift import LedDrift
from tsis.imaging.sensor import Sensor, expose
from tsis.model.check import require_number, require_type
from tsis.model.errors import InputError

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
        seen = np.array(light)
        if self.patch is not None:
            self.patch.cut(seen)[:] = PATCH_LEVEL * self.range_grey
        return self._exposed(seen * self._next_lamp())

    def _next_lamp(self) -> float:
        if self._taken == LONGEST:
            raise InputError(f"a loading machine takes at most {LONGEST} frames; make another")
        self._taken += 1
        return float(self._lamps[self._taken - 1])

    def _exposed(self, light: NDArray[np.float64]) -> NDArray[np.float64]:
        light.ravel()[self._dead] = 0.0
        light.ravel()[self._hot] += HOT_GREY
        return expose(light, self.sensor, self._rng)

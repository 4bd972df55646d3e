"""The virtual probe: a press on a phantom becomes a frame, with the errors that a bench would make."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from tsis.imaging.render import render
from tsis.imaging.sensor import Sensor, expose
from tsis.mechanics import Resolution, press
from tsis.model import Calibration, TactileImage, check

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import Phantom, Probe

# Finer and of another order than the mesh inside the estimator, so that an estimate is never checked by itself.
FINE = Resolution(order=6, edge=0.006, growth=1.9, largest=0.17, below_cells=4, ray_layers=6)
PATTERN_GRAIN_MM = 1.0


class VirtualProbe:
    """A probe, its light and its camera, without hardware.

    Each virtual probe has a gain of its own that its calibration does not know exactly and a fixed pattern that all
    its frames share; each press misses the commanded force a little.

    Parameters
    ----------
    probe
        What presses.
    rng
        Source of every error; a seed gives the same probe and the same frames.
    sensor
        The camera.
    calibration
        Answer of grey level to pressure as the laboratory believes it, with the sizes of the errors.
    resolution
        Mesh density of the presses.

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
        calibration: Calibration | None = None,
        resolution: Resolution = FINE,
    ) -> None:
        self.probe = probe
        self.sensor = sensor or Sensor()
        self.calibration = calibration or nominal_calibration(self.sensor)
        self._rng = rng
        self._resolution = resolution
        self._gain = 1 + self.calibration.gain_sd * rng.standard_normal()
        self._pattern = 1 + self.calibration.pattern_sd * _grain(self.sensor, rng)

    def press(self, phantom: Phantom, *, force_n: float) -> TactileImage:
        """Press the phantom with a commanded force in newtons, in (0, 50], and take a frame.

        Raises
        ------
        InputError
            When the force or the phantom lies outside what the mechanics accept.
        MechanicsError
            When the tissue would lift off the face.
        """
        check.number("force_n", force_n, 1e-4, 50.0, hint="newtons")
        light = self.light(phantom, force_n=force_n)
        return self._image(light, force_n=force_n, name=phantom.name or "phantom")

    def light(self, phantom: Phantom, *, force_n: float) -> NDArray[np.float64]:
        """Expected grey levels above the background of one press that misses ``force_n`` a little; 0 is no contact."""
        check.number("force_n", force_n, 0.0, 50.0, hint="newtons")
        force = force_n * max(0.0, 1 + self.calibration.force_sd * self._rng.standard_normal())
        field = press(self.probe, phantom, force_n=force, resolution=self._resolution)
        return self._gain * self._pattern * render(field, self.sensor, self.calibration)

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


def nominal_calibration(sensor: Sensor) -> Calibration:
    """The default answer of grey level to pressure: 1 N on soft tissue fills half of the scale."""
    return Calibration(
        name="virtual probe, nominal",
        gain_grey_per_kpa=60.0 * sensor.full_scale / 255.0,
        saturation_kpa=20.0,
        background_grey=sensor.background_grey,
        read_noise_grey=sensor.read_noise_grey,
        shot_noise_grey=sensor.shot_noise_grey,
    )


def _grain(sensor: Sensor, rng: np.random.Generator) -> NDArray[np.float64]:
    """Smooth random pattern of unit variance, as uneven gel and light leave it."""
    white = rng.standard_normal((sensor.rows, sensor.columns))
    sigma_x, sigma_y = (PATTERN_GRAIN_MM / size for size in sensor.mm_per_pixel)
    smooth = np.asarray(cv2.GaussianBlur(white, (0, 0), sigmaX=sigma_x, sigmaY=sigma_y), dtype=float)
    return np.asarray(smooth / smooth.std())

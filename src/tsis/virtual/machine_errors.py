"""What a bench does to the numbers of a calibration: sizes of the errors, and what one machine drew of them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from tsis.model import Calibration
from tsis.model.check import require_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.virtual.loading_camera import LoadingCamera

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
    place_sd_mm
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
    place_sd_mm: float = 0.2
    stray_grey: float = 3.0
    gauge_gain_sd: float = 0.001
    gauge_zero_sd_n: float = 0.003
    gauge_noise_n: float = 0.001
    gauge_resolution_n: float = 0.001

    def __post_init__(self) -> None:
        for one in fields(self):
            require_number(one.name, getattr(self, one.name), 0.0, 100.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MachineTruth:
    """What this machine drew and no calibration knows.

    Attributes
    ----------
    answer
        Grey level to pressure under the mean light of the face and lamps of 1.
    stiffness
        Moduli of the probe over the nominal ones.
    hysteresis_share
        Light of unloading over that of loading, less one, at half of the largest force.
    gauge_gain, gauge_zero_n
        The gauge shows ``gain * F + zero``.
    relative_light
        Light over the face, shape (rows, columns), of mean 1 outside the reference patch.
    """

    answer: Calibration
    stiffness: float
    hysteresis_share: float
    gauge_gain: float
    gauge_zero_n: float
    relative_light: NDArray[np.float64]


def drawn_truth(
    nominal: Calibration, camera: LoadingCamera, errors: MachineErrors, rng: np.random.Generator
) -> MachineTruth:
    """Draw one machine: its answer to pressure around the ``nominal`` one, its gauge, and its light over the face."""
    return MachineTruth(
        answer=Calibration(
            gain_grey_per_kpa=nominal.gain_grey_per_kpa * float(np.exp(errors.gain_sd * rng.standard_normal())),
            saturation_kpa=nominal.saturation_kpa,
        ),
        stiffness=float(np.exp(errors.probe_young_sd * rng.standard_normal())),
        hysteresis_share=errors.hysteresis_sd * float(rng.standard_normal()),
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

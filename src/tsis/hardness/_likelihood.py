"""Likelihood of contact radii and light for a sphere of given modulus, Poisson's ratio and radius."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.hardness._reading import ContactReading
    from tsis.hardness._table import ContactTable
    from tsis.model.calibration import Calibration


DRIFT_SD = 0.003  # relative standard deviation of the lamps from press to press
STEP = 0.01  # of the logarithms by which derivatives are taken
OWN_FRACTION = 0.5  # of the table's squared error, independent in each press; the rest is common to a sphere's presses
RIGID_KPA, RIGID_POISSON = 1e8, 0.3  # of a steel ball: all of the compliance is the probe's


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactPress:
    """One press as measured by gauge and camera."""

    force_n: float  # by the gauge
    seen: ContactReading  # from the frame
    ball_radius_mm: float | None = None  # of the pressed rigid ball; None for the object
    ball_radius_sd: float = 0.0  # relative standard deviation of that radius


class HardnessLikelihood:
    """Normal errors of the logarithms of radius and light, with all nuisances but three integrated out.

    Errors of a contact radius come from image, table, and from force and probe modulus through the contact mechanics.
    Errors of the light come from image, force, drift of the lamps and gain. Gain and probe modulus are common to all
    presses. Modulus, Poisson's ratio and radius of the sphere are arguments.
    """

    def __init__(
        self, presses: Sequence[ContactPress], *, table: ContactTable, calibration: Calibration, drift_sd: float
    ) -> None:
        self.presses, self.table = tuple(presses), table
        self._calibration, self._drift_sd = calibration, drift_sd
        observed = [press.seen for press in presses]
        self.log_radius = np.log([item.radius_mm for item in observed])
        self.log_light = np.log(
            [item.light_force_n / press.force_n for item, press in zip(observed, presses, strict=True)]
        )
        light = calibration.gain_sd**2 + np.zeros((len(presses), len(presses)))
        own = np.array([item.light_force_sd**2 for item in observed]) + drift_sd**2 + calibration.force_sd**2
        self._light = light + np.diag(own)

    def __call__(self, young_kpa: Any, poisson: Any, radius_mm: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Log likelihood and squared misfit, of the shape of the arguments, which broadcast."""
        residual, covariance = self.residuals(young_kpa, poisson, radius_mm)
        factor = np.linalg.cholesky(covariance)
        white = np.linalg.solve(factor, residual[..., None])[..., 0]
        misfit = (white**2).sum(axis=-1)
        volume = np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(axis=-1)
        return -misfit / 2 - volume, misfit

    def residuals(
        self, young_kpa: Any, poisson: Any, radius_mm: Any
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Residuals of all radii, then all lights, as a last axis, and their covariance."""
        young_kpa, poisson, radius_mm = np.broadcast_arrays(young_kpa, poisson, radius_mm)
        shape, count = young_kpa.shape, len(self.presses)
        residual = np.zeros((*shape, 2 * count))
        by_force, by_probe, by_ball, error = np.zeros((4, *shape, count))
        for index, press in enumerate(self.presses):
            sphere = (young_kpa, poisson, radius_mm)
            if press.ball_radius_mm is not None:
                sphere = (
                    np.full(shape, RIGID_KPA),
                    np.full(shape, RIGID_POISSON),
                    np.full(shape, press.ball_radius_mm),
                )
            here = self.table.log_radius(*sphere, press.force_n)
            by_force[..., index] = (self.table.log_radius(*sphere, press.force_n * np.exp(STEP)) - here) / STEP
            stiffer = self.table.log_radius(*sphere, press.force_n, probe_factor=np.exp(STEP))
            by_probe[..., index] = (stiffer - here) / STEP
            residual[..., index] = self.log_radius[index] - here
            error[..., index] = self.table.error_at(*self.table.coordinates(*sphere, press.force_n))
            if press.ball_radius_mm is not None:
                wider = self.table.log_radius(*sphere[:2], sphere[2] * np.exp(STEP), press.force_n)
                by_ball[..., index] = press.ball_radius_sd * (wider - here) / STEP
        residual[..., count:] = self.log_light
        return residual, self._covariance(by_force, by_probe, by_ball, error)

    def _covariance(
        self,
        by_force: NDArray[np.float64],
        by_probe: NDArray[np.float64],
        by_ball: NDArray[np.float64],
        error: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        count, calibration = len(self.presses), self._calibration
        ball = np.array([press.ball_radius_mm is not None for press in self.presses])
        same = ball[:, None] == ball  # presses of one body have the ball's radius and the table's error in common
        image = np.array([press.seen.radius_sd**2 for press in self.presses])
        shared = (1 - OWN_FRACTION) * same + OWN_FRACTION * np.eye(count)
        radius = np.diag(image) + shared * error[..., :, None] * error[..., None, :]
        radius = radius + calibration.probe_young_sd**2 * by_probe[..., :, None] * by_probe[..., None, :]
        radius = radius + by_ball[..., :, None] * by_ball[..., None, :] * same
        own_force = calibration.force_sd**2 * np.eye(count)
        radius = radius + own_force * by_force[..., :, None] * by_force[..., None, :]
        both = own_force * by_force[..., :, None]
        light = np.broadcast_to(self._light, radius.shape)
        upper = np.concatenate([radius, both], axis=-1)
        lower = np.concatenate([np.swapaxes(both, -1, -2), light], axis=-1)
        return np.concatenate([upper, lower], axis=-2)

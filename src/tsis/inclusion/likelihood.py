"""How well an inclusion explains the profiles, with every nuisance integrated out.

The nuisances enter linearly around a point and have a normal prior, so the integral is exact for that linearisation:
with whitened residual r and whitened derivatives J by nuisances of unit variance, the evidence needs only I + J'J.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cholesky, solve_triangular

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.forward import ForwardModel
    from tsis.model import Calibration


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profiles:
    """Measured ring profiles.

    Attributes
    ----------
    grey
        Mean grey level above background, shape (frames, rings).
    variance
        Variance of each mean by pixel noise and by the error of the press model, shape (frames, rings).
    usable
        Rings in which nothing clips and pixels exist, shape (frames, rings).
    """

    grey: NDArray[np.float64]
    variance: NDArray[np.float64]
    usable: NDArray[np.bool]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """Log evidence of each inclusion (n,), its best nuisances (n, nuisances) and the misfit there (n,)."""

    log_evidence: NDArray[np.float64]
    nuisance: NDArray[np.float64]
    misfit: NDArray[np.float64]


class Likelihood:
    """Likelihood of inclusions given profiles."""

    def __init__(self, model: ForwardModel, data: Profiles) -> None:
        self._model = model
        self._use = np.flatnonzero(data.usable.ravel())
        self._grey = data.grey.ravel()[self._use]
        # Rings without a usable pixel would give an offset of NaN; they are not used.
        means = np.array(
            [
                grey[use].mean() if use.any() else 0.0
                for grey, use in zip(data.grey * model.level, data.usable, strict=True)
            ]
        )
        self._sd = model.nuisance_sd(np.maximum(means, 1e-6))
        covariance = noise_covariance(data, model.calibration).reshape(data.grey.size, data.grey.size)
        root = cholesky(covariance[np.ix_(self._use, self._use)], lower=True)
        self._whitening = solve_triangular(root, np.eye(len(root)), lower=True)
        self.start = np.zeros(len(self._sd))

    def __call__(self, inclusions: NDArray[np.float64], nuisance: NDArray[np.float64]) -> Fit:
        """Evaluate inclusions (n, 3), linearised at ``nuisance``."""
        grey, slopes = self._model.profiles(inclusions, nuisance)
        count, size = len(grey), len(nuisance)
        residual = self._grey - grey.reshape(count, -1)[:, self._use]
        slopes = slopes.reshape(count, -1, size)[:, self._use]
        # With eta = nuisance + step, y - m(nuisance) = J step, and the prior pulls eta, not the step, to zero.
        white = self._whiten(residual[:, :, None])[:, :, 0]
        turned = self._whiten(slopes)
        white = white + turned @ nuisance
        # In units of their standard deviations, so that a nuisance known exactly (0) is no special case.
        turned *= self._sd
        normal = np.swapaxes(turned, 1, 2) @ turned + np.eye(size)
        right = np.swapaxes(turned, 1, 2) @ white[:, :, None]
        best = np.asarray(np.linalg.solve(normal, right)[:, :, 0], dtype=float)
        square = (white**2).sum(axis=1) - (right[:, :, 0] * best).sum(axis=1)
        _, log_determinant = np.linalg.slogdet(normal)
        return Fit(log_evidence=-0.5 * (square + log_determinant), nuisance=best * self._sd, misfit=square)

    def _whiten(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Apply the inverse root of the noise covariance along the rings, axis 1 of (n, rings, k)."""
        count, rings, width = columns.shape
        flat = np.moveaxis(columns, 1, 0).reshape(rings, count * width)
        return np.moveaxis((self._whitening @ flat).reshape(rings, count, width), 0, 1)


def noise_covariance(data: Profiles, calibration: Calibration) -> NDArray[np.float64]:
    """Covariance of the ring means, shape (frames, rings, frames, rings).

    The fixed pattern is common to all frames of a ring; repeatability and pixel noise are not.
    """
    frames, rings = data.grey.shape
    grey = np.where(data.usable, data.grey, 1.0)
    variance = np.where(data.usable, data.variance, 1.0)
    covariance = np.zeros((frames, rings, frames, rings))
    index = np.arange(rings)
    pattern = calibration.pattern_sd**2 * grey[:, None, :] * grey[None, :, :]
    covariance[:, index, :, index] = np.moveaxis(pattern, 2, 0)
    own = variance + (calibration.repeatability_sd * grey) ** 2
    for frame in range(frames):
        covariance[frame, index, frame, index] += own[frame]
    return covariance

"""Likelihood of inclusions given ring profiles, with the nuisances integrated out, and the Cramér–Rao bound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cholesky, solve_triangular

if TYPE_CHECKING:
    from tsis.inclusion._prior import Booleans, Floats
    from tsis.inclusion.posterior._forward import ForwardModel
    from tsis.mechanics.surrogate import TissueSurrogate
    from tsis.model import Calibration


def least_sd(information: Floats) -> Floats:
    """Cramér–Rao bound of each standard deviation, shape (..., k), from information (..., k, k).

    Infinite for all parameters where the information is singular.
    """
    values, directions = np.linalg.eigh(information)
    regular = values[..., :1] > np.finfo(float).eps * values[..., -1:]  # eigenvalues ascend
    variance = np.einsum("...ij,...j->...i", directions**2, 1 / np.where(regular, values, 1.0))
    return np.asarray(np.where(regular, np.sqrt(variance), np.inf))


NEGLIGIBLE_SIZE = 1e-2  # of a residual, in units of its noise, over all inclusions
LIMIT_SD = 3.0  # standard deviations of a nuisance
DERIVATIVE_STEP = 1e-3  # of each parameter


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profiles:
    """Measured ring profiles.

    Attributes
    ----------
    grey
        Mean grey level above background at uniform light, shape (frames, rings).
    variance
        Variance of each mean by pixel noise and by the error of the press model, shape (frames, rings).
    usable
        Rings with pixels, none of them clipped, shape (frames, rings).
    """

    grey: Floats
    variance: Floats
    usable: Booleans


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LikelihoodFit:
    """Log evidence of each inclusion (n,), its best nuisances (n, nuisances) and the misfit there (n,)."""

    log_evidence: Floats
    nuisance: Floats
    misfit: Floats


class InclusionLikelihood:
    """Likelihood of inclusions given profiles."""

    def __init__(self, model: ForwardModel, data: Profiles) -> None:
        self.model = model
        self._data = data
        # Rings without a usable pixel would give an offset of NaN.
        means = np.array(
            [
                grey[use].mean() if use.any() else 0.0
                for grey, use in zip(data.grey * model.level, data.usable, strict=True)
            ]
        )
        self._sd = model.nuisance_sd(np.maximum(means, 1e-6))
        self._use = np.flatnonzero(data.usable.ravel())
        correlation = np.eye(data.grey.shape[1]) if model.correlation is None else model.correlation
        covariance = noise_covariance(data, model.calibration, correlation)[np.ix_(self._use, self._use)]
        self._whitening = solve_triangular(cholesky(covariance, lower=True), np.eye(len(self._use)), lower=True)
        self.start = np.zeros(len(self._sd))

    def __call__(self, inclusions: Floats | None, nuisance: Floats) -> LikelihoodFit:
        """Evaluate inclusions (n, 3), or tissue without inclusion, n = 1, linearised at ``nuisance``."""
        grey, slopes = self.model.profiles(inclusions, nuisance)
        white = self._whiten(self._data.grey - grey)
        # With eta = nuisance + step, y - m(nuisance) = J step, and the prior pulls eta, not the step, to zero.
        rotated = self._whiten(slopes) * self._sd
        return _fit(white + rotated @ self._units(nuisance), rotated, self._sd)

    def near(self, inclusion: Floats, nuisance: Floats) -> LinearisedLikelihood:
        """The likelihood with constant derivatives by the nuisances, those at one inclusion (3,)."""
        _, slopes = self.model.profiles(inclusion[None], nuisance)
        rotated = self._whiten(slopes)[0] * self._sd
        root = cholesky(rotated @ rotated.T + np.eye(len(rotated)), lower=True)
        start = rotated @ self._units(nuisance)

        def residual(inclusions: Floats | None) -> Floats:
            white = self._whiten(self._data.grey - self.model.grey(inclusions, nuisance)) + start
            return np.asarray(solve_triangular(root, white.T, lower=True).T)

        table = self.model.table(nuisance)
        reference, at_nodes = residual(None)[0], residual(table.nodes())
        # Few directions of the residual depend on the inclusion; the rest is a constant.
        _, size, directions = np.linalg.svd(at_nodes - reference, full_matrices=False)
        selected = directions[: max(1, int((size > NEGLIGIBLE_SIZE).sum()))]
        rest = reference - selected.T @ (selected @ reference)
        return LinearisedLikelihood(
            residual=table.through(selected @ reference, at_nodes @ selected.T),
            constant=float(-0.5 * rest @ rest - np.log(np.diag(root)).sum()),
        )

    def with_information(self, inclusion: Floats, nuisance: Floats) -> tuple[LikelihoodFit, Floats]:
        """The fit of an inclusion (3,) and its Fisher information (3, 3), with the nuisances integrated out."""
        grey, slopes = self.model.profiles(inclusion[None], nuisance)
        rotated = self._whiten(slopes) * self._sd
        white = self._whiten(self._data.grey - grey)
        steps = np.diag(DERIVATIVE_STEP * inclusion)
        ends = self.model.grey(np.concatenate([inclusion + steps, inclusion - steps]), nuisance)
        change = self._whiten(ends[:3] - ends[3:]) / (2 * np.diag(steps))[:, None]
        root = cholesky(rotated[0] @ rotated[0].T + np.eye(rotated.shape[1]), lower=True)
        triangular = solve_triangular(root, change.T, lower=True)
        return _fit(white + rotated @ self._units(nuisance), rotated, self._sd), triangular.T @ triangular

    def within(self, nuisance: Floats) -> Floats:
        """Nuisances clipped to `LIMIT_SD` and the surrogate's box, and 0 where the model is linear."""
        low, high = self.model.bounds()
        limit = LIMIT_SD * self._sd
        return np.clip(nuisance, np.maximum(low, -limit), np.minimum(high, limit))

    def _units(self, nuisance: Floats) -> Floats:
        """Nuisances in units of their standard deviations, which may be 0."""
        return np.divide(nuisance, self._sd, out=np.zeros_like(self._sd), where=self._sd > 0)

    def _whiten(self, columns: Floats) -> Floats:
        """Apply the inverse root of the noise covariance to (n, frames, rings, ...); shape (n, used rings, ...)."""
        flat = columns.reshape(len(columns), -1, *columns.shape[3:])[:, self._use]
        return np.asarray(np.tensordot(self._whitening, flat, axes=(1, 1)).swapaxes(0, 1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearisedLikelihood:
    """A fast likelihood with the derivatives by the nuisances at one inclusion, where it is exact."""

    # Surrogate of the residual in the directions that depend on the inclusion, of unit covariance
    residual: TissueSurrogate
    constant: float  # the rest of the log evidence

    def __call__(self, inclusions: Floats) -> Floats:
        """Log evidence of inclusions (n, 3)."""
        residual = self.residual(*inclusions.T)
        return np.asarray(self.constant - 0.5 * np.einsum("nk,nk->n", residual, residual))


def _fit(white: Floats, rotated: Floats, sd: Floats) -> LikelihoodFit:
    """Integrate the nuisances out of whitened residuals (n, m), linear in them by ``rotated`` (n, m, nuisances)."""
    normal = np.swapaxes(rotated, 1, 2) @ rotated + np.eye(len(sd))
    right = np.swapaxes(rotated, 1, 2) @ white[:, :, None]
    best = np.asarray(np.linalg.solve(normal, right)[:, :, 0], dtype=float)
    square = (white**2).sum(axis=1) - (right[:, :, 0] * best).sum(axis=1)
    _, log_determinant = np.linalg.slogdet(normal)
    return LikelihoodFit(log_evidence=-0.5 * (square + log_determinant), nuisance=best * sd, misfit=square)


def noise_covariance(data: Profiles, calibration: Calibration, correlation: Floats) -> Floats:
    """Covariance of the ring means, shape (frames * rings, frames * rings).

    The fixed pattern is common to all frames; repeatability is independent between presses. ``correlation``,
    (rings, rings), is that of both between rings. Pixel noise and surrogate error are independent between rings.
    """
    frames, rings = data.grey.shape
    between = np.full((frames, frames), calibration.pattern_sd**2) + calibration.repeatability_sd**2 * np.eye(frames)
    covariance = data.grey.ravel()[:, None] * data.grey.ravel() * np.kron(between, correlation)
    covariance[np.diag_indices(frames * rings)] += data.variance.ravel()
    return np.asarray(covariance)

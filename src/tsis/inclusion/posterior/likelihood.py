"""Likelihood of inclusions given ring profiles, and the Cramér–Rao bound."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.inclusion.posterior.uneven_tissue import (
    IMPROBABLE_HYPOTHESIS,
    LAYER_SDS,
    NoiseHypotheses,
    SuperficialLayer,
    log_root,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.inclusion.posterior.forward import ForwardModel
    from tsis.inclusion.posterior.uneven_tissue import Heterogeneity
    from tsis.inclusion.prior import Booleans, Floats, Integers
    from tsis.mechanics.surrogate.polynomial import TissueSurrogate
    from tsis.model.calibration import Calibration


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
CHUNK = 256  # inclusions at a time


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
    position
        Covariance of the means by the error of `off_axis_profile`, shape (frames * rings, frames * rings); None on the
        axis.
    """

    grey: Floats
    variance: Floats
    usable: Booleans
    position: Floats | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LikelihoodFit:
    """Log evidence of each inclusion (n,), and its most probable hypothesis, with best nuisances and misfit."""

    log_evidence: Floats
    nuisance: Floats  # shape (n, nuisances)
    misfit: Floats  # shape (n,)
    hypothesis: Integers  # index of the hypothesis on the tissue's heterogeneity, shape (n,)


class InclusionLikelihood:
    """Likelihood of inclusions given profiles: a mixture over the hypotheses on the tissue's heterogeneity.

    Uneven tissue adds to the noise of the rings. What it adds is taken at one inclusion, ``about``, or at tissue
    without inclusion where that is None, and changes little over a posterior.
    """

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
        self._noise = noise_covariance(data, model.calibration, correlation)[np.ix_(self._use, self._use)]
        self._latest: tuple[bytes, NoiseHypotheses] | None = None
        self._profiled: tuple[bytes, tuple[Floats, Floats]] | None = None
        self.start = np.zeros(len(self._sd))

    def __call__(self, inclusions: Floats | None, nuisance: Floats, *, about: Floats | None = None) -> LikelihoodFit:
        """Evaluate inclusions (n, 3), or tissue without inclusion, n = 1, linearised at ``nuisance``."""
        residual, rotated = self._linear(inclusions, nuisance)
        return _mixed(self._hypotheses(about, nuisance), residual, rotated, self._sd)

    def narrowed(
        self, inclusion: Floats, nuisance: Floats, *, least: float = IMPROBABLE_HYPOTHESIS
    ) -> InclusionLikelihood:
        """The likelihood without the hypotheses below ``least`` of the most probable one at an inclusion (3,)."""
        if self.model.heterogeneity is None:
            return self
        residual, rotated = self._linear(inclusion[None], nuisance)
        evidence = _evidence(self._hypotheses(inclusion, nuisance), residual, rotated, self._sd)[0][:, 0]
        return self.under(self.model.heterogeneity.selected(evidence, least=least))

    def under(self, heterogeneity: Heterogeneity) -> InclusionLikelihood:
        """The likelihood under other hypotheses on the tissue."""
        other = InclusionLikelihood(replace(self.model, heterogeneity=heterogeneity), self._data)
        other._profiled = self._profiled
        return other

    def near(self, inclusion: Floats, nuisance: Floats) -> LinearisedLikelihood:
        """The likelihood with constant derivatives by the nuisances, those at one inclusion (3,)."""
        _, slopes = self._profiles(inclusion[None], nuisance)
        rotated = self._used(slopes)[0] * self._sd
        start = rotated @ self._units(nuisance)
        hypotheses = self._hypotheses(inclusion, nuisance)
        allowed = rotated @ rotated.T  # the covariance by all nuisances
        roots = np.asarray(np.linalg.cholesky(hypotheses.covariance + allowed), dtype=float)
        least = np.linalg.cholesky(self._noise + allowed)

        def residual(inclusions: Floats | None) -> Floats:
            above = self._used(self._data.grey - self.model.grey(inclusions, nuisance)) + start
            return np.asarray(scipy.linalg.solve_triangular(least, above.T, lower=True).T)

        table = self.model.table(nuisance)
        reference, at_nodes = residual(None)[0], residual(table.nodes())
        # Few directions of the residual depend on the inclusion; the rest is a constant.
        _, size, directions = np.linalg.svd(at_nodes - reference, full_matrices=False)
        selected = directions[: max(1, int((size > NEGLIGIBLE_SIZE).sum()))]
        rest = reference - selected.T @ (selected @ reference)
        # Whitened by a hypothesis, the residual is B a + b for its parts a along the selected directions.
        right = least @ np.column_stack([selected.T, rest])
        whitened = np.array([scipy.linalg.lapack.dtrtrs(root, right, lower=1)[0] for root in roots])
        square = np.swapaxes(whitened, 1, 2) @ whitened
        return LinearisedLikelihood(
            residual=table.through(selected @ reference, at_nodes @ selected.T),
            square=square[:, :-1, :-1],
            slope=square[:, :-1, -1],
            constant=hypotheses.log_weight - log_root(roots) - 0.5 * square[:, -1, -1],
        )

    def layer(self, inclusion: Floats, nuisance: Floats) -> SuperficialLayer:
        """What the rings tell of a superficial layer at an inclusion (3,)."""
        model = self.model.heterogeneity
        if model is None:
            return SuperficialLayer.none()
        residual, rotated = self._linear(inclusion[None], nuisance)
        hypotheses = self._hypotheses(inclusion, nuisance)
        evidence = _evidence(hypotheses, residual, rotated, self._sd)[0][:, 0]
        layered = np.exp(evidence - np.logaddexp.reduce(evidence)) * (model.layer_sd > LAYER_SDS[0])
        _, layers = self.model.tissue_columns(inclusion, nuisance)
        layers, probable = layers[self._use], np.flatnonzero(layered > IMPROBABLE_HYPOTHESIS * layered.max())
        if not len(probable):
            return SuperficialLayer.none()
        means, squares = [], []
        for index in probable:
            covariance = hypotheses.covariance[index] + rotated[0] @ rotated[0].T
            gain = model.layer_sd[index] ** 2 * np.linalg.solve(covariance, layers).T
            root = np.linalg.cholesky(model.layer_sd[index] ** 2 * (np.eye(model.layer_count) - gain @ layers))
            means.append(model.layer_log_factor(gain @ residual[0]))
            squares.append((model.layer_log_factor(root) ** 2).sum(axis=1) + means[-1] ** 2)
        share = layered[probable] / layered[probable].sum()
        mean = share @ np.array(means)
        sd = np.sqrt(np.maximum(share @ np.array(squares) - mean**2, 0.0))
        return SuperficialLayer(probability=float(layered.sum()), log_factor=mean, log_factor_sd=sd)

    def sources(self, inclusion: Floats, nuisance: Floats, *, model_error: float) -> ErrorSources:
        """Sensitivities to an inclusion (3,), and the covariance of each source of error, linearised there.

        ``model_error`` is the relative error of the surrogate that the variance of the profiles contains. The
        covariance by uneven tissue is the mean over the hypotheses, by their probability at this inclusion.
        """
        residual, rotated = self._linear(inclusion[None], nuisance)
        hypotheses = self._hypotheses(inclusion, nuisance)
        evidence = _evidence(hypotheses, residual, rotated, self._sd)[0][:, 0]
        weight = np.exp(evidence - np.logaddexp.reduce(evidence))
        uneven = np.tensordot(weight, hypotheses.covariance, axes=1) - self._noise
        model, calibration = self.model.heterogeneity, self.model.calibration
        frames, rings = self._data.grey.shape
        correlation = np.eye(rings) if self.model.correlation is None else self.model.correlation
        relative = self._data.grey.ravel()[:, None] * self._data.grey.ravel()
        modelled = (model_error * self._data.grey.ravel()) ** 2
        every = {
            "pattern": calibration.pattern_sd**2 * relative * np.kron(np.ones((frames, frames)), correlation),
            "repeatability": calibration.repeatability_sd**2 * relative * np.kron(np.eye(frames), correlation),
            "pixels": np.diag(self._data.variance.ravel() - modelled),
            "model": np.diag(modelled),
        }
        if self._data.position is not None:
            every["position"] = self._data.position
        used = np.ix_(self._use, self._use)
        return ErrorSources(
            by_inclusion=self._by_inclusion(inclusion, nuisance).T,
            by_nuisance=rotated[0],
            nuisance_sd=self._sd,
            covariance={name: covariance[used] for name, covariance in every.items()} | {"heterogeneity": uneven},
            tissue_sd=0.0 if model is None else float(np.sqrt(weight @ model.sd**2)),
            frames=len(self.model.force_n),
        )

    def _by_inclusion(self, inclusion: Floats, nuisance: Floats) -> Floats:
        """Derivatives of the used rings with respect to diameter, depth and modulus, shape (3, used rings)."""
        steps = np.diag(DERIVATIVE_STEP * inclusion)
        ends = self.model.grey(np.concatenate([inclusion + steps, inclusion - steps]), nuisance)
        return np.asarray(self._used(ends[:3] - ends[3:]) / (2 * np.diag(steps))[:, None])

    def with_information(self, inclusion: Floats, nuisance: Floats) -> tuple[LikelihoodFit, Floats]:
        """The fit of an inclusion (3,) and its Fisher information (3, 3), with the nuisances integrated out.

        The information is that under the most probable hypothesis on the tissue.
        """
        residual, rotated = self._linear(inclusion[None], nuisance)
        change = self._by_inclusion(inclusion, nuisance)
        hypotheses = self._hypotheses(inclusion, nuisance)
        fit = _mixed(hypotheses, residual, rotated, self._sd)
        root = scipy.linalg.cholesky(hypotheses.covariance[fit.hypothesis[0]] + rotated[0] @ rotated[0].T, lower=True)
        triangular = scipy.linalg.solve_triangular(root, change.T, lower=True)
        return fit, triangular.T @ triangular

    def within(self, nuisance: Floats) -> Floats:
        """Nuisances clipped to `LIMIT_SD` and the surrogate's box, and 0 where the model is linear."""
        low, high = self.model.bounds()
        limit = LIMIT_SD * self._sd
        return np.clip(nuisance, np.maximum(low, -limit), np.minimum(high, limit))

    def distance(self, one: Floats, other: Floats) -> float:
        """Largest difference of two sets of nuisances, in standard deviations of each."""
        return float(np.abs(self._units(one - other)).max())

    def _linear(self, inclusions: Floats | None, nuisance: Floats) -> tuple[Floats, Floats]:
        """Residuals at nuisances of 0, shape (n, m), and their decrease by one sd of each, (n, m, nuisances)."""
        grey, slopes = self._profiles(inclusions, nuisance)
        rotated = self._used(slopes) * self._sd
        return self._used(self._data.grey - grey) + rotated @ self._units(nuisance), rotated

    def _profiles(self, inclusions: Floats | None, nuisance: Floats) -> tuple[Floats, Floats]:
        """`ForwardModel.profiles`; the latest of a single inclusion are used again."""
        if inclusions is None or len(inclusions) > 1:
            return self.model.profiles(inclusions, nuisance)
        key = inclusions.tobytes() + nuisance.tobytes()
        if self._profiled is None or self._profiled[0] != key:
            self._profiled = key, self.model.profiles(inclusions, nuisance)
        return self._profiled[1]

    def _hypotheses(self, about: Floats | None, nuisance: Floats) -> NoiseHypotheses:
        """Noise of the used rings under each hypothesis; the latest is used again."""
        model = self.model.heterogeneity
        key = b"" if model is None else nuisance.tobytes() + (b"" if about is None else about.tobytes())
        if self._latest is None or self._latest[0] != key:
            if model is None:
                covariance, log_weight = self._noise[None], np.zeros(1)
            else:
                columns, layers = self.model.tissue_columns(about, nuisance)
                columns, layers = columns[:, self._use], layers[self._use]
                fields = columns @ np.swapaxes(columns, 1, 2)
                covariance = self._noise + model.sd[:, None, None] ** 2 * fields[model.length]
                covariance += model.layer_sd[:, None, None] ** 2 * (layers @ layers.T)
                log_weight = model.log_weight
            self._latest = key, NoiseHypotheses.of(covariance, log_weight)
        return self._latest[1]

    def _units(self, nuisance: Floats) -> Floats:
        """Nuisances in units of their standard deviations, which may be 0."""
        return np.divide(nuisance, self._sd, out=np.zeros_like(self._sd), where=self._sd > 0)

    def _used(self, columns: Floats) -> Floats:
        """The used rings of (n, frames, rings, ...); shape (n, used rings, ...)."""
        return columns.reshape(len(columns), -1, *columns.shape[3:])[:, self._use]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ErrorSources:
    """Linear model of the used rings about an inclusion.

    Attributes
    ----------
    by_inclusion
        Derivatives with respect to diameter, depth and modulus, shape (rings, 3).
    by_nuisance
        Change by one standard deviation of each nuisance, shape (rings, nuisances).
    nuisance_sd
        Those standard deviations, shape (nuisances,).
    covariance
        Covariance (rings, rings) by each other source: ``"pattern"``, ``"repeatability"``, ``"pixels"``, ``"model"``,
        ``"heterogeneity"`` and, beside the axis, ``"position"``.
    tissue_sd
        Root mean square standard deviation of the logarithm of the tissue's modulus over the hypotheses.
    frames
        Number of frames.
    """

    by_inclusion: Floats
    by_nuisance: Floats
    nuisance_sd: Floats
    covariance: Mapping[str, Floats]
    tissue_sd: float
    frames: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearisedLikelihood:
    """A fast likelihood with the derivatives by the nuisances at one inclusion, where it is exact."""

    residual: TissueSurrogate  # the residual in the k directions that depend on the inclusion
    # The log evidence under each hypothesis is ``constant - slope a - a square a / 2`` for the residual a
    square: Floats  # shape (hypotheses, k, k)
    slope: Floats  # shape (hypotheses, k)
    constant: Floats  # shape (hypotheses,)

    def __call__(self, inclusions: Floats) -> Floats:
        """Log evidence of inclusions (n, 3)."""
        residual = self.residual(*inclusions.T).T
        first, second = np.triu_indices(len(residual))
        # Each hypothesis' evidence is a parabola: one product with all monomials serves every hypothesis.
        twice = np.where(first == second, -0.5, -1.0)
        factors = np.hstack([self.square[:, first, second] * twice, -self.slope])
        result = np.empty(residual.shape[1])
        for start in range(0, len(result), CHUNK):  # one that stays in the processor's cache
            part = residual[:, start : start + CHUNK]
            evidence = factors @ np.vstack([part[first] * part[second], part]) + self.constant[:, None]
            most = evidence.max(axis=0)
            result[start : start + CHUNK] = most + np.log(np.exp(evidence - most).sum(axis=0))
        return result


def _mixed(hypotheses: NoiseHypotheses, residual: Floats, rotated: Floats, sd: Floats) -> LikelihoodFit:
    """Integrate the nuisances out of residuals (n, m), linear in them by ``rotated`` (n, m, nuisances)."""
    evidence, nuisance, misfit = _evidence(hypotheses, residual, rotated, sd)
    best = evidence.argmax(axis=0)
    index = np.arange(len(residual))
    return LikelihoodFit(
        log_evidence=np.asarray(np.logaddexp.reduce(evidence, axis=0)),
        nuisance=nuisance[best, index],
        misfit=misfit[best, index],
        hypothesis=best,
    )


def _evidence(
    hypotheses: NoiseHypotheses, residual: Floats, rotated: Floats, sd: Floats
) -> tuple[Floats, Floats, Floats]:
    """The three results of `_fit` under each hypothesis, shape (hypotheses, n, ...); arguments as `_mixed`.

    The log evidence contains the hypotheses' weights.
    """
    if len(residual) == 1:  # all hypotheses at once
        white = hypotheses.whitening @ np.hstack([residual.T, rotated[0]])
        evidence, nuisance, misfit = (part[:, None] for part in _fit(white[..., 0], white[..., 1:], sd))
    else:
        each = [_fit(residual @ whitening.T, whitening @ rotated, sd) for whitening in hypotheses.whitening]
        evidence, nuisance, misfit = (np.array(part) for part in zip(*each, strict=True))
    weight = hypotheses.log_weight - hypotheses.log_root
    return evidence + weight[:, None], nuisance, misfit


def _fit(white: Floats, rotated: Floats, sd: Floats) -> tuple[Floats, Floats, Floats]:
    """Log evidence, best nuisances and misfit of whitened residuals (n, m), with the nuisances integrated out."""
    normal = np.swapaxes(rotated, 1, 2) @ rotated + np.eye(len(sd))
    right = np.swapaxes(rotated, 1, 2) @ white[:, :, None]
    best = np.asarray(np.linalg.solve(normal, right)[:, :, 0], dtype=float)
    square = (white**2).sum(axis=1) - (right[:, :, 0] * best).sum(axis=1)
    _, log_determinant = np.linalg.slogdet(normal)
    return -0.5 * (square + log_determinant), best * sd, square


def noise_covariance(data: Profiles, calibration: Calibration, correlation: Floats) -> Floats:
    """Covariance of the ring means, shape (frames * rings, frames * rings).

    The fixed pattern is common to all frames; repeatability is independent between presses. ``correlation``,
    (rings, rings), is that of both between rings. Pixel noise and surrogate error are independent between rings. The
    error by the inclusion's position is added where the profiles have one.
    """
    frames, rings = data.grey.shape
    between = np.full((frames, frames), calibration.pattern_sd**2) + calibration.repeatability_sd**2 * np.eye(frames)
    covariance = data.grey.ravel()[:, None] * data.grey.ravel() * np.kron(between, correlation)
    covariance[np.diag_indices(frames * rings)] += data.variance.ravel()
    return np.asarray(covariance if data.position is None else covariance + data.position)

"""Likelihood of contacts on a gel sensor for an object's modulus, with gel, radius and reading errors as nuisances."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.hardness._layer_model import SOFTNESS
from tsis.hardness._touch_terms import limit_nodes, measured_terms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.hardness._touch_terms import MeasuredTerm, TouchedBody
    from tsis.model.gel_sensor import BoundedValue

    Floats = NDArray[np.float64]

GEL_MODULI, RATIOS, THICKNESSES = 15, 5, 3  # nodes over intervals that leave room


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchErrors:
    """Errors beyond those of the readings, relative standard deviations of contact radius and depth.

    ``press`` is that from press to press, ``scale`` common to all readings of the sensor.
    """

    press: float
    scale: float
    same_press: bool = False  # all readings are of one press


class TouchLikelihood:
    """Normal errors of the logarithms of forces and dents at the measured contact radii.

    Gel modulus, thickness and Poisson's ratio lie anywhere within their limits; they, the radius of the object and its
    Poisson's ratio are integrated out on nodes. The objects may be joined by rigid bodies, which tell the gel.
    """

    def __init__(
        self,
        bodies: Sequence[TouchedBody],
        *,
        young_kpa: BoundedValue,
        thickness_mm: BoundedValue,
        poisson: BoundedValue,
        object_poisson: tuple[float, float],
        errors: TouchErrors,
    ) -> None:
        self._bodies, self._errors = tuple(bodies), errors
        self._gel_kpa = limit_nodes(young_kpa.limits, GEL_MODULI, logarithmic=True)
        self._layers = list(product(limit_nodes(thickness_mm.limits, THICKNESSES), limit_nodes(poisson.limits, RATIOS)))
        self._ratios = limit_nodes(object_poisson, 3)
        radii = [
            np.exp(body.radius.nodes()[1] - scipy.special.logsumexp(body.radius.nodes()[1])) for body in self._bodies
        ]
        self._radius_nodes = [
            list(zip(body.radius.nodes()[0], weight, strict=True))
            for body, weight in zip(self._bodies, radii, strict=True)
        ]
        self.residual_count = sum(
            (reading.force_n is not None) + (reading.radius_mm is not None and reading.depth_mm is not None)
            for body in self._bodies
            for reading in body.readings
        )

    def __call__(self, object_kpa: Floats) -> tuple[Floats, float]:
        """Log likelihood of moduli of the object, shape (n,), and the least squared misfit."""
        parts, misfits = [], []
        for (thickness, thickness_weight), (poisson, poisson_weight) in self._layers:
            part, misfit = self._over_gel(object_kpa, thickness, poisson)
            parts.append(part + np.log(thickness_weight * poisson_weight))
            misfits.append(misfit)
        return np.asarray(scipy.special.logsumexp(parts, axis=0)), float(min(misfits))

    def _over_gel(self, object_kpa: Floats, thickness: float, poisson: float) -> tuple[Floats, float]:
        gel = np.array([(1 - poisson**2) / young for young, _ in self._gel_kpa])
        gel_weight = np.log([weight for _, weight in self._gel_kpa])
        total, least = np.zeros((len(object_kpa), len(gel))), 0.0
        for body, nodes in zip(self._bodies, self._radius_nodes, strict=True):
            log_body, misfit = self._of_body(body, nodes, object_kpa, gel, thickness, poisson)
            total, least = total + log_body, least + misfit
        return np.asarray(scipy.special.logsumexp(total + gel_weight, axis=1)), least

    def _of_body(
        self,
        body: TouchedBody,
        nodes: Sequence[tuple[float, float]],
        object_kpa: Floats,
        gel: Floats,
        thickness: float,
        poisson: float,
    ) -> tuple[Floats, float]:
        """Log likelihood of one body's readings, shape (moduli, gels), over its radius and Poisson's ratio."""
        parts, least = [], np.inf
        for radius, radius_weight in nodes:
            terms = list(measured_terms(body, radius, thickness, poisson))
            for ratio, ratio_weight in self._ratios:
                own = np.zeros_like(object_kpa) if body.rigid else (1 - ratio**2) / object_kpa
                softness = own[:, None] / (own[:, None] + gel)
                log_compliance = np.log(own[:, None] + gel)
                value, misfit = self._gaussian(body, terms, softness, log_compliance)
                parts.append(value + np.log(radius_weight * ratio_weight))
                least = min(least, misfit)
        return np.asarray(scipy.special.logsumexp(parts, axis=0)), least

    def _gaussian(
        self, body: TouchedBody, terms: Sequence[MeasuredTerm], softness: Floats, log_compliance: Floats
    ) -> tuple[Floats, float]:
        """Log likelihood by normal errors, and the least misfit; the covariance is that at the best softness."""
        if not terms:
            return np.zeros_like(softness), 0.0
        flat = softness.ravel()
        residuals = np.stack(
            [
                term.observed
                - np.interp(flat, SOFTNESS, term.curve)
                + (log_compliance.ravel() if term.is_force else 0.0)
                for term in terms
            ]
        )
        spread = np.array([np.hypot(term.sd, 3.0 * np.hypot(term.reading_sd, self._errors.press)) for term in terms])
        best = flat[int(np.argmin(((residuals / spread[:, None]) ** 2).sum(axis=0)))]
        factor = np.linalg.cholesky(self._covariance(terms, float(best)))
        white = np.linalg.solve(factor, residuals)
        misfit = (white**2).sum(axis=0)
        value = -misfit / 2 - np.log(np.diagonal(factor)).sum()
        return value.reshape(softness.shape), float(misfit.min())

    def _covariance(self, terms: Sequence[MeasuredTerm], softness: float) -> Floats:
        slopes = np.array([np.interp(softness, SOFTNESS, term.slope) for term in terms])
        press = np.array([term.press for term in terms])
        same = press[:, None] == press
        readings = np.outer(*2 * ([term.reading_sd for term in terms],)) * same
        of_press = self._errors.press**2 * (np.ones_like(same, dtype=float) if self._errors.same_press else same)
        common = np.outer(slopes, slopes) * (readings + of_press + self._errors.scale**2)
        return np.asarray(common + np.diag([term.sd**2 for term in terms]))

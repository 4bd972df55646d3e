"""Likelihood of contacts on a gel sensor for an object's modulus, with gel, radius and reading errors as nuisances."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from tsis.hardness._layer_model import (
    CYLINDER_MODEL_SD,
    DENT_MODEL_SD,
    FORCE_MODEL_SD,
    SOFTNESS,
    curves_at_depth,
    curves_at_radius,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Literal

    from numpy.typing import NDArray

    from tsis.hardness._contact_readings import TouchReading
    from tsis.hardness._exploration import RadiusPrior
    from tsis.model import BoundedValue

    Floats = NDArray[np.float64]

GEL_MODULI, RATIOS, THICKNESSES = 15, 5, 3  # nodes over intervals that leave room
RIGID = 0.0  # softness of a rigid reference


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TouchedBody:
    """Readings on one body."""

    readings: tuple[TouchReading, ...]
    shape: Literal["sphere", "cylinder"]
    radius: RadiusPrior
    length_mm: float = 1.0  # of a cylinder, over which its force acts
    rigid: bool = False


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
        self._gel_kpa = _nodes(young_kpa.limits, GEL_MODULI, logarithmic=True)
        self._layers = list(product(_nodes(thickness_mm.limits, THICKNESSES), _nodes(poisson.limits, RATIOS)))
        self._ratios = _nodes(object_poisson, 3)
        radii = [np.exp(body.radius.nodes()[1] - logsumexp(body.radius.nodes()[1])) for body in self._bodies]
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
        return np.asarray(logsumexp(parts, axis=0)), float(min(misfits))

    def _over_gel(self, object_kpa: Floats, thickness: float, poisson: float) -> tuple[Floats, float]:
        gel = np.array([(1 - poisson**2) / young for young, _ in self._gel_kpa])
        gel_weight = np.log([weight for _, weight in self._gel_kpa])
        total, least = np.zeros((len(object_kpa), len(gel))), 0.0
        for body, nodes in zip(self._bodies, self._radius_nodes, strict=True):
            log_body, misfit = self._of_body(body, nodes, object_kpa, gel, thickness, poisson)
            total, least = total + log_body, least + misfit
        return np.asarray(logsumexp(total + gel_weight, axis=1)), least

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
            terms = list(self._terms(body, radius, thickness, poisson))
            for ratio, ratio_weight in self._ratios:
                own = np.zeros_like(object_kpa) if body.rigid else (1 - ratio**2) / object_kpa
                softness = own[:, None] / (own[:, None] + gel)
                log_compliance = np.log(own[:, None] + gel)
                value, misfit = self._gaussian(body, terms, softness, log_compliance)
                parts.append(value + np.log(radius_weight * ratio_weight))
                least = min(least, misfit)
        return np.asarray(logsumexp(parts, axis=0)), least

    def _terms(self, body: TouchedBody, radius: float, thickness: float, poisson: float) -> Iterator[_Term]:
        length = np.log(body.length_mm) if body.shape == "cylinder" else 0.0
        for index, reading in enumerate(body.readings):
            x = (reading.radius_mm or 0.0) / radius
            model = CYLINDER_MODEL_SD * x**2 if body.shape == "cylinder" else 0.0
            if reading.radius_mm is not None:
                curves = curves_at_radius(reading.radius_mm, body.shape, radius, thickness, poisson)
                assert reading.radius_sd_mm is not None
                own_radius = reading.radius_sd_mm / reading.radius_mm
                if reading.force_n is not None and reading.force_sd_n is not None:
                    yield _Term(
                        press=index,
                        observed=float(np.log(reading.force_n)) - length,
                        curve=curves.log_force,
                        slope=curves.force_slope,
                        sd=float(np.hypot(reading.force_sd_n / reading.force_n, np.hypot(FORCE_MODEL_SD, model))),
                        reading_sd=own_radius,
                        is_force=True,
                    )
                if reading.depth_mm is not None and reading.depth_sd_mm is not None:
                    yield _Term(
                        press=index,
                        observed=float(np.log(reading.depth_mm)),
                        curve=curves.log_dent,
                        slope=curves.dent_slope,
                        sd=float(np.hypot(reading.depth_sd_mm / reading.depth_mm, np.hypot(DENT_MODEL_SD, model))),
                        reading_sd=own_radius,
                        is_force=False,
                    )
            elif reading.force_n is not None and reading.depth_mm is not None:
                assert reading.depth_sd_mm is not None
                assert reading.force_sd_n is not None
                log_force, slope = curves_at_depth(reading.depth_mm, body.shape, radius, thickness, poisson)
                yield _Term(
                    press=index,
                    observed=float(np.log(reading.force_n)) - length,
                    curve=log_force,
                    slope=slope,
                    sd=float(np.hypot(reading.force_sd_n / reading.force_n, FORCE_MODEL_SD)),
                    reading_sd=float(np.hypot(reading.depth_sd_mm / reading.depth_mm, DENT_MODEL_SD)),
                    is_force=True,
                )

    def _gaussian(
        self, body: TouchedBody, terms: Sequence[_Term], softness: Floats, log_compliance: Floats
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

    def _covariance(self, terms: Sequence[_Term], softness: float) -> Floats:
        slopes = np.array([np.interp(softness, SOFTNESS, term.slope) for term in terms])
        press = np.array([term.press for term in terms])
        same = press[:, None] == press
        readings = np.outer(*2 * ([term.reading_sd for term in terms],)) * same
        of_press = self._errors.press**2 * (np.ones_like(same, dtype=float) if self._errors.same_press else same)
        common = np.outer(slopes, slopes) * (readings + of_press + self._errors.scale**2)
        return np.asarray(common + np.diag([term.sd**2 for term in terms]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Term:
    """One measured logarithm, and its model over `SOFTNESS`."""

    press: int
    observed: float
    curve: Floats
    slope: Floats  # with the logarithm of the contact radius or dent that was read
    sd: float
    reading_sd: float
    is_force: bool


def _nodes(limits: tuple[float, float], count: int, *, logarithmic: bool = False) -> list[tuple[float, float]]:
    """Values between limits and their weights, which add up to one."""
    low, high = (np.log(limits) if logarithmic else np.asarray(limits)).tolist()
    if low == high:
        return [(limits[0], 1.0)]
    place, weight = np.polynomial.legendre.leggauss(count)
    values = low + (high - low) * (place + 1) / 2
    return list(zip((np.exp(values) if logarithmic else values).tolist(), (weight / 2).tolist(), strict=True))

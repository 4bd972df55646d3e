"""Tissue whose modulus differs from place to place: what it adds to the covariance of the rings.

The logarithm of the modulus is a Gaussian field (`tsis.mechanics.tissue_field`), the same for all forces at one site,
independent between target and reference site, and zero inside the inclusion. Its standard deviation and its correlation
length are unknown: each pair of values is a hypothesis, and the likelihood is their mixture. A superficial layer is a
change of the log modulus down to a depth that all sites have in common; its standard deviation is a third value of a
hypothesis, and without one it is 0.
"""

from __future__ import annotations

import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.files.cache import cached_arrays, content_key
from tsis.inclusion.posterior.rings import ring_means
from tsis.mechanics.mesh import mechanical_content
from tsis.mechanics.tissue_field import FieldMesh, TissueFieldResponse, field_factors, field_features

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.inclusion.prior import Floats, InclusionPrior, Integers
    from tsis.model.probe import Probe


FORMAT_VERSION = 3
LENGTHS_MM = (2.0, 3.2, 5.0, 8.0, 13.0)
SDS = (0.0, 0.01, 0.02, 0.04, 0.07, 0.1, 0.15, 0.2, 0.3, 0.45)
DIAMETERS, DEPTHS = 5, 4  # states with an inclusion, evenly spaced in the logarithm
HARMONICS = (1, 2, 3, 4)  # that the checks of the frames use
RANK = 16
RADII = 41  # of the profiles
PARTS = 4  # pressure and displacement of the unit press, then of the dome's shape
LAYERS_MM = (0.5, 0.72, 1.02, 1.47, 2.1, 3.0)  # thickness of a superficial layer, each equally probable
LAYER_SDS = (0.05, 0.25, 1.0)  # of the logarithm of its modulus over the tissue's; the least is hardly a layer
LAYER_WEIGHTS = (0.6, 0.25, 0.15)  # probability of each
LAYER_EDGE_MM = 0.2  # depth over which its modulus changes, so that no integration point jumps
IMPROBABLE_HYPOTHESIS = 1e-2  # of the most probable; such hypotheses are left out


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldTable:
    """Factors of the covariance of a press's profiles by a field of unit variance, for one probe and prior.

    The outputs are the pressures of the unit press over ``radius_mm``, its displacements, and both of the press by a
    dome's shape.

    Attributes
    ----------
    radius_mm
        Radii of the profiles, shape (n,).
    diameter_mm, depth_mm
        Inclusions of the table.
    around
        Factors around inclusions, shape (diameters, depths, lengths, 4 n, rank).
    blank
        Factors without inclusion, shape (lengths, 4 n, rank).
    harmonics
        The same of `HARMONICS` around the axis, shape (harmonics, lengths, 4 n, rank).
    layers_around, layers_blank
        Response to layers of `LAYERS_MM`, by a unit of the log modulus: around inclusions, shape (diameters, depths,
        4 n, layers), and without one, shape (4 n, layers).
    """

    radius_mm: Floats
    diameter_mm: Floats
    depth_mm: Floats
    around: Floats
    blank: Floats
    harmonics: Floats
    layers_around: Floats
    layers_blank: Floats

    def factor(self, inclusion: Floats | None) -> Floats:
        """Factors (lengths, 4 n, k) around an inclusion (3,), whose modulus does not matter, or without one.

        The covariance is bilinear between the inclusions of the table, in the logarithms of diameter and depth.
        """
        if inclusion is None:
            return self.blank
        return np.concatenate([np.sqrt(weight) * self.around[at] for at, weight in self._corners(inclusion)], axis=-1)

    def layers(self, inclusion: Floats | None) -> Floats:
        """Responses (4 n, layers) to layers, around an inclusion (3,) or without one; bilinear as `factor`."""
        if inclusion is None:
            return self.layers_blank
        return np.asarray(sum(weight * self.layers_around[at] for at, weight in self._corners(inclusion)))

    def _corners(self, inclusion: Floats) -> list[tuple[tuple[int, int], float]]:
        """Inclusions of the table around one, and their weights."""
        low_d, part_d = _between(np.log(self.diameter_mm), float(np.log(inclusion[0])))
        low_h, part_h = _between(np.log(self.depth_mm), float(np.log(inclusion[1])))
        return [
            ((low_d + d, low_h + h), weight_d * weight_h)
            for d, weight_d in enumerate((1 - part_d, part_d))
            for h, weight_h in enumerate((1 - part_h, part_h))
        ]


def _between(grid: Floats, value: float) -> tuple[int, float]:
    """Index of the grid's cell and the position in it, from 0 to 1; values beyond the grid are moved to its end."""
    cell = int(np.clip(np.searchsorted(grid, value) - 1, 0, len(grid) - 2))
    return cell, float(np.clip((value - grid[cell]) / (grid[cell + 1] - grid[cell]), 0.0, 1.0))


def build_field_table(
    probe: Probe, prior: InclusionPrior, *, progress: Callable[[int, int], None] | None = None, cached: bool = True
) -> FieldTable:
    """Build the table of a probe on the prior's tissue, or load it from the disk cache; seconds.

    ``progress`` is called with (states solved, all states).
    """
    diameter, depth = (
        np.geomspace(*ends, count) for ends, count in ((prior.diameter_mm, DIAMETERS), (prior.depth_mm, DEPTHS))
    )
    young = float(np.sqrt(np.prod(prior.young_kpa)))
    content = {
        "version": FORMAT_VERSION,
        "probe": mechanical_content(probe),
        "tissue": [prior.tissue_young_kpa, prior.thickness_mm, prior.poisson],
        "inclusions": [diameter.tolist(), depth.tolist(), young],
        "fields": [list(LENGTHS_MM), list(HARMONICS), RANK, RADII],
        "layers": [list(LAYERS_MM), LAYER_EDGE_MM],
    }

    def slab(inclusion: tuple[float, float, float] | None) -> TissueFieldResponse:
        return TissueFieldResponse(
            probe,
            young_kpa=prior.tissue_young_kpa,
            thickness_mm=prior.thickness_mm,
            poisson=prior.poisson,
            inclusion=inclusion,
            mesh=FieldMesh(points=RADII),
        )

    def solve() -> dict[str, Floats]:
        around = [(d, h, young) for d in diameter.tolist() for h in depth.tolist()]
        done, even = itertools.count(1), slab(None)
        with one_blas_thread(), ThreadPoolExecutor(os.cpu_count()) as pool:
            features = _features(even, 0)
            tasks = [pool.submit(lambda state: _round_factors(slab(state), features), state) for state in around]
            factors, layers = [], []
            for task in tasks:
                of_fields, of_layers = task.result()
                factors.append(of_fields)
                layers.append(of_layers)
                if progress is not None:
                    progress(next(done), len(around))
            harmonics = list(pool.map(lambda order: _factors(even, order, _features(even, order)), HARMONICS))
            blank, layers_blank = _round_factors(even, features)
            return {
                "around": np.array(factors),
                "blank": blank,
                "harmonics": np.array(harmonics),
                "layers_around": np.array(layers),
                "layers_blank": layers_blank,
            }

    arrays = cached_arrays("heterogeneity", content_key(content), solve) if cached else solve()
    blank = np.asarray(arrays["blank"], dtype=float)
    around = np.asarray(arrays["around"], dtype=float)
    return FieldTable(
        radius_mm=np.linspace(0.0, probe.radius_mm, blank.shape[1] // PARTS),
        diameter_mm=diameter,
        depth_mm=depth,
        around=around.reshape(len(diameter), len(depth), *blank.shape),
        blank=blank,
        harmonics=np.asarray(arrays["harmonics"], dtype=float),
        layers_around=np.asarray(arrays["layers_around"], dtype=float).reshape(
            len(diameter), len(depth), *arrays["layers_blank"].shape
        ),
        layers_blank=np.asarray(arrays["layers_blank"], dtype=float),
    )


def _features(slab: TissueFieldResponse, harmonic: int) -> list[tuple[Floats, Floats]]:
    """Features of the points of a mesh, which all inclusions share, for each length."""
    return [field_features(harmonic, length, *slab.points_mm(harmonic)) for length in LENGTHS_MM]


def _factors(slab: TissueFieldResponse, harmonic: int, features: list[tuple[Floats, Floats]]) -> Floats:
    """Factors of one state, shape (lengths, 4 n, rank), in single precision."""
    outputs, _ = _outputs(slab, harmonic)
    return np.asarray(field_factors(outputs, features, rank=RANK), dtype=np.float32)


def _round_factors(slab: TissueFieldResponse, features: list[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    """Factors of the mean around the axis, and responses (4 n, layers) to layers, in single precision."""
    outputs, depth = _outputs(slab, 0)
    layers = np.clip((np.array(LAYERS_MM) - depth[:, None]) / LAYER_EDGE_MM + 0.5, 0.0, 1.0)
    factors = field_factors(outputs, features, rank=RANK)
    return np.asarray(factors, dtype=np.float32), np.asarray(outputs @ layers, dtype=np.float32)


def _outputs(slab: TissueFieldResponse, harmonic: int) -> tuple[Floats, Floats]:
    """Response (4 n, points) to a unit of the field at each point, none in the inclusion, and the points' depths."""
    response = slab.response(harmonic)
    parts = zip(response.pressure_kpa, response.face_displacement_mm, strict=True)
    outputs = np.concatenate([part for pair in parts for part in pair])
    outputs[:, slab.inside(response.radius_mm, response.depth_mm)] = 0.0
    return outputs, response.depth_mm


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Heterogeneity:
    """Hypotheses on the tissue's heterogeneity, and its effect on the rings.

    Attributes
    ----------
    table
        Effect on the profiles.
    to_rings
        Matrix from the table's outputs to ring responses (`RingResponses`), shape (responses, 4 n).
    sd, length
        Standard deviation of the log modulus and index in `LENGTHS_MM` of each hypothesis, shape (hypotheses,).
    layer_sd
        Standard deviation of the log modulus of a superficial layer over the tissue's, shape (hypotheses,).
    log_weight
        Logarithm of the probability of each hypothesis before the ring means are seen.
    """

    table: FieldTable
    to_rings: Floats
    sd: Floats
    length: Integers
    layer_sd: Floats
    log_weight: Floats

    @property
    def layer_count(self) -> int:
        """Number of the layers, the last of the `responses`."""
        return len(LAYERS_MM)

    def layer_log_factor(self, factors: Floats) -> Floats:
        """Log modulus over the tissue's above each of `LAYERS_MM`, from the `responses`' standard normal factors."""
        return np.asarray(np.cumsum(factors[::-1], axis=0)[::-1] / np.sqrt(self.layer_count))

    def responses(self, inclusion: Floats | None) -> Floats:
        """Factors (lengths, k, responses) of the ring responses around an inclusion (3,), or without one.

        The last are the responses to layers, which do not depend on the length.
        """
        factor = self.table.factor(inclusion)
        layers = self.table.layers(inclusion) / np.sqrt(self.layer_count)
        every = np.concatenate([factor, np.broadcast_to(layers, (len(factor), *layers.shape))], axis=2)
        return np.swapaxes(self.to_rings @ every, 1, 2)

    def alone(self, sd: float, length_mm: float) -> Heterogeneity:
        """The one hypothesis of a standard deviation and the nearest length, with hardly a layer."""
        length = int(np.abs(np.log(np.array(LENGTHS_MM) / length_mm)).argmin())
        return replace(
            self,
            sd=np.array([sd]),
            length=np.array([length]),
            layer_sd=np.array([LAYER_SDS[0]]),
            log_weight=np.zeros(1),
        )

    def informed(self, log_evidence: Floats) -> Heterogeneity:
        """The hypotheses after other data of ``log_evidence`` (hypotheses,), without the improbable ones."""
        log_weight = self.log_weight + log_evidence
        after = replace(self, log_weight=log_weight).selected(log_weight)
        return replace(after, log_weight=after.log_weight - np.logaddexp.reduce(after.log_weight))

    def selected(self, log_weight: Floats, *, least: float = IMPROBABLE_HYPOTHESIS) -> Heterogeneity:
        """The hypotheses above ``least`` of the most probable by ``log_weight``, with their weights as before."""
        probable = log_weight > log_weight.max() + np.log(least)
        parts = {name: getattr(self, name)[probable] for name in ("sd", "length", "layer_sd", "log_weight")}
        return replace(self, **parts)


def heterogeneity(
    table: FieldTable, prior: InclusionPrior, edges_mm: Floats, level: Floats, *, is_domed: bool
) -> Heterogeneity:
    """Hypotheses of a prior: standard deviation uniform up to the prior's, length uniform in its logarithm.

    ``edges_mm`` and ``level`` are the boundaries and the light of the rings, as for `ring_responses`.
    """
    sds = np.array([sd for sd in SDS if sd < prior.heterogeneity_sd] + [prior.heterogeneity_sd])
    width = np.gradient(sds) if len(sds) > 1 else np.ones(1)
    width[0], width[-1] = (width[0] / 2, width[-1] / 2) if len(sds) > 1 else (1.0, 1.0)
    every = np.meshgrid(sds, np.arange(len(LENGTHS_MM)), LAYER_SDS, indexing="ij")
    sd, length, layer_sd = (part.ravel() for part in every)
    weight = np.repeat(width / width.sum(), len(LENGTHS_MM)) / len(LENGTHS_MM)
    return Heterogeneity(
        table=table,
        to_rings=_to_rings(table, edges_mm, level, is_domed=is_domed),
        sd=sd,
        length=length,
        layer_sd=layer_sd,
        log_weight=np.log(np.outer(weight, LAYER_WEIGHTS).ravel()),
    )


def _to_rings(table: FieldTable, edges_mm: Floats, level: Floats, *, is_domed: bool) -> Floats:
    """Matrix from the table's outputs to pressure, displacement and slope of the rings, for each part of a press."""
    means = ring_means(table.radius_mm, edges_mm, level)
    slopes = means @ np.gradient(np.eye(len(table.radius_mm)), table.radius_mm, axis=0)
    none = np.zeros_like(means)
    part = np.block([[means, none], [none, means], [none, slopes]])
    return np.kron(np.eye(2), part) if is_domed else np.hstack([part, np.zeros_like(part)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SuperficialLayer:
    """A superficial layer.

    Attributes
    ----------
    probability
        That of a layer which matters.
    log_factor, log_factor_sd
        Posterior mean and standard deviation of the log of the modulus over the tissue's above each of `LAYERS_MM`,
        shape (layers,).
    """

    probability: float
    log_factor: Floats
    log_factor_sd: Floats

    @classmethod
    def none(cls) -> SuperficialLayer:
        """Tissue without a layer."""
        zero = np.zeros(len(LAYERS_MM))
        return cls(probability=0.0, log_factor=zero, log_factor_sd=zero)

    @property
    def size_mm(self) -> float:
        """Integral of the absolute log factor over the depth, as far as it exceeds its standard deviation.

        0.34 for 1 mm of 1.4 times the tissue's modulus. Without the deviation even tissue would have a size.
        """
        shown = np.sqrt(np.maximum(self.log_factor**2 - self.log_factor_sd**2, 0.0))
        return float(shown @ np.diff(LAYERS_MM, prepend=0.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NoiseHypotheses:
    """Noise of the rings under each hypothesis on the tissue's heterogeneity."""

    covariance: Floats  # shape (hypotheses, rings, rings)
    whitening: Floats  # inverse of its lower root
    log_weight: Floats  # logarithm of each probability, shape (hypotheses,)
    log_root: Floats  # logarithm of the determinant of the root, shape (hypotheses,)

    @classmethod
    def of(cls, covariance: Floats, log_weight: Floats) -> NoiseHypotheses:
        """Factorise the covariances."""
        roots = np.linalg.cholesky(covariance)
        whitening = np.array([scipy.linalg.lapack.dtrtri(root, lower=1)[0] for root in roots])
        return cls(covariance=covariance, whitening=whitening, log_weight=log_weight, log_root=log_root(roots))


def log_root(roots: NDArray[np.floating[Any]]) -> Floats:
    """Logarithms of the determinants of triangular roots (n, m, m), shape (n,)."""
    return np.asarray(np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1))

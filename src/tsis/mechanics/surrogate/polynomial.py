"""The press as a polynomial: Chebyshev tensors in diameter, depth, contrast, tissue modulus and slab thickness.

The change by an inclusion is nearly proportional to ``g (d / c)**3`` with the saturation in its modulus
``g = (Ei - Et) / (Ei + 1.5 Et)`` and the depth of its centre ``c = h + d / 2``. The polynomial interpolates the change
divided by that, which is smooth enough for low degrees. Changes come from solves with and without contrast on one mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import chebyshev

from tsis.errors import InputError
from tsis.model.require import require_number

if TYPE_CHECKING:
    from tsis.mechanics.mesh import Floats


CHUNK = 512  # inclusions evaluated at a time; the intermediate array fits into the processor's cache


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """Ranges (low, high) over which a surrogate is valid.

    Attributes
    ----------
    diameter_mm, depth_mm, young_kpa
        The inclusion.
    tissue_young_kpa, thickness_mm
        The slab around it.
    poisson
        Poisson's ratio of tissue and inclusion, one value.
    """

    diameter_mm: tuple[float, float] = (1.0, 15.0)
    depth_mm: tuple[float, float] = (4.0, 12.0)
    young_kpa: tuple[float, float] = (40.0, 120.0)
    tissue_young_kpa: tuple[float, float] = (3.8, 6.6)
    thickness_mm: tuple[float, float] = (27.6, 36.0)
    poisson: float = 0.49

    def __post_init__(self) -> None:
        for name in ("diameter_mm", "depth_mm", "young_kpa", "tissue_young_kpa", "thickness_mm"):
            low, high = getattr(self, name)
            if not 0 < low < high < np.inf:
                raise InputError(f"{name} must be a range (low, high) with 0 < low < high; got {getattr(self, name)}")
        require_number("poisson", self.poisson, 0.0, 0.495)
        deepest = self.depth_mm[1] + self.diameter_mm[1]
        if deepest >= self.thickness_mm[0]:
            raise InputError(
                f"the largest depth_mm + diameter_mm must be less than the smallest thickness_mm "
                f"= {self.thickness_mm[0]:g}; got {deepest:g}"
            )

    @property
    def contrast_factor(self) -> tuple[float, float]:
        """Range of g over the box."""
        soft, stiff = self.tissue_young_kpa
        return (
            float(contrast_factor(self.young_kpa[0] / stiff)),
            float(contrast_factor(self.young_kpa[1] / soft)),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Degrees:
    """Chebyshev points along each axis.

    The defaults are accurate to 0.1 % of the peak signal on the default box. Tissue without inclusion must be exact
    even against small signals, so it has points of its own: ``baseline`` along tissue and thickness each.
    """

    diameter: int = 11
    depth: int = 7
    contrast: int = 3
    tissue: int = 3
    thickness: int = 3
    baseline: int = 6

    def __post_init__(self) -> None:
        for name in ("diameter", "depth", "contrast", "tissue", "thickness", "baseline"):
            require_number(name, getattr(self, name), 1, 100, hint="Chebyshev points")


def contrast_factor(contrast: Any) -> Any:
    """Saturation of the signal with the modulus: g(s) = (s - 1) / (s + 1.5) of s = Ei / Et."""
    return (contrast - 1) / (contrast + 1.5)


def contrast_from_factor(factor: Any) -> Any:
    """The contrast Ei / Et whose `contrast_factor` is ``factor``."""
    return (1 + 1.5 * factor) / (1 - factor)


def signal_scale(diameter_mm: Any, depth_mm: Any, factor: Any) -> Any:
    """Scale of the change by an inclusion: g (d / c)**3."""
    return factor * (diameter_mm / (depth_mm + diameter_mm / 2)) ** 3


def log_range(interval: tuple[float, float]) -> tuple[float, float]:
    """Logarithms of both ends; tissue modulus and thickness are interpolated in their logarithm."""
    low, high = interval
    return float(np.log(low)), float(np.log(high))


def chebyshev_points(interval: tuple[float, float], count: int) -> Floats:
    """The ``count`` Chebyshev points of the first kind on ``interval``, ascending."""
    low, high = interval
    unit = -np.cos(np.pi * (np.arange(count) + 0.5) / count)
    return np.asarray((low + high) / 2 + (high - low) / 2 * unit)


def chebyshev_weights(interval: tuple[float, float], count: int, x: Floats) -> Floats:
    """Matrix from values at `chebyshev_points` to the interpolating polynomial at ``x``, shape (len(x), count)."""
    low, high = interval
    unit = (2 * np.atleast_1d(x) - low - high) / (high - low)
    # NumPy's own recurrence spends more time on checks than on work for few points.
    terms = np.ones((count, unit.size))
    if count > 1:
        terms[1] = unit
    for n in range(2, count):
        terms[n] = 2 * unit * terms[n - 1] - terms[n - 2]
    return np.asarray(terms.T @ _coefficients(count))


@lru_cache(maxsize=1024)  # callers repeat few positions
def chebyshev_weights_at(interval: tuple[float, float], count: int, x: float) -> Floats:
    """`chebyshev_weights` at one position, shape (count,)."""
    row = np.array(chebyshev_weights(interval, count, np.array([x]))[0])
    row.flags.writeable = False
    return row


@cache
def _coefficients(count: int) -> Floats:
    """Matrix from values at the points to Chebyshev coefficients."""
    matrix = np.asarray(
        np.linalg.inv(chebyshev.chebvander(chebyshev_points((-1.0, 1.0), count), count - 1)), dtype=float
    )
    matrix.flags.writeable = False
    return matrix


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surrogate:
    """Outputs of presses as polynomials over a box.

    Attributes
    ----------
    box
        Range of validity.
    baseline
        Outputs without inclusion at Chebyshev points of their own, shape (tissue, thickness, outputs).
    change
        Change by the inclusion over `signal_scale` at the points, shape (diameter, depth, contrast, tissue, thickness,
        outputs).
    """

    box: Box
    baseline: Floats
    change: Floats

    def mapped(self, matrix: Floats) -> Surrogate:
        """Surrogate with linearly mapped outputs; ``matrix`` has shape (new, old)."""
        return replace(self, baseline=self.baseline @ matrix.T, change=self.change @ matrix.T)

    def joined(self, *others: Surrogate) -> Surrogate:
        """Surrogate with the outputs of this one, then those of ``others``, all over one box."""
        parts = (self, *others)
        return replace(
            self,
            baseline=np.concatenate([part.baseline for part in parts], axis=-1),
            change=np.concatenate([part.change for part in parts], axis=-1),
        )

    def at_tissue(self, tissue_young_kpa: float, thickness_mm: float) -> TissueSurrogate:
        """Fix the tissue; outside the box the polynomial is extrapolated, and its error grows fast."""
        positions, outputs = self.change.shape[:3], self.change.shape[-1]
        mix = self._mix(self.change.shape[3:5], tissue_young_kpa, thickness_mm)
        return TissueSurrogate(
            box=self.box,
            tissue_young_kpa=tissue_young_kpa,
            baseline=self.baseline_at(tissue_young_kpa, thickness_mm),
            change=(mix @ self.change.reshape(-1, mix.size, outputs)).reshape(*positions, outputs),
        )

    def baseline_at(self, tissue_young_kpa: float, thickness_mm: float) -> Floats:
        """Outputs without inclusion, shape (outputs,)."""
        mix = self._mix(self.baseline.shape[:2], tissue_young_kpa, thickness_mm)
        return np.asarray(mix @ self.baseline.reshape(mix.size, -1))

    def _mix(self, points: tuple[int, ...], tissue_young_kpa: float, thickness_mm: float) -> Floats:
        """Weights of the points along tissue and thickness, flat."""
        tissue = chebyshev_weights_at(log_range(self.box.tissue_young_kpa), points[0], float(np.log(tissue_young_kpa)))
        slab = chebyshev_weights_at(log_range(self.box.thickness_mm), points[1], float(np.log(thickness_mm)))
        return np.asarray((tissue[:, None] * slab).ravel())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TissueSurrogate:
    """A `Surrogate` at one tissue modulus and thickness: ``baseline`` (outputs,), ``change`` (d, h, g, outputs)."""

    box: Box
    tissue_young_kpa: float
    baseline: Floats
    change: Floats

    def nodes(self) -> Floats:
        """Inclusions (diameter, depth, modulus) at the points of ``change``, shape (d * h * g, 3)."""
        nd, nh, ng, _ = self.change.shape
        axes = (
            chebyshev_points(self.box.diameter_mm, nd),
            chebyshev_points(self.box.depth_mm, nh),
            contrast_from_factor(chebyshev_points(self.box.contrast_factor, ng)) * self.tissue_young_kpa,
        )
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def through(self, reference: Floats, values: Floats) -> TissueSurrogate:
        """Surrogate of another quantity: ``reference`` (k,) without inclusion and ``values`` (n, k) at `nodes`."""
        diameter, depth, young = self.nodes().T
        size = signal_scale(diameter, depth, contrast_factor(young / self.tissue_young_kpa))
        change = ((values - reference) / size[:, None]).reshape(*self.change.shape[:3], -1)
        return replace(self, baseline=reference, change=change)

    def __call__(self, diameter_mm: Floats, depth_mm: Floats, young_kpa: Floats) -> Floats:
        """Outputs for inclusions, three arrays of shape (n,); shape (n, outputs)."""
        box, (nd, nh, ng, outputs) = self.box, self.change.shape
        factor = contrast_factor(np.asarray(young_kpa) / self.tissue_young_kpa)
        in_d = chebyshev_weights(box.diameter_mm, nd, diameter_mm)
        in_h = chebyshev_weights(box.depth_mm, nh, depth_mm)
        in_g = chebyshev_weights(box.contrast_factor, ng, factor)
        # Diameter and depth in one matrix product, then the contrast: half the work of one product over all three.
        table = self.change.reshape(nd * nh, ng * outputs)
        change = np.empty((len(factor), outputs))
        for start in range(0, len(factor), CHUNK):
            part = slice(start, start + CHUNK)
            basis = (in_d[part, :, None] * in_h[part, None, :]).reshape(-1, nd * nh)
            at_points = (basis @ table).reshape(-1, ng, outputs)
            change[part] = (in_g[part, None, :] @ at_points)[:, 0]
        return np.asarray(self.baseline + signal_scale(diameter_mm, depth_mm, factor)[:, None] * change)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressSurrogate:
    """Surrogates of all outputs of a press at one force, over radii of one probe's face.

    Attributes
    ----------
    radius_mm
        Radii of the profiles, evenly spaced from the axis to the edge, shape (n,).
    force_n
        Force of the presses; the response of a flat face is proportional to it.
    pressure_kpa, face_displacement_mm, approach_mm
        Surrogates with n, n and 1 outputs.
    error
        Largest error of the pressure in fresh presses inside the box, as a fraction of its mean, over the inner 0.8 of
        the face's radius.
    key
        Hash of its content: probe, box, force, degrees and resolution.
    """

    radius_mm: Floats
    force_n: float
    pressure_kpa: Surrogate
    face_displacement_mm: Surrogate
    approach_mm: Surrogate
    error: float
    key: str

"""What finite strain adds to small-strain presses that cover the face, over a box of states of one probe.

The correction without inclusion is a Chebyshev tensor in tissue modulus, thickness and load. The correction of the
signal, over `signal_scale`, is a sum of a few profiles (singular vectors) whose coefficients are Gaussian processes of
six coordinates: diameter, depth, contrast, tissue modulus, thickness and load. The load is a force in units that
follow the tissue: the covering force of a dome, tissue modulus times radius squared for a flat face. A signal is the
difference of presses with and without contrast on one mesh. Finite-strain meshes have a rounded rim; the correction
contains its effect.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize

from tsis.errors import InputError
from tsis.mechanics._face import hats
from tsis.mechanics.surrogate._polynomial import Box, chebyshev_weights_at, contrast_factor, signal_scale

if TYPE_CHECKING:
    from tsis.mechanics._element import Floats
    from tsis.model import Probe


DOMED_LOADS, FLAT_LOADS = (1.0, 3.6), (0.1, 1.8)  # at the end the tissue starts to wrap around the rim


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionBox:
    """Ranges (low, high) of a `FiniteCorrection`; the sphere's bottom lies above 0.97 of the thickness.

    Attributes
    ----------
    diameter_mm, depth_mm, contrast
        The inclusion; contrast is its modulus over that of the tissue.
    tissue_young_kpa, thickness_mm
        The slab around it.
    load
        Force over the force that covers a dome's face without inclusion at small strain; for a flat face force over
        tissue modulus times radius squared.
    """

    diameter_mm: tuple[float, float] = (1.0, 15.0)
    depth_mm: tuple[float, float] = (4.0, 12.0)
    contrast: tuple[float, float] = (6.0, 34.0)
    tissue_young_kpa: tuple[float, float] = (3.4, 7.4)
    thickness_mm: tuple[float, float] = (26.5, 37.0)
    load: tuple[float, float] = DOMED_LOADS

    def __post_init__(self) -> None:
        for name, ends in asdict(self).items():
            if not 0 < ends[0] < ends[1] < np.inf:
                raise InputError(f"{name} must be a range (low, high) with 0 < low < high; got {ends}")

    @property
    def coordinates(self) -> Floats:
        """Ends of the six coordinates, shape (2, 6)."""
        ends = [
            np.log(self.diameter_mm),
            np.log(self.depth_mm),
            contrast_factor(np.array(self.contrast)),
            np.log(self.tissue_young_kpa),
            np.log(self.thickness_mm),
            self.load,
        ]
        return np.array(ends, dtype=float).T

    def holds(self, box: Box) -> bool:
        """Whether it covers the inclusions and slabs of another box."""
        soft, stiff = box.tissue_young_kpa
        pairs = (
            (self.diameter_mm, box.diameter_mm),
            (self.depth_mm, box.depth_mm),
            (self.tissue_young_kpa, box.tissue_young_kpa),
            (self.thickness_mm, box.thickness_mm),
            (self.contrast, (box.young_kpa[0] / stiff, box.young_kpa[1] / soft)),
        )
        return all(own[0] <= other[0] and other[1] <= own[1] for own, other in pairs)


def correction_box(probe: Probe, box: Box | None = None) -> CorrectionBox:
    """Ranges of a correction that covers another box, by default that of the catalog's prior with a margin."""
    load = FLAT_LOADS if probe.face_curvature_mm is None else DOMED_LOADS
    standard = CorrectionBox(load=load)
    if box is None or standard.holds(box):
        return standard
    soft, stiff = box.tissue_young_kpa
    return CorrectionBox(
        diameter_mm=box.diameter_mm,
        depth_mm=box.depth_mm,
        contrast=(max(0.95 * box.young_kpa[0] / stiff, 1.02), 1.05 * box.young_kpa[1] / soft),
        tissue_young_kpa=(0.9 * soft, 1.1 * stiff),
        thickness_mm=(0.97 * box.thickness_mm[0], 1.03 * box.thickness_mm[1]),
        load=load,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CorrectionProcess:
    """Gaussian processes of k coefficients with a linear mean, over unit coordinates.

    Attributes
    ----------
    points
        Coordinates of the data in [0, 1], shape (n, 6): three of the inclusion, three of slab and load.
    lengths
        Correlation lengths, shape (6,).
    slopes
        Mean: constant and slopes, shape (7, k).
    weights
        Weights of the data, shape (n, k).
    """

    points: Floats
    lengths: Floats
    slopes: Floats
    weights: Floats

    @classmethod
    def through(cls, points: Floats, values: Floats, lengths: Floats, nugget: float) -> CorrectionProcess:
        """Processes with given lengths and relative noise variance through ``values`` (n, k)."""
        factor = cho_factor(_kernel(points, points, lengths) + nugget * np.eye(len(points)), lower=True)
        basis = _linear(points)
        slopes = np.asarray(
            np.linalg.solve(basis.T @ cho_solve(factor, basis), basis.T @ cho_solve(factor, values)), dtype=float
        )
        weights = cho_solve(factor, values - basis @ slopes)
        return cls(points=points, lengths=lengths, slopes=slopes, weights=weights)

    def __call__(self, inclusions: Floats, states: Floats) -> Floats:
        """Coefficients of inclusions (n, 3) in states (m, 3), shape (m, n, k)."""
        near = _kernel(inclusions, self.points[:, :3], self.lengths[:3])
        by_state = _kernel(states, self.points[:, 3:], self.lengths[3:])
        count, modes = len(states), self.weights.shape[1]
        weights = (by_state.T[:, :, None] * self.weights[:, None]).reshape(len(self.points), -1)
        varied = (near @ weights).reshape(len(inclusions), count, modes).swapaxes(0, 1)
        mean = self.slopes[0] + (inclusions @ self.slopes[1:4])[None] + (states @ self.slopes[4:])[:, None]
        return np.asarray(varied + mean)


def _kernel(some: Floats, others: Floats, lengths: Floats) -> Floats:
    some, others = some / lengths, others / lengths
    square = (some**2).sum(axis=1)[:, None] + (others**2).sum(axis=1) - 2 * some @ others.T
    return np.asarray(np.exp(-0.5 * np.maximum(square, 0.0)))


def _linear(points: Floats) -> Floats:
    return np.column_stack([np.ones(len(points)), points])


def fit_lengths(points: Floats, values: Floats) -> tuple[Floats, float]:
    """Correlation lengths and noise variance of the largest likelihood, the same for all columns of ``values``."""
    basis = _linear(points)
    free = len(points) - basis.shape[1]

    def misfit(logs: Floats) -> float:
        kernel = _kernel(points, points, np.exp(logs[:-1])) + np.exp(logs[-1]) * np.eye(len(points))
        root = cholesky(kernel, lower=True, check_finite=False)
        white, data = solve_triangular(root, basis, lower=True), solve_triangular(root, values, lower=True)
        directions, upper = np.linalg.qr(white)
        rest = data - directions @ (directions.T @ data)
        volume = np.log(np.diag(root)).sum() + np.log(np.abs(np.diag(upper))).sum()
        return float(0.5 * free * np.log((rest**2).sum(axis=0) / free).mean() + volume + 0.1 * (logs[:-1] ** 2).sum())

    start = np.append(np.full(points.shape[1], 0.5), np.log(1e-4))
    bounds = [(-1.5, 3.5)] * points.shape[1] + [(np.log(1e-8), np.log(0.1))]
    best = minimize(misfit, start, method="L-BFGS-B", bounds=bounds, options={"maxiter": 40}).x
    return np.exp(best[:-1]), float(np.exp(best[-1]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FiniteCorrection:
    """Finite less small strain of the presses of one probe.

    Attributes
    ----------
    radius_mm
        Radii of the profiles, evenly spaced from the axis to the edge, shape (121,).
    box
        Range of validity; states outside are evaluated at its ends.
    unit_force_n
        Force of a unit load at Chebyshev points of the logarithms of tissue modulus and thickness.
    baseline
        Correction without inclusion at Chebyshev points, shape (tissue, thickness, load, outputs). The outputs are
        pressures in kPa, then displacements in mm.
    modes
        Profiles of the correction of the signal over its scale, shape (k, outputs).
    processes
        The coefficients of the modes, in their order: those of the leading modes, then those of the others, which vary
        faster.
    error
        Root mean square of the pressure's error over fresh presses and the inner 0.8 of the face, as a fraction of the
        mean pressure.
    signal_error
        Median and largest error of the pressure's ring means over fresh presses, as fractions of the signal's peak.
    is_domed
        Whether the face is domed, so that light presses do not cover it.
    key
        Hash of its content.
    """

    radius_mm: Floats
    box: CorrectionBox
    is_domed: bool
    unit_force_n: Floats
    baseline: Floats
    modes: Floats
    processes: tuple[CorrectionProcess, ...]
    error: float
    signal_error: tuple[float, float]
    key: str

    def interpolation(self, radius_mm: Floats) -> Floats:
        """Matrix from profiles to values at ``radius_mm``, linear between its radii; (len(radius_mm), n)."""
        return hats(self.radius_mm, radius_mm)

    def mapped(self, without_inclusion: Floats, change: Floats) -> FiniteCorrection:
        """Linearly mapped outputs: one matrix (new, old) for tissue without inclusion, one for the change."""
        return replace(self, baseline=self.baseline @ without_inclusion.T, modes=self.modes @ change.T)

    def forces_n(self, tissue_young_kpa: float, thickness_mm: float) -> tuple[float, float]:
        """Least and largest force in newtons on tissue of a modulus in kPa and a thickness in mm."""
        unit = self._unit(tissue_young_kpa, thickness_mm)
        return (self.box.load[0] if self.is_domed else 0.0) * unit, self.box.load[1] * unit

    def without_inclusion(self, states: Floats) -> Floats:
        """Correction without inclusion; ``states`` (m, 3): modulus in kPa, thickness in mm, force in N."""
        rows = []
        positions, share = self._states(states)
        for unit in positions:
            mix = self.baseline
            for position, count in zip(unit, self.baseline.shape[:3], strict=True):
                weights = chebyshev_weights_at((0.0, 1.0), count, float(position))
                mix = (weights @ mix.reshape(count, -1)).reshape(mix.shape[1:])
            rows.append(mix)
        return np.asarray(share[:, None] * np.array(rows))

    def change(self, diameter_mm: Floats, depth_mm: Floats, contrast: Floats, states: Floats) -> Floats:
        """Correction of the signal of n inclusions in m states (see `without_inclusion`), shape (m, n, outputs)."""
        factor = contrast_factor(contrast)
        low, high = self.box.coordinates
        ranges = np.column_stack([np.log(diameter_mm), np.log(depth_mm), factor])
        inclusions = np.clip((ranges - low[:3]) / (high - low)[:3], 0.0, 1.0)
        positions, share = self._states(states)
        coefficients = np.concatenate([process(inclusions, positions) for process in self.processes], axis=-1)
        coefficients *= share[:, None, None]
        return np.asarray(signal_scale(diameter_mm, depth_mm, factor)[:, None] * (coefficients @ self.modes))

    def _unit(self, tissue_young_kpa: float, thickness_mm: float) -> float:
        low, high = self.box.coordinates[:, 3:5]
        place = np.clip((np.log([tissue_young_kpa, thickness_mm]) - low) / (high - low), 0.0, 1.0)
        weights = [
            chebyshev_weights_at((0.0, 1.0), count, float(at))
            for at, count in zip(place, self.unit_force_n.shape, strict=True)
        ]
        # In proportion to the tissue outside the box.
        beyond = tissue_young_kpa / float(np.exp(low[0] + place[0] * (high - low)[0]))
        return float(np.exp(weights[0] @ self.unit_force_n @ weights[1])) * beyond

    def _states(self, states: Floats) -> tuple[Floats, Floats]:
        """States in unit coordinates, (m, 3), at the ends of the box where they lie outside, and a factor (m,).

        A flat face has no least force: below the box the correction falls in proportion to the force.
        """
        low, high = self.box.coordinates[:, 3:]
        load = np.array([force / self._unit(tissue, thickness) for tissue, thickness, force in states.tolist()])
        ranges = np.column_stack([np.log(states[:, 0]), np.log(states[:, 1]), load])
        share = np.ones(len(states)) if self.is_domed else np.minimum(load / low[2], 1.0)
        return np.asarray(np.clip((ranges - low) / (high - low), 0.0, 1.0)), share

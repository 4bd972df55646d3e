"""What finite strain adds to small-strain presses of one probe.

The correction without inclusion is a Chebyshev tensor in tissue modulus, thickness and load. The correction of the
signal is a multiple of the signal at small strain and a sum of a few profiles (singular vectors) over the signal's
norm. The multiple, the norm and the coefficients are Gaussian processes of six coordinates: diameter, depth, contrast,
tissue modulus, thickness and load. The load is a force in units that follow the tissue: the covering force of a dome,
tissue modulus times radius squared for a flat face. A signal is the difference of presses with and without contrast on
one mesh. Finite-strain meshes have a rounded rim; the correction contains its effect.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.mechanics.surrogate.polynomial import (
    Box,
    chebyshev_weights,
    chebyshev_weights_at,
    contrast_factor,
    signal_scale,
)

if TYPE_CHECKING:
    from tsis.mechanics.mesh import Booleans, Floats
    from tsis.model.probe import Probe


# At the end the tissue starts to wrap around the rim, on stiff tissue earlier.
DOMED_LOADS, FLAT_LOADS = (1.0, 3.6, 3.6), (0.1, 1.8, 1.8)
WIDE_DOMED_LOADS, WIDE_FLAT_LOADS = (1.0, 3.0, 2.4), (0.1, 1.3, 0.9)
# Of the prior breast-ex-vivo, with a margin: its tissue, and the contrasts of its lumps over any tissue of it.
TISSUE_CONTRAST, TISSUE_KPA = (1.15, 22.0), (3.0, 8.4)
NEAR = 0.15  # of the box: how far from another box a press tells the error in it
WEAK = 1.2  # a contrast below which the correction follows the signal


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
        tissue modulus times radius squared. The least, the largest on the softest and that on the stiffest tissue.
    """

    diameter_mm: tuple[float, float] = (1.0, 15.0)
    depth_mm: tuple[float, float] = (4.0, 12.0)
    contrast: tuple[float, float] = (6.0, 34.0)
    tissue_young_kpa: tuple[float, float] = (3.4, 7.4)
    thickness_mm: tuple[float, float] = (26.5, 37.0)
    load: tuple[float, float, float] = DOMED_LOADS

    def __post_init__(self) -> None:
        for name, ends in asdict(self).items():
            if not 0 < ends[0] < min(ends[1:]) <= max(ends) < np.inf:
                raise InputError(f"{name} must be a range (low, high) with 0 < low < high; got {ends}")

    @property
    def coordinates(self) -> Floats:
        """Ends of the six coordinates, shape (2, 6)."""
        return _coordinates(self)

    def largest_load(self, tissue_young_kpa: Floats) -> Floats:
        """Largest load on tissues of a modulus in kPa; it changes with the modulus's logarithm."""
        low, high = self.coordinates[:, 3]
        place = np.clip((np.log(tissue_young_kpa) - low) / (high - low), 0.0, 1.0)
        return np.asarray(self.load[1] + place * (self.load[2] - self.load[1]))

    def unit(self, states: Floats) -> Floats:
        """States of a `design` in unit coordinates, shape (n, 6); outside [0, 1] beyond the box."""
        return np.hstack([self.unit_spheres(*states[:, :3].T), self.unit_slabs(*states[:, 3:].T)])

    def unit_spheres(self, diameter_mm: Floats, depth_mm: Floats, factor: Floats) -> Floats:
        """Diameters, depths and factors of contrast in unit coordinates, shape (n, 3)."""
        low, high = self.coordinates[:, :3]
        return np.asarray((np.column_stack([np.log(diameter_mm), np.log(depth_mm), factor]) - low) / (high - low))

    def unit_slabs(self, tissue_young_kpa: Floats, thickness_mm: Floats, load: Floats) -> Floats:
        """Moduli, thicknesses and loads in unit coordinates, shape (n, 3)."""
        low, high = self.coordinates[:, 3:]
        part = (load - self.load[0]) / (self.largest_load(tissue_young_kpa) - self.load[0])
        return np.asarray(
            (np.column_stack([np.log(tissue_young_kpa), np.log(thickness_mm), part]) - low) / (high - low)
        )

    def holds(self, box: Box) -> bool:
        """Whether it covers the inclusions and slabs of another box.

        A weaker contrast than its least is covered too: the correction is nearly in proportion to the signal.
        """
        pairs = (
            (self.diameter_mm, box.diameter_mm),
            (self.depth_mm, box.depth_mm),
            (self.tissue_young_kpa, box.tissue_young_kpa),
            (self.thickness_mm, box.thickness_mm),
        )
        strongest = box.young_kpa[1] / box.tissue_young_kpa[0]
        weakest = box.young_kpa[0] / box.tissue_young_kpa[1]
        least = self.contrast[0] if self.contrast[0] > WEAK else 1.0
        within = all(own[0] <= other[0] and other[1] <= own[1] for own, other in pairs)
        return within and least <= weakest and strongest <= self.contrast[1]


@lru_cache(maxsize=64)  # an estimate asks some hundred times
def _coordinates(box: CorrectionBox) -> Floats:
    ends = [
        np.log(box.diameter_mm),
        np.log(box.depth_mm),
        contrast_factor(np.array(box.contrast)),
        np.log(box.tissue_young_kpa),
        np.log(box.thickness_mm),
        (0.0, 1.0),  # of the way from the least to the largest load
    ]
    result = np.array(ends, dtype=float).T
    result.flags.writeable = False
    return result


def correction_box(probe: Probe, box: Box | None = None) -> CorrectionBox:
    """Ranges of a correction that covers another box.

    They are those of the catalog's priors with a margin, else those of `wide_box`, else those of the box itself.
    """
    of_phantoms = CorrectionBox(load=_loads(probe))
    if box is None or of_phantoms.holds(box):
        return of_phantoms
    of_tissue = tissue_box(probe)
    if of_tissue.holds(box):
        return of_tissue
    wide = wide_box(probe)
    if wide.holds(box):
        return wide
    soft, stiff = box.tissue_young_kpa
    loads = wide.largest_load(np.array([0.9 * soft, 1.1 * stiff])).tolist()
    return CorrectionBox(
        diameter_mm=box.diameter_mm,
        depth_mm=box.depth_mm,
        contrast=(max(0.95 * box.young_kpa[0] / stiff, 1.02), 1.05 * box.young_kpa[1] / soft),
        tissue_young_kpa=(0.9 * soft, 1.1 * stiff),
        thickness_mm=(0.97 * box.thickness_mm[0], 1.03 * box.thickness_mm[1]),
        load=(wide.load[0], *loads),
    )


def _loads(probe: Probe) -> tuple[float, float, float]:
    return FLAT_LOADS if probe.face_curvature_mm is None else DOMED_LOADS


def tissue_box(probe: Probe) -> CorrectionBox:
    """Lumps of usual size and depth in soft tissue, of any contrast: it reaches to larger loads than `wide_box`."""
    return CorrectionBox(contrast=TISSUE_CONTRAST, tissue_young_kpa=TISSUE_KPA, load=_loads(probe))


def wide_box(probe: Probe) -> CorrectionBox:
    """All that a laboratory presses: tissue of 1 to 50 kPa and slabs of 15 to 60 mm, each known to 10 %."""
    return CorrectionBox(
        diameter_mm=(1.0, 25.0),
        depth_mm=(2.0, 20.0),
        contrast=(1.15, 40.0),
        tissue_young_kpa=(0.75, 65.0),
        thickness_mm=(12.5, 72.0),
        load=WIDE_FLAT_LOADS if probe.face_curvature_mm is None else WIDE_DOMED_LOADS,
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
        factor = scipy.linalg.cho_factor(_kernel(points, points, lengths) + nugget * np.eye(len(points)), lower=True)
        basis = _linear(points)
        slopes = np.asarray(
            np.linalg.solve(
                basis.T @ scipy.linalg.cho_solve(factor, basis), basis.T @ scipy.linalg.cho_solve(factor, values)
            ),
            dtype=float,
        )
        weights = scipy.linalg.cho_solve(factor, values - basis @ slopes)
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


def left_out(points: Floats, values: Floats, lengths: Floats, nugget: float) -> Floats:
    """Errors (n, k) of the process through all points but one, at that one."""
    basis = _linear(points)
    inverse = np.linalg.inv(_kernel(points, points, lengths) + nugget * np.eye(len(points)))
    projected = inverse - inverse @ basis @ np.linalg.solve(basis.T @ inverse @ basis, basis.T @ inverse)
    return np.asarray(projected @ values / np.diag(projected)[:, None])


def _kernel(some: Floats, others: Floats, lengths: Floats) -> Floats:
    some, others = some / lengths, others / lengths
    square = (some**2).sum(axis=1)[:, None] + (others**2).sum(axis=1) - 2 * some @ others.T
    return np.asarray(np.exp(-0.5 * np.maximum(square, 0.0)))


def _linear(points: Floats) -> Floats:
    return np.column_stack([np.ones(len(points)), points])


def fit_lengths(points: Floats, values: Floats) -> tuple[Floats, float]:
    """Correlation lengths and noise variance of the largest likelihood, the same for all columns of ``values``."""
    basis = _linear(points)
    free, columns = len(points) - basis.shape[1], values.shape[1]

    def misfit(logs: Floats) -> tuple[float, Floats]:
        """Negative logarithm of the restricted likelihood and of a wide prior on the lengths, and its derivatives."""
        scaled = points / np.exp(logs[:-1])
        smooth, noise = _kernel(points, points, np.exp(logs[:-1])), np.exp(logs[-1])
        root = scipy.linalg.cholesky(smooth + noise * np.eye(len(points)), lower=True, check_finite=False)
        white = scipy.linalg.solve_triangular(root, np.eye(len(points)), lower=True)
        directions, upper = np.linalg.qr(white @ basis)
        rest = white - directions @ (directions.T @ white)
        precision = rest.T @ rest  # of what the linear mean leaves
        weighed = precision @ values
        squares = (values * weighed).sum(axis=0)
        volume = np.log(np.diag(root)).sum() + np.log(np.abs(np.diag(upper))).sum()
        value = 0.5 * free * np.log(squares / free).mean() + volume + 0.1 * (logs[:-1] ** 2).sum()
        # d misfit = sum(by_covariance * d covariance), and d kernel / d log length = kernel * (difference / length)**2
        by_covariance = 0.5 * (precision - free / columns * (weighed / squares) @ weighed.T)
        by_kernel = by_covariance * smooth
        by_lengths = 2 * (by_kernel.sum(axis=1) @ scaled**2 - (scaled * (by_kernel @ scaled)).sum(axis=0))
        slopes = np.append(by_lengths + 0.2 * logs[:-1], noise * np.trace(by_covariance))
        return float(value), slopes

    start = np.append(np.full(points.shape[1], 0.5), np.log(1e-4))
    bounds = [(-1.5, 3.5)] * points.shape[1] + [(np.log(1e-8), np.log(0.1))]
    best = scipy.optimize.minimize(
        misfit,
        start,
        method="L-BFGS-B",
        jac=True,
        bounds=bounds,
        options={"maxiter": 500, "ftol": 1e-13, "gtol": 1e-4},
    ).x
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
        Profiles of the correction of the signal over its norm beside a multiple of the signal, shape (k, outputs).
    of_displacement
        Whether each mode, and each output, is of the displacement, not of the pressure; shapes (k,) and (outputs,).
    processes
        Multiples of the signal's pressure and displacement, logarithms of their norms over the scale of the signal, and
        the coefficients of the modes, in this order.
    left_out
        Root mean square error of the pressure over the mean pressure, where each press learnt from is left out, (n,).
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
    of_displacement: tuple[Booleans, Booleans]
    processes: tuple[CorrectionProcess, ...]
    left_out: Floats
    signal_error: tuple[float, float]
    key: str

    def error_in(self, box: Box) -> float:
        """Root mean square error of the pressure over the mean pressure, in and near another box."""
        low, high = self.box.coordinates
        which, others = [0, 1, 3, 4], (box.diameter_mm, box.depth_mm, box.tissue_young_kpa, box.thickness_mm)
        first, last = (np.log(others).T - low[which]) / (high - low)[which]
        places = self.processes[0].points[:, which]
        beyond = np.maximum(np.maximum(first - places, places - last), 0.0)
        weights = np.exp(-0.5 * ((beyond / NEAR) ** 2).sum(axis=1))
        return float(np.sqrt((weights * self.left_out**2).sum() / weights.sum()))

    def mapped(self, without_inclusion: Floats, change: Floats) -> FiniteCorrection:
        """Linearly mapped outputs: one matrix (new, old) for tissue without inclusion, one for the change.

        Neither may mix pressures and displacements.
        """
        of_modes, of_outputs = self.of_displacement
        return replace(
            self,
            baseline=self.baseline @ without_inclusion.T,
            modes=self.modes @ change.T,
            of_displacement=(of_modes, np.abs(change) @ of_outputs > 0),
        )

    def forces_n(self, tissue_young_kpa: float, thickness_mm: float) -> tuple[float, float]:
        """Least and largest force in newtons on tissue of a modulus in kPa and a thickness in mm."""
        unit = self._unit(tissue_young_kpa, thickness_mm)
        most = float(self.box.largest_load(np.array(tissue_young_kpa)))
        return (self.box.load[0] if self.is_domed else 0.0) * unit, most * unit

    def without_inclusion(self, states: Floats) -> Floats:
        """Correction without inclusion; ``states`` (m, 3): modulus in kPa, thickness in mm, force in N."""
        positions, share = self._states(states)
        *points, outputs = self.baseline.shape
        by = [chebyshev_weights((0.0, 1.0), count, at) for count, at in zip(points, positions.T, strict=True)]
        weights = by[0][:, :, None, None] * by[1][:, None, :, None] * by[2][:, None, None, :]
        return np.asarray(share[:, None] * (weights.reshape(len(states), -1) @ self.baseline.reshape(-1, outputs)))

    def change(self, diameter_mm: Floats, depth_mm: Floats, contrast: Floats, states: Floats, signal: Floats) -> Floats:
        """Correction of the signal of n inclusions in m states (see `without_inclusion`), shape (m, n, outputs).

        ``signal`` (m, n, outputs) is that at small strain.
        """
        factor = contrast_factor(contrast)
        inclusions = np.clip(self.box.unit_spheres(diameter_mm, depth_mm, factor), 0.0, 1.0)
        positions, share = self._states(states)
        found = np.concatenate([process(inclusions, positions) for process in self.processes], axis=-1)
        of_modes, of_outputs = (which.astype(int) for which in self.of_displacement)
        multiples, norms, coefficients = found[..., :2], np.exp(found[..., 2:4]), found[..., 4:]
        norms = norms * signal_scale(diameter_mm, depth_mm, factor)[:, None] * share[:, None, None]
        rest = (norms[..., of_modes] * coefficients) @ self.modes
        return np.asarray(multiples[..., of_outputs] * signal + rest)

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
        slabs = [(tissue, thickness) for tissue, thickness, _ in states.tolist()]
        units = {slab: self._unit(*slab) for slab in dict.fromkeys(slabs)}
        load = states[:, 2] / np.array([units[slab] for slab in slabs])
        share = np.ones(len(states)) if self.is_domed else np.minimum(load / self.box.load[0], 1.0)
        return np.clip(self.box.unit_slabs(states[:, 0], states[:, 1], load), 0.0, 1.0), share

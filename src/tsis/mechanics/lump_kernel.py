"""What a lump anywhere under the probe does to a press: a kernel of first order, and its correction for real lumps.

A small volume whose modulus differs changes the press in proportion to its volume (Born). The kernel is that change by
a unit of volume and of relative modulus, harmonic by harmonic around the probe's axis, at each distance from the axis
and depth. A sphere of contrast k counts as its mean over the sphere's volume, times Eshelby's factor
``(k - 1) / (1 + 0.405 (k - 1))`` at a Poisson's ratio of 0.49: the strain inside a stiff sphere is smaller than in the
tissue. What remains for lumps that are large, or near to the skin or the support, is a small shift of the depth and a
factor, both fitted to exact presses of spheres on the axis.

At finite strain a lump comes nearer to the face, and more of the press rests on it: shift and factor depend on the
force. They are fitted to presses on the axis at finite strain, and taken for lumps beside the axis too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.files.cache import cached_arrays, content_key
from tsis.mechanics.mesh import mechanical_content
from tsis.mechanics.small_strain.linear_press import small_strain_press
from tsis.mechanics.small_strain.slab import Resolution
from tsis.mechanics.surrogate.polynomial import Box, contrast_factor, signal_scale
from tsis.mechanics.surrogate.states import OUTPUTS, SmallStrainSlabs, full_contact_rows
from tsis.mechanics.tissue_field import FieldMesh, TissueFieldResponse
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.require import require_number

if TYPE_CHECKING:
    from tsis.mechanics.mesh import Floats
    from tsis.mechanics.surrogate.finite_correction import FiniteCorrection
    from tsis.model.probe import Probe


FORMAT_VERSION = 2
HARMONICS = 7  # 0 to 6
REACH_MM, STEP_MM = 24.0, 0.5  # distance beyond the face's rim, and step of distance and depth
SHALLOWEST_MM, DEEPEST = 0.5, 0.98  # of the points' depth: mm, and fraction of the slab
PARTS = ("unit", "shape")  # of a press: by one newton, and by the dome's shape
RADIAL = 4  # quadrature over a sphere: shells and rings of latitude
LATITUDES, LONGITUDES = 6, 12


def eshelby_factor(contrast: Floats | float, poisson: float = 0.49) -> Floats:
    """Relative change of modulus that acts like a sphere of a contrast of modulus.

    Eshelby's sphere of equal Poisson's ratio: the strain in it is that of the tissue over ``1 + b (k - 1)``, with
    ``b = 2 (4 - 5 nu) / (15 (1 - nu))`` for shear, which is 0.405 at nu = 0.49.

    Examples
    --------
    >>> round(float(eshelby_factor(10.0)), 3)
    1.937
    """
    share = 2 * (4 - 5 * poisson) / (15 * (1 - poisson))
    return np.asarray((np.asarray(contrast) - 1) / (1 + share * (np.asarray(contrast) - 1)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LumpKernel:
    """Change of a press by a unit of volume and relative modulus, for one probe on one slab.

    Attributes
    ----------
    radius_mm
        Radii of the face, shape (radii,).
    distance_mm, depth_mm
        Distance from the axis and depth of the volume, evenly spaced, shapes (n,) and (k,).
    pressure_kpa, face_displacement_mm
        Change per mm**3, shape (parts, harmonics, radii, n, k), of `PARTS`: harmonic m is the factor of
        ``cos m (angle - angle of the lump)``.
    correction
        Shift of the depth in mm and logarithm of the factor, at ``force_n``, `EXACT_DIAMETERS`, `EXACT_TOPS` and
        Eshelby's factors of `EXACT_CONTRASTS`, shape (2, forces, diameters, tops, contrasts); zeros correct nothing.
    force_n
        Ascending forces of the correction in newtons, shape (forces,); beyond them it is that of the nearest. At small
        strain it is the same at all.
    poisson, thickness_mm
        Of the slab.
    """

    radius_mm: Floats
    distance_mm: Floats
    depth_mm: Floats
    pressure_kpa: Floats
    face_displacement_mm: Floats
    correction: Floats
    force_n: Floats
    poisson: float
    thickness_mm: float

    def sphere_table(self, rows: Floats, diameters_mm: Floats, *, quantity: str = "pressure_kpa") -> Floats:
        """Means over spheres of the outputs ``rows @ profile``.

        Parameters
        ----------
        rows
            Matrix from the profile over ``radius_mm`` to outputs, shape (outputs, radii).
        diameters_mm
            Diameters of the spheres, shape (d,).
        quantity
            ``"pressure_kpa"`` or ``"face_displacement_mm"``.

        Returns
        -------
        Shape (parts, d, n, k, harmonics, outputs), by the distance and depth of the sphere's centre.
        """
        field = np.einsum("or,pmrnk->pmnko", rows, getattr(self, quantity), optimize=True)
        parts, harmonics = field.shape[:2]
        grid = (len(self.distance_mm), len(self.depth_mm))
        result = np.empty((parts, len(diameters_mm), *grid, harmonics, len(rows)))
        for number, diameter in enumerate(diameters_mm.tolist()):
            for order in range(harmonics):
                mean = self._mean_over_spheres(diameter, order)
                flat = np.moveaxis(field[:, order].reshape(parts, -1, len(rows)), 0, -1).reshape(mean.shape[1], -1)
                values = (mean @ flat).reshape(*grid, len(rows), parts)
                result[:, number, :, :, order] = np.moveaxis(values, -1, 0)
        return result

    def _mean_over_spheres(self, diameter_mm: float, harmonic: int) -> scipy.sparse.csr_array:
        """Matrix from the grid of distance and depth to means over spheres centred on it."""
        offset, weight = _sphere_points(diameter_mm / 2)
        distance, depth = np.meshgrid(self.distance_mm, self.depth_mm, indexing="ij")
        x = distance.ravel()[:, None] + offset[:, 0]
        away, angle = np.hypot(x, offset[:, 1]), np.arctan2(offset[:, 1], x)
        below = depth.ravel()[:, None] + offset[:, 2]
        factor = np.cos(harmonic * angle) * weight
        return _bilinear(self.distance_mm, self.depth_mm, away, below, factor)

    def corrected(
        self, diameter_mm: Floats, centre_mm: Floats, contrast: Floats, force_n: float = 1.0
    ) -> tuple[Floats, Floats]:
        """Depth in the kernel and factor of its response for spheres: those that exact presses on the axis give."""
        factors = eshelby_factor(np.array(EXACT_CONTRASTS), self.poisson)
        axes = (self.force_n, np.log(EXACT_DIAMETERS), np.log(EXACT_TOPS), factors)
        top = np.maximum(np.asarray(centre_mm) - np.asarray(diameter_mm) / 2, EXACT_TOPS[0])
        place = [np.asarray(force_n), np.log(diameter_mm), np.log(top), eshelby_factor(contrast, self.poisson)]
        at = [np.clip(values, axis[0], axis[-1]) for values, axis in zip(place, axes, strict=True)]
        table = scipy.interpolate.RegularGridInterpolator(axes, np.moveaxis(self.correction, 0, -1))
        shift, log_factor = np.moveaxis(table(np.stack(np.broadcast_arrays(*at), axis=-1)), -1, 0)
        return np.asarray(centre_mm + shift), np.exp(log_factor)

    def response(
        self, *, distance_mm: float, centre_mm: float, diameter_mm: float, contrast: float, force_n: float = 1.0
    ) -> Floats:
        """Change of the pressure by one sphere, shape (harmonics, radii), in kPa; zero beyond the kernel's reach.

        Examples
        --------
        >>> import tsis
        >>> kernel = lump_kernel(tsis.load_probe("tsis-2011"))
        >>> change = kernel.response(distance_mm=0.0, centre_mm=9.0, diameter_mm=8.0, contrast=12.0)
        >>> bool(change[0, 0] > 0)  # a stiff lump under the axis raises the pressure there
        True
        """
        require_number("distance_mm", distance_mm, 0.0, 1e4, hint="millimetres")
        require_number("centre_mm", centre_mm, diameter_mm / 2, self.thickness_mm, hint="millimetres")
        require_number("contrast", contrast, 1e-3, 1e6)
        depth, factor = self.corrected(np.array([diameter_mm]), np.array([centre_mm]), np.array([contrast]), force_n)
        offset, weight = _sphere_points(diameter_mm / 2)
        x = distance_mm + offset[:, 0]
        away, angle = np.hypot(x, offset[:, 1]), np.arctan2(offset[:, 1], x)
        below = (float(depth[0]) + offset[:, 2])[None]
        volume = np.pi / 6 * diameter_mm**3 * float(eshelby_factor(contrast, self.poisson)) * float(factor[0])
        result = np.zeros(self.pressure_kpa.shape[1:3])
        for order in range(len(result)):
            mean = _bilinear(self.distance_mm, self.depth_mm, away[None], below, np.cos(order * angle) * weight)
            both = self.pressure_kpa[:, order].reshape(len(PARTS), len(self.radius_mm), -1) @ mean.toarray()[0]
            result[order] = volume * (force_n * both[0] + both[1])
        return result


def _bilinear(
    first: Floats, second: Floats, at_first: Floats, at_second: Floats, factor: Floats
) -> scipy.sparse.csr_array:
    """Matrix (rows, len(first) * len(second)) of the sums over points (rows, points) of bilinear values.

    Beyond the first coordinate the values are zero; the second is moved to the grid's end.
    """
    step, rows = first[1] - first[0], len(at_second)
    a = at_first / step
    inside = a < len(first) - 1
    i = np.minimum(a.astype(int), len(first) - 2)
    b = np.clip((at_second - second[0]) / (second[1] - second[0]), 0.0, len(second) - 1 - 1e-9)
    j = b.astype(int)
    p, q, factor = np.where(inside, a - i, 0.0), b - j, np.where(inside, factor, 0.0)
    row = np.broadcast_to(np.arange(rows)[:, None], i.shape)
    width, matrix = len(second), scipy.sparse.csr_array((rows, len(first) * len(second)))
    for di, wi in ((0, 1 - p), (1, p)):
        for dj, wj in ((0, 1 - q), (1, q)):
            entries = (factor * wi * wj).ravel(), (row.ravel(), ((i + di) * width + j + dj).ravel())
            matrix = matrix + scipy.sparse.csr_array(entries, shape=matrix.shape)
    return matrix


def _sphere_points(radius_mm: float) -> tuple[Floats, Floats]:
    """Points (n, 3) of a sphere and their weights, which sum to 1."""
    x, w = np.polynomial.legendre.leggauss(RADIAL)
    shell = (x + 1) / 2
    shell_weight = w / 2 * shell**2 * 3
    height, ring_weight = np.polynomial.legendre.leggauss(LATITUDES)
    turn = 2 * np.pi * (np.arange(LONGITUDES) + 0.5) / LONGITUDES
    s, h, t = np.meshgrid(shell, height, turn, indexing="ij")
    across = np.sqrt(1 - h**2)
    points = radius_mm * s[..., None] * np.stack([across * np.cos(t), across * np.sin(t), h], axis=-1)
    weight = shell_weight[:, None, None] * ring_weight[None, :, None] / 2 * np.full(LONGITUDES, 1 / LONGITUDES)
    return points.reshape(-1, 3), weight.ravel()


EXACT_DIAMETERS = (4.0, 6.0, 8.0, 11.0, 15.0)
EXACT_TOPS = (1.5, 3.0, 5.0, 8.0, 12.0, 16.0)
EXACT_CONTRASTS = (2.0, 4.0, 10.0, 30.0)
LIGHT_N = 0.05  # the press is linear
FITS = 0.92  # of the slab's thickness
INNER = 0.8  # of the face's radius, on which the rings lie


def lump_kernel(
    probe: Probe,
    *,
    young_kpa: float = 5.0,
    thickness_mm: float = 30.0,
    poisson: float = 0.49,
    corrected: bool = True,
    mesh: FieldMesh | None = None,
) -> LumpKernel:
    """Kernel of a probe whose covered face is pressed on a slab, or the stored one; seconds.

    Parameters
    ----------
    probe, young_kpa, thickness_mm, poisson
        The probe and the tissue; the modulus in [0.05, 2000] kPa, the thickness in [2, 500] mm.
    corrected
        Whether to fit `LumpKernel.corrected` to exact presses; else it changes nothing.
    mesh
        Mesh density.
    """
    require_number("young_kpa", young_kpa, 0.05, 2000.0, hint="kilopascals")
    require_number("thickness_mm", thickness_mm, 2.0, 500.0, hint="millimetres")
    density = mesh or FieldMesh(points=25)
    content = {
        "version": FORMAT_VERSION,
        "probe": mechanical_content(probe),
        "tissue": [young_kpa, thickness_mm, poisson],
        "grid": [HARMONICS, REACH_MM, STEP_MM, density.order, density.finest, density.largest, density.growth],
        "points": density.points,
        "exact": [EXACT_DIAMETERS, EXACT_TOPS, EXACT_CONTRASTS] if corrected else [],
    }

    def solve() -> dict[str, Floats]:
        with one_blas_thread():
            return _solve(probe, young_kpa, thickness_mm, poisson, density, corrected=corrected)

    arrays = cached_arrays("lump-kernel", content_key(content), solve, compressed=True)  # a flat face has no shape
    values = {name: np.asarray(array, dtype=float) for name, array in arrays.items()}
    at_all_forces = at_any_force(values.pop("correction"))
    return LumpKernel(**values, **at_all_forces, poisson=poisson, thickness_mm=thickness_mm)


def at_any_force(correction: Floats) -> dict[str, Floats]:
    """Fields of a `LumpKernel` whose correction (2, diameters, tops, contrasts) is the same at all forces."""
    return {"correction": np.stack([correction, correction], axis=1), "force_n": np.array([0.0, 1.0])}


def _solve(
    probe: Probe, young_kpa: float, thickness_mm: float, poisson: float, mesh: FieldMesh, *, corrected: bool
) -> dict[str, Floats]:
    slab = TissueFieldResponse(probe, young_kpa=young_kpa, thickness_mm=thickness_mm, poisson=poisson, mesh=mesh)
    distance = np.arange(0.0, probe.radius_mm + REACH_MM + STEP_MM / 2, STEP_MM)
    depth = np.arange(SHALLOWEST_MM, DEEPEST * thickness_mm, STEP_MM)
    pressure, displacement = (np.zeros((len(PARTS), HARMONICS, mesh.points, len(distance), len(depth))) for _ in "pu")
    for order in range(HARMONICS):
        response = slab.response(order)
        r, z = np.unique(response.radius_mm.round(9)), np.unique(response.depth_mm.round(9))
        at = np.searchsorted(r, response.radius_mm.round(9)), np.searchsorted(z, response.depth_mm.round(9))
        for target, source in ((pressure, response.pressure_kpa), (displacement, response.face_displacement_mm)):
            density = np.zeros((len(PARTS), mesh.points, len(r), len(z)))
            density[:, :, at[0], at[1]] = source / response.volume_mm3
            flat = np.moveaxis(density, (2, 3), (0, 1)).reshape(len(r), len(z), -1)
            by_depth = np.asarray(
                scipy.interpolate.interp1d(z, flat, axis=1, fill_value="extrapolate")(depth), dtype=float
            )
            values = scipy.interpolate.interp1d(r, by_depth, axis=0, fill_value="extrapolate")(distance)
            target[:, order] = np.moveaxis(values.reshape(len(distance), len(depth), len(PARTS), -1), (0, 1), (2, 3))
    correction = np.zeros((2, len(EXACT_DIAMETERS), len(EXACT_TOPS), len(EXACT_CONTRASTS)))
    found = {
        "radius_mm": slab.radius_mm,
        "distance_mm": distance,
        "depth_mm": depth,
        "pressure_kpa": pressure,
        "face_displacement_mm": displacement,
    }
    if corrected:
        bare = LumpKernel(**found, **at_any_force(correction), poisson=poisson, thickness_mm=thickness_mm)
        correction = _fitted(bare, probe, Phantom(young_kpa=young_kpa, thickness_mm=thickness_mm, poisson=poisson))
    store: dict[str, Floats] = {
        name: values.astype(np.float32) if values.ndim > 1 else values for name, values in found.items()
    }
    return {**store, "correction": correction}


def _fitted(kernel: LumpKernel, probe: Probe, plain: Phantom) -> Floats:
    """The correction by exact presses of spheres on the axis, under a flat face of the same layers.

    Spheres that do not fit into the slab have the correction of the next shallower one.
    """
    flat = replace(probe, face_curvature_mm=None)
    area = kernel.radius_mm * (kernel.radius_mm <= INNER * probe.radius_mm)
    before = small_strain_press(flat, plain, LIGHT_N, None)
    correction = np.zeros_like(kernel.correction[:, 0])
    for at_diameter, diameter in enumerate(EXACT_DIAMETERS):
        table = kernel.sphere_table(np.eye(len(kernel.radius_mm)), np.array([diameter]))[0, 0, 0, :, 0]
        for at_top, top in enumerate(EXACT_TOPS):
            if top + diameter > FITS * plain.thickness_mm:
                correction[:, at_diameter, at_top] = correction[:, at_diameter, at_top - 1]
                continue
            for at_contrast, contrast in enumerate(EXACT_CONTRASTS):
                lump = Inclusion(
                    diameter_mm=diameter, depth_mm=top, young_kpa=contrast * plain.young_kpa, poisson=plain.poisson
                )
                after = small_strain_press(flat, replace(plain, inclusion=lump), LIGHT_N, None)
                change = (after.pressure_kpa - before.pressure_kpa) / LIGHT_N
                exact = np.interp(kernel.radius_mm, before.radius_mm, change)
                volume = np.pi / 6 * diameter**3 * float(eshelby_factor(contrast, plain.poisson))
                shift, scale = _nearest(kernel.depth_mm, volume * table, exact, area, top + diameter / 2)
                correction[:, at_diameter, at_top, at_contrast] = shift, np.log(scale)
    return correction


FORCES = 6  # of a correction at finite strain
FARTHEST_MM = 4.0  # shift at finite strain


def finite_strain_kernel(
    kernel: LumpKernel, probe: Probe, correction: FiniteCorrection, *, young_kpa: float
) -> LumpKernel:
    """The kernel, corrected by presses of spheres on the axis at finite strain; seconds, or the stored one.

    Parameters
    ----------
    kernel, probe, young_kpa
        The kernel of a probe on tissue of a modulus in kPa.
    correction
        What finite strain adds to the probe's presses; beyond its ranges it is that of their ends.
    """
    content = {
        "version": FORMAT_VERSION,
        "correction": correction.key,
        "tissue": [young_kpa, kernel.thickness_mm, kernel.poisson],
        "exact": [EXACT_DIAMETERS, EXACT_TOPS, EXACT_CONTRASTS, FORCES, FARTHEST_MM],
        "radii": kernel.radius_mm.tolist(),
    }

    def solve() -> dict[str, Floats]:
        with one_blas_thread():
            return _at_finite_strain(kernel, probe, correction, young_kpa)

    stored = cached_arrays("finite-lump-kernel", content_key(content), solve)
    return replace(kernel, correction=stored["correction"], force_n=stored["force_n"])


def _at_finite_strain(
    kernel: LumpKernel, probe: Probe, correction: FiniteCorrection, young_kpa: float
) -> dict[str, Floats]:
    thickness, most = kernel.thickness_mm, correction.forces_n(young_kpa, kernel.thickness_mm)[1]
    least = most * correction.box.load[0] / float(correction.box.largest_load(np.array(young_kpa)))
    forces = np.linspace(least, most, FORCES)
    states = np.column_stack([np.full(FORCES, young_kpa), np.full(FORCES, thickness), forces])
    area = kernel.radius_mm * (kernel.radius_mm <= INNER * probe.radius_mm)
    contrasts = np.array(EXACT_CONTRASTS)
    grid = (len(EXACT_DIAMETERS), len(EXACT_TOPS), len(EXACT_CONTRASTS))
    result = np.zeros((2, FORCES, *grid))
    round_part = replace(kernel, pressure_kpa=kernel.pressure_kpa[:, :1])  # of harmonic 0
    for at_diameter, diameter in enumerate(EXACT_DIAMETERS):
        tables = round_part.sphere_table(np.eye(len(kernel.radius_mm)), np.array([diameter]))[:, 0, 0, :, 0]
        for at_top, top in enumerate(EXACT_TOPS):
            if top + diameter > FITS * thickness:
                result[:, :, at_diameter, at_top] = result[:, :, at_diameter, at_top - 1]
                continue
            rows = _changes(probe, (diameter, top), contrasts, young_kpa, thickness, kernel.poisson)
            for at_contrast, contrast in enumerate(EXACT_CONTRASTS):
                parts = rows[at_contrast, :, :OUTPUTS]
                small = forces[:, None] * parts[0] + parts[1]
                sphere = (np.array([diameter]), np.array([top]), np.array([contrast]))
                finite = small + correction.change(*sphere, states, small[:, None])[:, 0]
                volume = np.pi / 6 * diameter**3 * float(eshelby_factor(contrast, kernel.poisson))
                for at_force, force in enumerate(forces.tolist()):
                    exact = np.interp(kernel.radius_mm, correction.radius_mm, finite[at_force, : OUTPUTS // 2])
                    table = volume * (force * tables[0] + tables[1])
                    shift, scale = _nearest(kernel.depth_mm, table, exact, area, top + diameter / 2, FARTHEST_MM)
                    result[:, at_force, at_diameter, at_top, at_contrast] = shift, np.log(scale)
    return {"correction": result, "force_n": forces}


def _changes(
    probe: Probe, sphere: tuple[float, float], contrasts: Floats, young_kpa: float, thickness_mm: float, poisson: float
) -> Floats:
    """Change at small strain by a sphere (diameter, top) of each contrast, shape (contrasts, `PARTS`, outputs)."""
    diameter, top = sphere
    box = Box(
        diameter_mm=(diameter / 2, diameter),
        depth_mm=(top / 2, top),
        tissue_young_kpa=(0.9 * young_kpa, 1.1 * young_kpa),
        thickness_mm=(thickness_mm, 1.01 * thickness_mm),
        poisson=poisson,
    )
    slabs = SmallStrainSlabs(probe, box, Resolution(), full_contact_rows, thickness_mm)
    factors = contrast_factor(contrasts)
    rows = slabs.changes(sphere, factors, [young_kpa])[:, 0] * signal_scale(*sphere, factors)[:, None]
    unit, shape = rows[:, : OUTPUTS + 1], rows[:, OUTPUTS + 1 : 2 * (OUTPUTS + 1)]
    return np.stack([unit, shape if shape.shape == unit.shape else np.zeros_like(unit)], axis=1)


def _nearest(
    depth_mm: Floats, table: Floats, exact: Floats, area: Floats, centre_mm: float, farthest_mm: float = 1.5
) -> tuple[float, float]:
    """Shift of the depth and factor with which the kernel's profile (depths, radii) is nearest to the exact one."""
    shifts = np.linspace(-farthest_mm, farthest_mm, round(80 * farthest_mm) + 1)
    profiles = scipy.interpolate.interp1d(depth_mm, table, axis=0, fill_value="extrapolate")(centre_mm + shifts)
    product, square = profiles @ (area * exact), (profiles**2) @ area
    scale = product / square
    best = int(np.argmin((exact**2) @ area - product * scale))
    return float(shifts[best]), float(max(scale[best], 1e-3))

"""The press as a polynomial: Chebyshev tensors in diameter, depth, contrast, tissue modulus and slab thickness.

The change that an inclusion makes is nearly proportional to ``g (d / c)**3`` with the saturation in its modulus
``g = (Ei - Et) / (Ei + 1.5 Et)`` and the depth of its centre ``c = h + d / 2``; what is interpolated is the change
divided by that, which is smooth enough for low degrees. Changes come from solves with and without contrast on one mesh.
"""

from __future__ import annotations

import io
import itertools
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from tsis.mechanics import chebyshev, disk_cache
from tsis.mechanics.bodies import Resolution, face_of
from tsis.mechanics.small_strain import EDGE_SHARE, MN_PER_N, PressKernel, UnitPress
from tsis.model import check
from tsis.model.errors import InputError, MechanicsError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.model import Probe

FORMAT_VERSION = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """Ranges (low, high) over which a surrogate holds.

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
        check.number("poisson", self.poisson, 0.0, 0.495)
        deepest = self.depth_mm[1] + self.diameter_mm[1]
        if deepest >= self.thickness_mm[0]:
            raise InputError(
                f"the largest depth_mm + diameter_mm must be less than the smallest thickness_mm "
                f"= {self.thickness_mm[0]:g}; got {deepest:g}"
            )
        if self.young_kpa[0] <= self.tissue_young_kpa[1]:
            raise InputError(
                f"young_kpa must lie above tissue_young_kpa = {self.tissue_young_kpa[1]:g}: an inclusion stiffer "
                f"than its surroundings; got {self.young_kpa[0]:g}"
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
    """Chebyshev points along each axis; (11, 7, 3, 3, 3) holds 0.1 % of the peak signal on the default box."""

    diameter: int = 11
    depth: int = 7
    contrast: int = 3
    tissue: int = 3
    thickness: int = 3


def contrast_factor(contrast: Any) -> Any:
    """Saturation of the signal with the modulus: g(s) = (s - 1) / (s + 1.5) of s = Ei / Et (EVIDENCE's law)."""
    return (contrast - 1) / (contrast + 1.5)


def scale(diameter_mm: Any, depth_mm: Any, factor: Any) -> Any:
    """What the change is nearly proportional to: g (d / c)**3."""
    return factor * (diameter_mm / (depth_mm + diameter_mm / 2)) ** 3


def _log(interval: tuple[float, float]) -> tuple[float, float]:
    low, high = interval
    return float(np.log(low)), float(np.log(high))


def _contrast(factor: float) -> float:
    return (1 + 1.5 * factor) / (1 - factor)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surrogate:
    """A probe's answer to a press of 1 N anywhere in a box, linear in the force.

    Attributes
    ----------
    box
        Where it holds.
    plain
        Answer of plain tissue at the Chebyshev points, shape (tissue, thickness, outputs).
    change
        Change by the inclusion over `scale` at the points, shape (diameter, depth, contrast, tissue, thickness,
        outputs).
    """

    box: Box
    plain: NDArray[np.float64]
    change: NDArray[np.float64]

    def mapped(self, matrix: NDArray[np.float64]) -> Surrogate:
        """The same surrogate after a linear map of its outputs; ``matrix`` has shape (new, old)."""
        return replace(self, plain=self.plain @ matrix.T, change=self.change @ matrix.T)

    def at_tissue(self, tissue_young_kpa: float, thickness_mm: float) -> TissueSurrogate:
        """Fix the tissue; values outside the box are extrapolated linearly in what the polynomial allows."""
        box, shape = self.box, self.plain.shape
        tissue = chebyshev.weights(_log(box.tissue_young_kpa), shape[0], np.log([tissue_young_kpa]))[0]
        slab = chebyshev.weights(_log(box.thickness_mm), shape[1], np.log([thickness_mm]))[0]
        mix = np.outer(tissue, slab)
        return TissueSurrogate(
            box=box,
            tissue_young_kpa=tissue_young_kpa,
            plain=np.tensordot(mix, self.plain, axes=2),
            change=np.einsum("te,abctek->abck", mix, self.change, optimize=True),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TissueSurrogate:
    """A `Surrogate` at one tissue modulus and thickness: ``plain`` (outputs,), ``change`` (d, h, g, outputs)."""

    box: Box
    tissue_young_kpa: float
    plain: NDArray[np.float64]
    change: NDArray[np.float64]

    def __call__(
        self, diameter_mm: NDArray[np.float64], depth_mm: NDArray[np.float64], young_kpa: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Answer at 1 N for inclusions given by three arrays of shape (n,); shape (n, outputs)."""
        box, (nd, nh, ng, outputs) = self.box, self.change.shape
        factor = contrast_factor(np.asarray(young_kpa) / self.tissue_young_kpa)
        in_d = chebyshev.weights(box.diameter_mm, nd, diameter_mm)
        in_h = chebyshev.weights(box.depth_mm, nh, depth_mm)
        in_g = chebyshev.weights(box.contrast_factor, ng, factor)
        # One matrix product for all inclusions: the fastest order for the few hundred coefficients there are.
        basis = (in_d[:, :, None, None] * in_h[:, None, :, None] * in_g[:, None, None, :]).reshape(-1, nd * nh * ng)
        change = basis @ self.change.reshape(nd * nh * ng, outputs)
        return np.asarray(self.plain + scale(diameter_mm, depth_mm, factor)[:, None] * change)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressSurrogate:
    """Surrogates of everything a press answers, on the nodes of one probe's face.

    Attributes
    ----------
    radius_mm
        Nodes of the face, shape (n,).
    interpolate
        Matrix maker from nodal values to values at given radii.
    pressure_kpa, face_displacement_mm, approach_mm
        Surrogates at 1 N with n, n and 1 outputs.
    """

    radius_mm: NDArray[np.float64]
    interpolate: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    pressure_kpa: Surrogate
    face_displacement_mm: Surrogate
    approach_mm: Surrogate
    key: str = field(default="")


def build_surrogate(
    probe: Probe,
    box: Box | None = None,
    *,
    degrees: Degrees | None = None,
    resolution: Resolution | None = None,
    progress: Callable[[int, int], None] | None = None,
    cached: bool = True,
) -> PressSurrogate:
    """Build the surrogate of a probe, or load it from the disk cache.

    Parameters
    ----------
    probe, box
        What presses, and the ranges of what is pressed.
    degrees, resolution
        Polynomial degrees and mesh density.
    progress
        Called with (slabs solved, slabs in all) as the work goes on.
    cached
        Whether to read and write the disk cache, whose key is the content of all arguments above.

    Raises
    ------
    InputError
        When a range is empty or an inclusion of the box does not fit into the slab.
    MechanicsError
        When the tissue would lift off the probe somewhere in the box.
    """
    box, degrees, resolution = box or Box(), degrees or Degrees(), resolution or Resolution()
    key = disk_cache.content_key(
        {
            "format": FORMAT_VERSION,
            "probe": [probe.radius_mm, [asdict(layer) for layer in probe.layers]],
            "box": asdict(box),
            "degrees": asdict(degrees),
            "resolution": asdict(resolution),
        }
    )
    stored = disk_cache.read("surrogates", key) if cached else None
    if stored is None:
        plain, change = _solve_all(probe, box, degrees, resolution, progress)
        if cached:
            buffer = io.BytesIO()
            np.savez(buffer, plain=plain, change=change)
            disk_cache.write("surrogates", key, buffer.getvalue())
    else:
        with np.load(io.BytesIO(stored), allow_pickle=False) as arrays:
            plain, change = arrays["plain"], arrays["change"]
    return _assemble(probe, box, resolution, plain, change, key)


def _assemble(
    probe: Probe,
    box: Box,
    resolution: Resolution,
    plain: NDArray[np.float64],
    change: NDArray[np.float64],
    key: str,
) -> PressSurrogate:
    face = face_of(probe.radius_mm, resolution)
    nodes = len(face.radius_mm)
    parts = [slice(0, nodes), slice(nodes, 2 * nodes), slice(2 * nodes, None)]
    pressure, displacement, approach = (
        Surrogate(box=box, plain=plain[..., part], change=change[..., part]) for part in parts
    )
    return PressSurrogate(
        radius_mm=face.radius_mm,
        interpolate=face.interpolation,
        pressure_kpa=pressure,
        face_displacement_mm=displacement,
        approach_mm=approach,
        key=key,
    )


def _solve_all(
    probe: Probe,
    box: Box,
    degrees: Degrees,
    resolution: Resolution,
    progress: Callable[[int, int], None] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    slabs = np.exp(chebyshev.points(_log(box.thickness_mm), degrees.thickness))
    tissues = np.exp(chebyshev.points(_log(box.tissue_young_kpa), degrees.tissue))
    factors = chebyshev.points(box.contrast_factor, degrees.contrast)
    spheres = list(
        itertools.product(
            chebyshev.points(box.diameter_mm, degrees.diameter), chebyshev.points(box.depth_mm, degrees.depth)
        )
    )
    total, done = len(slabs) * len(spheres), itertools.count(1)
    plain, change = [], []
    # Two levels of threads would fight for the cores: BLAS stays on one, the slabs share the others.
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor() as pool:
        for thickness in slabs:
            kernel = PressKernel(
                probe,
                thickness_mm=float(thickness),
                poisson=box.poisson,
                block_mm=max(0.8 * probe.radius_mm, 0.65 * box.diameter_mm[1]),
                resolution=resolution,
            )
            plain.append([_row(kernel.plain(float(tissue))) for tissue in tissues])
            tasks = [pool.submit(_changes, kernel, sphere, factors, tissues) for sphere in spheres]
            rows = []
            for task in tasks:
                rows.append(task.result())
                if progress is not None:
                    progress(next(done), total)
            _refuse_lift_off(kernel, np.array(plain[-1]), np.array(rows), spheres, factors)
            change.append(np.array(rows).reshape(degrees.diameter, degrees.depth, *rows[0].shape))
    return np.stack(plain, axis=1), np.stack(change, axis=4)


def _changes(
    kernel: PressKernel,
    sphere: tuple[float, float],
    factors: NDArray[np.float64],
    tissues: NDArray[np.float64],
) -> NDArray[np.float64]:
    diameter, depth = sphere
    slab = kernel.slab(diameter_mm=diameter, depth_mm=depth, poisson=kernel.poisson)
    plain_stiffness = slab.plain_stiffness()
    plain = [kernel.solve(plain_stiffness, float(tissue)) for tissue in tissues]
    rows = []
    for factor in factors:
        stiffness = slab.stiffness(_contrast(float(factor)))
        with_sphere = [kernel.solve(stiffness, float(tissue)) for tissue in tissues]
        size = scale(diameter, depth, factor)
        rows.append([_row(lump - bare) / size for lump, bare in zip(with_sphere, plain, strict=True)])
    return np.array(rows)


def _row(unit: UnitPress) -> NDArray[np.float64]:
    """One press of 1 N as one row: nodal pressures, nodal displacements, approach."""
    return MN_PER_N * np.concatenate([unit.pressure, unit.displacement, [unit.approach]])


def _refuse_lift_off(
    kernel: PressKernel,
    plain: NDArray[np.float64],
    rows: NDArray[np.float64],
    spheres: list[tuple[float, float]],
    factors: NDArray[np.float64],
) -> None:
    inside = np.flatnonzero(kernel.face.radius_mm < EDGE_SHARE * kernel.probe.radius_mm)
    size = np.array([[scale(*sphere, factor) for factor in factors] for sphere in spheres])
    pressure = plain[:, inside] + size[:, :, None, None] * rows[..., inside]
    if pressure.min() < 0:
        diameter, depth = spheres[int(np.unravel_index(pressure.argmin(), pressure.shape)[0])]
        raise MechanicsError(
            f"the tissue lifts off the probe for an inclusion of diameter_mm {diameter:.1f} at depth_mm {depth:.1f}, "
            "and this model keeps the contact closed; narrow the ranges of the inclusion"
        )

"""Presses of a rigid ball or punch without image: pairs of travel and force as relative stiffness, and its kernel.

The force at one travel changes with the modulus of a small volume in proportion to the energy of the strain there. A
ball is a punch whose radius of contact grows with the travel: its force is the integral of the punches' stiffness, so
that several travels of one press tell of several depths.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.mapping.observation import LEAST_PLACE_SD_MM, Observation
from tsis.mapping.scan import LEAST_FORCE_N, Indenter
from tsis.mapping.signals import SignalTable
from tsis.mapping.uneven_field import FieldResponses
from tsis.mechanics.lump_kernel import (
    EXACT_CONTRASTS,
    EXACT_DIAMETERS,
    EXACT_TOPS,
    REACH_MM,
    SHALLOWEST_MM,
    STEP_MM,
    LumpKernel,
)
from tsis.mechanics.tissue_field import FieldMesh, FieldResponse, TissueFieldResponse
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from tsis.mapping.prior import MapPrior
    from tsis.mapping.scan import Scan
    from tsis.mapping.signals import Floats

LEVELS = 3  # travels of a ball that count
RADII = 6  # of contact up to the largest
NOISE = 0.01  # of the force, beside what the curve shows
FORCE_GAIN_SD, CONTACT_SD_MM = 0.02, 0.05  # error of all forces, and of the travel at which contact begins
RIGID = Layer(thickness_mm=0.2, young_kpa=9e5, poisson=0.3)


class _GriddedField:
    """The response of stiffness over a grid of distance and depth, as `FieldResponses` reads that of a probe."""

    def __init__(self, kernel: LumpKernel) -> None:
        distance, depth = np.meshgrid(kernel.distance_mm, kernel.depth_mm, indexing="ij")
        volume = 2 * np.pi * distance * STEP_MM**2
        volume[0] = np.pi * STEP_MM**3 / 4
        values = kernel.pressure_kpa[:, 0] * volume
        count = values.shape[1]
        self._response = FieldResponse(
            pressure_kpa=values.reshape(2, count, -1),
            face_displacement_mm=np.zeros((2, count, volume.size)),
            radius_mm=distance.ravel(),
            depth_mm=depth.ravel(),
            volume_mm3=volume.ravel(),
        )

    def response(self, harmonic: int) -> FieldResponse:
        """Response to the mean around the axis, the only one."""
        if harmonic:
            raise AssertionError("a stiffness has no harmonics")
        return self._response


def _punch(radius_mm: float, tissue: tuple[float, float, float]) -> TissueFieldResponse:
    young, thickness, poisson = tissue
    probe = Probe(radius_mm=max(radius_mm, 1.0), layers=(RIGID,))
    mesh = FieldMesh(points=5, finest=0.06, largest=0.2)
    return TissueFieldResponse(probe, young_kpa=young, thickness_mm=thickness, poisson=poisson, mesh=mesh)


@lru_cache(maxsize=4)
def stiffness_kernel(
    indenter: Indenter, travels_mm: tuple[float, ...], tissue: tuple[float, float, float]
) -> tuple[LumpKernel, tuple[float, ...]]:
    """Kernel of the logarithm of the force at each travel, and these forces in N on even tissue.

    ``tissue`` is modulus in kPa, thickness in mm and Poisson's ratio. The kernel's ``pressure_kpa`` has a row a travel.
    """
    if indenter.shape == "punch":
        radii = np.array([indenter.radius_mm])
    else:
        radii = np.linspace(0.25, 1.0, RADII) * min(np.sqrt(indenter.radius_mm * travels_mm[-1]), indenter.radius_mm)
        radii = np.maximum(radii, 1.0)
    distance = np.arange(0.0, indenter.radius_mm + REACH_MM + STEP_MM / 2, STEP_MM)
    depth = np.arange(SHALLOWEST_MM, 0.98 * tissue[1], STEP_MM)
    grids, stiffness = [], []
    for radius in radii.tolist():
        slab = _punch(radius, tissue)
        change = slab.stiffness_change()
        plain = slab.response(0)
        grids.append(_gridded(plain, change / plain.volume_mm3, distance, depth))
        stiffness.append(slab.travel_per_newton())
    share = np.array(grids)  # (radii, n, k): relative change of each punch's stiffness a mm**3
    each = 1 / np.array(stiffness)  # N per mm
    rows, forces = [], []
    for travel in travels_mm:
        if indenter.shape == "punch":
            rows.append(share[0])
            forces.append(float(each[0] * travel))
            continue
        steps = (np.arange(40) + 0.5) / 40 * travel
        at = np.minimum(np.sqrt(indenter.radius_mm * steps), indenter.radius_mm)
        local = np.interp(at, radii, each) * np.minimum(at / radii[0], 1.0)
        weight = np.array([np.interp(at, radii, np.eye(len(radii))[k]) for k in range(len(radii))]) * local
        rows.append(np.tensordot(weight.sum(axis=1) / local.sum(), share, axes=1))
        forces.append(float(local.mean() * travel))
    pressure = np.zeros((2, 1, len(travels_mm), len(distance), len(depth)))
    pressure[0, 0] = np.array(rows)
    kernel = LumpKernel(
        radius_mm=np.arange(float(len(travels_mm))),
        distance_mm=distance,
        depth_mm=depth,
        pressure_kpa=pressure,
        face_displacement_mm=np.zeros_like(pressure),
        correction=np.zeros((2, len(EXACT_DIAMETERS), len(EXACT_TOPS), len(EXACT_CONTRASTS))),
        poisson=tissue[2],
        thickness_mm=tissue[1],
    )
    return kernel, tuple(forces)


def _gridded(response: FieldResponse, density: Floats, distance: Floats, depth: Floats) -> Floats:
    r, z = np.unique(response.radius_mm.round(9)), np.unique(response.depth_mm.round(9))
    table = np.zeros((len(r), len(z)))
    table[np.searchsorted(r, response.radius_mm.round(9)), np.searchsorted(z, response.depth_mm.round(9))] = density
    points = np.stack(np.meshgrid(distance, depth, indexing="ij"), axis=-1)
    points[..., 0], points[..., 1] = np.clip(points[..., 0], r[0], r[-1]), np.clip(points[..., 1], z[0], z[-1])
    return np.asarray(scipy.interpolate.RegularGridInterpolator((r, z), table)(points))


def observe_stiffness(scan: Scan, prior: MapPrior) -> Observation:
    """Numbers of presses of an indenter: logarithms of the force at a few travels over those on even tissue."""
    if scan.indenter is None:
        raise AssertionError("a scan of pairs has an indenter")
    used, left_out = [], list(scan.left_out)
    for index, press in enumerate(scan.presses):
        curve = press.travel_force
        if curve is None or len(curve) < 2 or curve[:, 1].max() < LEAST_FORCE_N:
            left_out.append(f"{press.name or f'press {index + 1}'} has no contact.")
        else:
            used.append(index)
    if len({scan.presses[index].place_mm for index in used}) < 2:
        raise InputError(f"presses must hold at least two usable places; {' '.join(left_out)}")
    curves = [np.asarray(scan.presses[index].travel_force) for index in used]
    deepest = float(min(curve[-1, 0] for curve in curves))
    if deepest <= 0:
        raise InputError("travel_force must reach a travel above 0 mm in every press")
    count = 1 if scan.indenter.shape == "punch" else LEVELS
    travels = tuple((deepest * np.linspace(1 / count, 1.0, count)).tolist())
    tissue = (prior.tissue_young_kpa, prior.thickness_mm, prior.poisson)
    kernel, even = stiffness_kernel(scan.indenter, travels, tissue)
    table = SignalTable.of(kernel, np.eye(count), 1)
    field = FieldResponses(_GriddedField(kernel), table.shapes, np.eye(count), displacement_rows=None, force_n=1.0)  # type: ignore[arg-type]
    values, blocks = [], []
    basis = table.shapes.basis[0]
    for curve in curves:
        force = np.maximum(np.interp(travels, curve[:, 0], curve[:, 1]), LEAST_FORCE_N / 10)
        values.append(basis.T @ np.log(force / np.array(even)))
        blocks.append(basis.T @ (NOISE**2 * np.eye(count)) @ basis)
    presses = [scan.presses[index] for index in used]
    # modulus of the tissue and gain of the sensor alike, thickness as a shift that all share, and contact of each press
    slope = np.gradient(np.log(even), travels) if count > 1 else np.array([1 / travels[0]])
    level = basis.T @ np.ones(count)
    shared = [np.tile(np.hypot(prior.tissue_young_sd, FORCE_GAIN_SD) * level, len(used))]
    shared.append(np.tile(prior.thickness_sd * basis.T @ np.linspace(0.3, 1.0, count), len(used)))
    single = np.kron(np.eye(len(used)), (basis.T @ (CONTACT_SD_MM * slope))[:, None])
    columns = np.column_stack([*shared, single])
    return Observation(
        table=table,
        field=field,
        values=np.array(values),
        noise=scipy.linalg.block_diag(*blocks) + columns @ columns.T,
        white=np.array([np.diag(block) for block in blocks]),
        places_mm=np.array([press.place_mm for press in presses]),
        place_sd_mm=np.array([max(press.place_sd_mm, LEAST_PLACE_SD_MM) for press in presses]),
        angle=np.zeros(len(used)),
        force_n=np.ones(len(used)),
        reference=np.array([press.reference for press in presses]),
        radius_mm=max(scan.indenter.radius_mm, 6.0),
        index=np.array(used),
        left_out=tuple(left_out),
        scale_kpa=1.0,
    )

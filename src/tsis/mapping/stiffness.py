"""Presses of a rigid ball or punch without image: pairs of travel and force as relative stiffness, and its kernel.

The force at one travel changes with the modulus of a small volume in proportion to the energy of the strain there. A
ball is a punch whose radius of contact grows with the travel: its force is the integral of the punches' stiffness, so
that several travels of one press tell of several depths.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.mapping.observation import LEAST_PLACE_SD_MM, Observation, require_places
from tsis.mapping.prior import THICKNESS_MM, TISSUE_KPA, MapPrior
from tsis.mapping.scan import LEAST_FORCE_N, Indenter, first_few
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
    at_any_force,
)
from tsis.mechanics.tissue_field import FieldMesh, FieldResponse, TissueFieldResponse
from tsis.model.probe import Layer, Probe
from tsis.model.require import require_number

if TYPE_CHECKING:
    from tsis.mapping.scan import Scan
    from tsis.mapping.signals import Floats

LEVELS = 3  # depths of a ball that count
RADII = 6  # of contact up to the largest
NOISE = 0.01  # of the force, beside what the curve shows
FORCE_GAIN_SD = 0.02  # of all forces
CONTACT_SD_MM, LEAST_CONTACT_SD_MM = 0.05, 0.01  # of the travel at contact: where it is not fitted, and at the least
LEAST_FITTED, MOST_FITTED = 6, 400  # points that the travel at contact is fitted to
FORCE_ZERO_SD_N = 0.02
SHAPE_SD = 0.1  # how much the stiffness of a press may change from its first depth to its last
MEASURED_TISSUE_SD = 0.3  # relative, of a modulus that the presses tell
PRESS_SD = 0.05  # from press to press at one place, where few presses tell nothing of it
LEAST_REPEATS, LEAST_NEIGHBOURS, SAME_PLACE_MM = 3, 9, 0.5
SHALLOWEST_SHARE = 0.3  # of the median depth: a press that ends higher is left out
MOST_CONTACT_SHARE = 0.3  # of a press's depth, for the sd of its contact
SOLVED_KPA = 5.0  # modulus of the tissue on which punches are solved
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Punches:
    """Punches of the radii of contact that an indenter has down to a depth, on even tissue."""

    indenter: Indenter
    deepest_mm: float
    radii_mm: Floats
    stiffness: Floats  # N per mm
    share: Floats  # relative change of each stiffness a mm**3 of stiffer tissue, (radii, distances, depths)
    distance_mm: Floats
    depth_mm: Floats

    def local(self, depth_mm: Floats) -> tuple[Floats, Floats]:
        """Stiffness in N per mm at depths of the indenter, and the shares of the punches in it, (radii, depths)."""
        radii = self.radii_mm
        if self.indenter.shape == "punch":
            return np.full(depth_mm.shape, self.stiffness[0]), np.ones((1, *depth_mm.shape))
        at = np.minimum(np.sqrt(self.indenter.radius_mm * depth_mm), self.indenter.radius_mm)
        local = np.interp(at, radii, self.stiffness) * np.minimum(at / radii[0], 1.0)
        return local, np.array([np.interp(at, radii, row) for row in np.eye(len(radii))])

    def forces(self, depth_mm: Floats) -> Floats:
        """Force in N at each depth in mm, the integral of the stiffness."""
        steps = (np.arange(40) + 0.5) / 40 * depth_mm[:, None]
        return np.asarray(self.local(steps)[0].mean(axis=1) * depth_mm)


def _punches(indenter: Indenter, deepest_mm: float, tissue: tuple[float, float, float]) -> _Punches:
    """Punches on even tissue, solved once for all moduli: a rigid punch's stiffness is proportional to the tissue's."""
    young, thickness, poisson = tissue
    solved = _solved_punches(indenter, deepest_mm, thickness, poisson)
    return replace(solved, stiffness=young / SOLVED_KPA * solved.stiffness)


@lru_cache(maxsize=4)
def _solved_punches(indenter: Indenter, deepest_mm: float, thickness_mm: float, poisson: float) -> _Punches:
    if indenter.shape == "punch":
        radii = np.array([indenter.radius_mm])
    else:
        radii = np.linspace(0.25, 1.0, RADII) * min(np.sqrt(indenter.radius_mm * deepest_mm), indenter.radius_mm)
        radii = np.unique(np.maximum(radii, 1.0))
    distance = np.arange(0.0, indenter.radius_mm + REACH_MM + STEP_MM / 2, STEP_MM)
    depth = np.arange(SHALLOWEST_MM, 0.98 * thickness_mm, STEP_MM)
    grids, stiffness = [], []
    for radius in radii.tolist():
        slab = _punch(radius, (SOLVED_KPA, thickness_mm, poisson))
        change = slab.stiffness_change()
        plain = slab.response(0)
        grids.append(_gridded(plain, change / plain.volume_mm3, distance, depth))
        stiffness.append(1 / slab.travel_per_newton())
    return _Punches(
        indenter=indenter,
        deepest_mm=deepest_mm,
        radii_mm=radii,
        stiffness=np.array(stiffness),
        share=np.array(grids),
        distance_mm=distance,
        depth_mm=depth,
    )


@lru_cache(maxsize=4)
def stiffness_kernel(
    indenter: Indenter,
    travels_mm: tuple[float, ...],
    tissue: tuple[float, float, float],
    deepest_mm: float | None = None,
) -> tuple[LumpKernel, tuple[float, ...]]:
    """Kernel of the logarithm of the force at each travel, and these forces in N on even tissue.

    ``tissue`` is modulus in kPa, thickness in mm and Poisson's ratio; punches are solved down to ``deepest_mm``, the
    last travel by default. The kernel's ``pressure_kpa`` has a row a travel.
    """
    punches = _punches(indenter, travels_mm[-1] if deepest_mm is None else deepest_mm, tissue)
    rows = []
    for travel in travels_mm:
        local, weight = punches.local((np.arange(40) + 0.5) / 40 * travel)
        rows.append(np.tensordot((weight * local).sum(axis=1) / local.sum(), punches.share, axes=1))
    forces = tuple(punches.forces(np.array(travels_mm)).tolist())
    distance, depth = punches.distance_mm, punches.depth_mm
    pressure = np.zeros((2, 1, len(travels_mm), len(distance), len(depth)))
    pressure[0, 0] = np.array(rows)
    kernel = LumpKernel(
        radius_mm=np.arange(float(len(travels_mm))),
        distance_mm=distance,
        depth_mm=depth,
        pressure_kpa=pressure,
        face_displacement_mm=np.zeros_like(pressure),
        **at_any_force(np.zeros((2, len(EXACT_DIAMETERS), len(EXACT_TOPS), len(EXACT_CONTRASTS)))),
        poisson=tissue[2],
        thickness_mm=tissue[1],
    )
    return kernel, forces


def _gridded(response: FieldResponse, density: Floats, distance: Floats, depth: Floats) -> Floats:
    r, z = np.unique(response.radius_mm.round(9)), np.unique(response.depth_mm.round(9))
    table = np.zeros((len(r), len(z)))
    table[np.searchsorted(r, response.radius_mm.round(9)), np.searchsorted(z, response.depth_mm.round(9))] = density
    points = np.stack(np.meshgrid(distance, depth, indexing="ij"), axis=-1)
    points[..., 0], points[..., 1] = np.clip(points[..., 0], r[0], r[-1]), np.clip(points[..., 1], z[0], z[-1])
    return np.asarray(scipy.interpolate.RegularGridInterpolator((r, z), table)(points))


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """One press after its contact was found.

    Attributes
    ----------
    depth_mm, force_n
        The curve from the travel and the force at contact on.
    contact_sd_mm
        Standard deviation of the travel at contact.
    noise_n
        Standard deviation of a force.
    """

    depth_mm: Floats
    force_n: Floats
    contact_sd_mm: float
    noise_n: float


def _thinned(curve: Floats) -> Floats:
    """A curve of at most `MOST_FITTED` points, each the mean of its neighbours."""
    if len(curve) <= MOST_FITTED:
        return curve
    edges = np.linspace(0, len(curve), MOST_FITTED + 1).astype(int)
    return np.asarray(np.add.reduceat(curve, edges[:-1]) / np.diff(edges)[:, None])


def _is_short(curve: Floats) -> bool:
    """Whether too few points show a force for a fit of the contact."""
    return bool((curve[:, 1] > 0.05 * curve[:, 1].max()).sum() < LEAST_FITTED)


def find_touch(curve: Floats, even: _Punches, zero_sd_n: float) -> Touch:
    """The travel at contact, fitted together with the force's zero to a press of a stiffness that changes with depth.

    ``curve`` has pairs of travel and force, shape (n, 2). A curve of few points begins at the last that shows no force,
    or at travel 0. ``zero_sd_n`` is the standard deviation of the force's zero in N.
    """
    travel, force = curve[:, 0], curve[:, 1]
    top = float(force.max())
    if _is_short(curve):
        free = travel[force <= 0.05 * top]
        start = float(free[-1]) if len(free) else min(float(travel[0]), 0.0)
        return Touch(depth_mm=travel - start, force_n=force, contact_sd_mm=CONTACT_SD_MM, noise_n=0.0)
    reach = float(np.ptp(travel))
    starts = travel[0] + reach * np.linspace(-0.1, 0.9, 201)
    grid = np.linspace(0.0, 1.1 * reach, 300)
    on_grid = even.forces(grid)
    misfits, zeros = np.empty(len(starts)), np.empty(len(starts))
    assumed_noise = 0.01 * top
    for place, start in enumerate(starts):
        depth = np.maximum(travel - start, 0.0)
        plain = np.interp(depth, grid, on_grid)
        columns = np.column_stack([plain, plain * depth / reach, np.ones(len(depth))])
        level = max(top / max(float(plain.max()), 1e-12), 1e-12)
        weight = assumed_noise * np.diag([0.0, 1 / (SHAPE_SD * level), 1 / zero_sd_n])
        solution = np.linalg.lstsq(np.vstack([columns, weight]), np.append(force, np.zeros(3)), rcond=None)[0]
        residual = np.append(force - columns @ solution, weight @ solution)
        misfits[place], zeros[place] = residual @ residual, solution[2]
    noise = max(float(np.sqrt(misfits.min() / max(len(travel) - 3, 1))), 1e-4 * top)
    chance = np.exp(-0.5 * (misfits - misfits.min()) / noise**2)
    chance /= chance.sum()
    start = float(chance @ starts)
    sd = float(np.sqrt(chance @ (starts - start) ** 2 + (starts[1] - starts[0]) ** 2 / 12))
    return Touch(
        depth_mm=travel - start,
        force_n=force - float(chance @ zeros),
        contact_sd_mm=max(sd, LEAST_CONTACT_SD_MM),
        noise_n=noise,
    )


def _levels(touch: Touch, depths_mm: Floats, even: _Punches) -> tuple[Floats, Floats]:
    """Logarithms of the force over that on even tissue at some depths, and their covariance by noise."""
    inside = (touch.depth_mm > 0.3 * depths_mm[0]) & (touch.depth_mm <= 1.05 * depths_mm[-1])
    depth, force = touch.depth_mm[inside], touch.force_n[inside]
    hats = np.column_stack([np.interp(depth, depths_mm, row) for row in np.eye(len(depths_mm))])
    columns = hats * even.forces(depth)[:, None]
    size = float(even.forces(depths_mm[-1:])[0])
    smooth = 1e-2 * size * np.diff(np.eye(len(depths_mm)), axis=0)  # joins depths between which no point lies
    rows = np.vstack([columns, smooth])
    ratio = np.linalg.lstsq(rows, np.append(force, np.zeros(len(smooth))), rcond=None)[0]
    ratio = np.maximum(ratio, 1e-3 * max(float(ratio.max()), 1e-9))
    covariance = touch.noise_n**2 * np.linalg.pinv(rows.T @ rows)
    return np.log(ratio), covariance / np.outer(ratio, ratio) + NOISE**2 * np.eye(len(ratio))


def _press_sd(places: Floats, mean: Floats, contact_sd: Floats) -> float:
    """Standard deviation of the logarithm of a press's force from press to press.

    Places pressed again tell it. Without them the median difference of neighbours bounds it: lumps lie between few
    neighbours, uneven tissue between all. ``mean`` and ``contact_sd`` are of each press: the mean logarithm, and the
    part that its contact moves it by.
    """
    apart = np.hypot(*(places[:, None] - places).T)
    same = apart <= SAME_PLACE_MM
    first = [number for number in range(len(places)) if not same[number, :number].any()]
    squares = sum(float(np.square(mean[same[number]] - mean[same[number]].mean()).sum()) for number in first)
    repeats = len(places) - len(first)
    if repeats >= LEAST_REPEATS:
        variance = squares / repeats
    elif len(places) >= LEAST_NEIGHBOURS:
        np.fill_diagonal(apart, np.inf)
        differences = np.abs(mean - mean[np.argmin(apart, axis=1)])
        variance = float(np.median(differences) / 0.6745) ** 2 / 2
    else:
        return PRESS_SD
    return float(np.sqrt(max(variance - np.square(contact_sd).mean(), NOISE**2)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Touches:
    """The presses of a scan of an indenter, each from its contact on.

    Attributes
    ----------
    index
        Of each used press in the scan.
    left_out
        A sentence for each press that is not used.
    touches
        One a used press.
    depths_mm
        At which all are compared.
    """

    index: tuple[int, ...]
    left_out: tuple[str, ...]
    touches: tuple[Touch, ...]
    depths_mm: tuple[float, ...]
    even: _Punches


def read_touches(scan: Scan, prior: MapPrior) -> Touches:
    """Find the contact of each press of an indenter; presses without one, or too shallow, are named."""
    if scan.indenter is None:
        raise AssertionError("a scan of pairs has an indenter")
    left_out, used = list(scan.left_out), []
    names = [press.name or f"press {index + 1}" for index, press in enumerate(scan.presses)]
    for index, press in enumerate(scan.presses):
        curve = press.travel_force
        if curve is None or len(curve) < 2 or curve[:, 1].max() < LEAST_FORCE_N:
            left_out.append(f"{names[index]} has no contact.")
        else:
            used.append(index)
    curves = [_thinned(np.asarray(scan.presses[index].travel_force)) for index in used]
    reaches = [float(curve[-1, 0] - (min(curve[0, 0], 0.0) if _is_short(curve) else curve[0, 0])) for curve in curves]
    if max(reaches, default=0.0) <= 0:
        raise InputError(
            f"travel_force must hold presses with contact, from {LEAST_FORCE_N:g} N on, over some travel: "
            f"{first_few(left_out) or 'none has any travel'}"
        )
    tissue = (prior.tissue_young_kpa, prior.thickness_mm, prior.poisson)
    even = _punches(scan.indenter, float(np.ceil(11 * max(reaches))) / 10, tissue)
    zero_sd = min(FORCE_ZERO_SD_N, 0.1 * float(np.median([curve[:, 1].max() for curve in curves])))
    touches = [find_touch(curve, even, zero_sd) for curve in curves]
    ends = np.array([touch.depth_mm[-1] for touch in touches])
    sure = np.array([touch.contact_sd_mm for touch in touches]) < MOST_CONTACT_SHARE * ends
    deep = sure & (ends >= SHALLOWEST_SHARE * np.median(ends))
    for index, touch, known in zip(np.array(used)[~deep], np.array(touches)[~deep], sure[~deep], strict=True):
        depth, sd = f"{touch.depth_mm[-1]:.2g} mm", f"{touch.contact_sd_mm:.2g} mm"
        left_out.append(
            f"{names[index]} enters {depth}, too little beside the others."
            if known
            else f"{names[index]} has no clear contact (depth {depth}, sd {sd}): tare the force, begin above the skin."
        )
    kept = np.flatnonzero(deep)
    require_places([scan.presses[used[place]].place_mm for place in kept], scan.indenter.radius_mm, left_out)
    count = 1 if scan.indenter.shape == "punch" else LEVELS
    return Touches(
        index=tuple(used[place] for place in kept),
        left_out=tuple(left_out),
        touches=tuple(touches[place] for place in kept),
        depths_mm=tuple((float(ends[kept].min()) * np.linspace(1 / count, 1.0, count)).tolist()),
        even=even,
    )


def suited_prior(
    scan: Scan,
    *,
    tissue_young_kpa: float | None = None,
    tissue_young_sd: float | None = None,
    thickness_mm: float | None = None,
) -> MapPrior:
    """The prior with what is given of the tissue; without its modulus, that of an indenter's median press.

    Lumps under fewer than half of the presses do not move the median. `InputError` as `MapPrior` and `estimate_map`.
    """
    stated: dict[str, Any] = {
        "tissue_young_kpa": tissue_young_kpa,
        "tissue_young_sd": tissue_young_sd,
        "thickness_mm": thickness_mm,
    }
    known = {name: value for name, value in stated.items() if value is not None}
    if thickness_mm is not None:
        require_number("thickness_mm", thickness_mm, *THICKNESS_MM, hint="millimetres")
        top, bottom = MapPrior().depth_mm
        known["depth_mm"] = (top, min(bottom, thickness_mm))
    prior = MapPrior(**known)
    if tissue_young_kpa is not None or scan.kind != "travel_force":
        return prior
    read = read_touches(scan, prior)
    depths = np.array(read.depths_mm)
    last = [_levels(touch, depths, read.even)[0][-1] for touch in read.touches]
    young = float(prior.tissue_young_kpa * np.exp(np.median(last)))
    softest, stiffest = TISSUE_KPA
    if not softest <= young <= stiffest:
        raise InputError(
            f"travel_force must be of tissue of {softest:g} to {stiffest:g} kPa; the median press amounts to "
            f"{young:.3g} kPa: check the units (mm, N) and the zero of the force, and the radius of the indenter"
        )
    return replace(prior, tissue_young_kpa=young, tissue_young_sd=tissue_young_sd or MEASURED_TISSUE_SD)


def observe_stiffness(scan: Scan, prior: MapPrior) -> Observation:
    """Numbers of presses of an indenter: logarithms of the force at a few depths over those on even tissue."""
    read = read_touches(scan, prior)
    assert scan.indenter is not None
    depths, count = np.array(read.depths_mm), len(read.depths_mm)
    tissue = (prior.tissue_young_kpa, prior.thickness_mm, prior.poisson)
    kernel, _ = stiffness_kernel(scan.indenter, read.depths_mm, tissue, read.even.deepest_mm)
    table = SignalTable.of(kernel, np.eye(count), 1)
    field = FieldResponses(_GriddedField(kernel), table.shapes, np.eye(count), displacement_rows=None, force_n=1.0)  # type: ignore[arg-type]
    basis = table.shapes.basis[0]
    levels = [_levels(touch, depths, read.even) for touch in read.touches]
    blocks = [basis.T @ covariance @ basis for _, covariance in levels]
    presses = [scan.presses[index] for index in read.index]
    places = np.array([press.place_mm for press in presses])
    # modulus of the tissue and gain of the sensor alike, thickness as a shift that all share, and the contact and the
    # repeatability of each press
    slope = np.log(read.even.forces(1.01 * depths) / read.even.forces(0.99 * depths)) / (0.02 * depths)
    level = basis.T @ np.ones(count)
    contacts = np.array([touch.contact_sd_mm for touch in read.touches])
    press_sd = _press_sd(places, np.array([values.mean() for values, _ in levels]), contacts * slope.mean())
    shared = np.column_stack(
        [
            np.hypot(prior.tissue_young_sd, FORCE_GAIN_SD) * level,
            prior.thickness_sd * basis.T @ np.linspace(0.3, 1.0, count),
        ]
    )
    single = np.array([np.column_stack([sd * (basis.T @ slope), press_sd * level]) for sd in contacts])
    own = np.array(blocks) + single @ single.swapaxes(1, 2)
    return Observation(
        table=table,
        field=field,
        values=np.array([basis.T @ values for values, _ in levels]),
        own=own,
        shared=np.repeat(shared[None], len(presses), axis=0),
        white=np.array([np.diag(block) for block in own]),
        places_mm=places,
        place_sd_mm=np.array([max(press.place_sd_mm, LEAST_PLACE_SD_MM) for press in presses]),
        angle=np.zeros(len(presses)),
        force_n=np.ones(len(presses)),
        reference=np.array([press.reference for press in presses]),
        radius_mm=max(scan.indenter.radius_mm, 6.0),
        index=np.array(read.index),
        left_out=read.left_out,
        scale_kpa=1.0,
        strain_error=np.zeros(len(presses)),
    )

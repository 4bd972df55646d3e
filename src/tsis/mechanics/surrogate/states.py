"""Presses on slabs of one thickness as rows of numbers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy

from tsis.errors import InputError, MechanicsError
from tsis.mechanics.finite_strain.neo_hookean_press import PressContinuation, SlabPress, press_finite, press_pairs
from tsis.mechanics.finite_strain.patches import NARROW, FiniteResolution
from tsis.mechanics.mesh import block_radius_mm, central_cell_mm, hat_areas, hats
from tsis.mechanics.small_strain.linear_press import PressKernel, strain_problem
from tsis.mechanics.small_strain.slab import Resolution
from tsis.mechanics.surrogate.polynomial import Box, contrast_from_factor, signal_scale
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.mechanics.finite_strain.neo_hookean_press import SolvedPress
    from tsis.mechanics.mesh import Floats
    from tsis.mechanics.small_strain.linear_press import FacePress
    from tsis.mechanics.surrogate.finite_correction import CorrectionBox
    from tsis.model.press import PressField
    from tsis.model.probe import Probe


if TYPE_CHECKING:
    RowOfPress = Callable[[PressKernel, float, Floats | None], Floats]

BOTTOM = 0.97  # of the thickness: the deepest point of a sphere
TOUR_WEIGHTS = np.array([0.6, 0.6, 0.2, 1.0, 1.0, 1.5])  # of the coordinates, for the length of a step
TOUR_ROUNDS = 30
FACE_POINTS = 121  # of each profile, which is linear between them
OUTPUTS = 2 * FACE_POINTS  # pressures and displacements
PRESS_OUTPUTS = OUTPUTS + 1  # and the approach


class Slabs(Protocol):
    """Slabs of one thickness; `rows_at_force` and `full_contact_rows` define the outputs of a row."""

    def without_inclusion(self, tissues: list[float]) -> Floats:
        """Rows of tissue of each modulus in kPa, shape (tissues, outputs)."""

    def changes(self, sphere: tuple[float, float], factors: Floats, tissues: list[float]) -> Floats:
        """Signal of a sphere (diameter, depth) over its `signal_scale`, shape (factors, tissues, outputs)."""


def slabs_of(
    probe: Probe, box: Box, force_n: float, strain: str, resolution: Resolution | FiniteResolution | None
) -> tuple[Callable[[float], Slabs], Resolution | FiniteResolution]:
    """Function from a thickness in mm to slabs, and its mesh density."""
    if strain == "small":
        coarse = Resolution() if resolution is None else resolution
        if isinstance(coarse, Resolution):
            return partial(SmallStrainSlabs, probe, box, coarse, rows_at_force(force_n)), coarse
    elif strain == "finite":
        fine = FiniteResolution() if resolution is None else resolution
        if isinstance(fine, FiniteResolution):
            return lambda thickness: FiniteStrainSlabs(probe, box, force_n, fine, thickness), fine
    else:
        raise InputError(f"strain must be 'small' or 'finite'; got {strain!r}")
    raise InputError(f"resolution must suit strain {strain!r}; got a {type(resolution).__name__}")


class SmallStrainSlabs:
    """Slabs with one condensed probe and far tissue.

    ``row`` computes a row from a tissue's modulus in kPa and the change of its compliance by an inclusion, or None.
    """

    def __init__(self, probe: Probe, box: Box, resolution: Resolution, row: RowOfPress, thickness_mm: float) -> None:
        diameter, depth = box.diameter_mm[0], box.depth_mm[0]
        self._row = row
        self._kernel = PressKernel(
            probe,
            thickness_mm=thickness_mm,
            poisson=box.poisson,
            block_mm=block_radius_mm(probe, box.thickness_mm[0], box.diameter_mm[1]),
            central_mm=central_cell_mm(diameter, depth, depth + diameter / 2),
            resolution=resolution,
            points=FACE_POINTS,
        )

    def without_inclusion(self, tissues: list[float]) -> Floats:
        """See `Slabs`."""
        return np.array([self._row(self._kernel, tissue, None) for tissue in tissues])

    def changes(self, sphere: tuple[float, float], factors: Floats, tissues: list[float]) -> Floats:
        """See `Slabs`."""
        diameter, depth = sphere
        slab = self._kernel.slab(diameter_mm=diameter, depth_mm=depth, poisson=self._kernel.poisson)
        reference, rows = self.without_inclusion(tissues), []
        for factor in factors:
            change = slab.change(float(contrast_from_factor(factor)))
            pressed = [self._row(self._kernel, tissue, change) for tissue in tissues]
            rows.append((np.array(pressed) - reference) / signal_scale(diameter, depth, factor))
        return np.array(rows)


def rows_at_force(force_n: float) -> RowOfPress:
    """Rows of presses at one force: pressures, displacements, approach."""

    def row(kernel: PressKernel, tissue: float, change: Floats | None) -> Floats:
        result = kernel.press(tissue, force_n * MN_PER_N, change)
        problem = None if change is not None else strain_problem(result.approach_mm, kernel.probe, kernel.thickness_mm)
        if problem is not None:
            raise MechanicsError(f"{problem}: choose a smaller force_n, stiffer tissue_young_kpa, or strain='finite'")
        return _row(result)

    return row


def full_contact_rows(kernel: PressKernel, tissue: float, change: Floats | None) -> Floats:
    """Row of all presses that cover the face: unit; of a dome also shape and covering force."""
    result = kernel.covering(tissue, change)
    if result.shape is None:
        return _row(result.unit)
    return np.concatenate([_row(result.unit), _row(result.shape), [result.force_n]])


class FiniteStrainSlabs:
    """Slabs at finite strain, one load path each; seconds a press."""

    def __init__(
        self, probe: Probe, box: Box, force_n: float, resolution: FiniteResolution, thickness_mm: float
    ) -> None:
        self._probe, self._force_n, self._resolution = probe, force_n, resolution
        self._thickness_mm, self._poisson = thickness_mm, box.poisson

    def without_inclusion(self, tissues: list[float]) -> Floats:
        """See `Slabs`."""
        press = partial(press_finite, self._probe, force_n=self._force_n, resolution=self._resolution)
        return np.array([row_of_field(press(self._phantom(tissue, None))) for tissue in tissues])

    def changes(self, sphere: tuple[float, float], factors: Floats, tissues: list[float]) -> Floats:
        """See `Slabs`."""
        return np.array([[self._change(sphere, float(factor), tissue) for tissue in tissues] for factor in factors])

    def _change(self, sphere: tuple[float, float], factor: float, tissue: float) -> Floats:
        diameter, depth = sphere
        inclusion = Inclusion(
            diameter_mm=diameter,
            depth_mm=depth,
            young_kpa=float(contrast_from_factor(factor)) * tissue,
            poisson=self._poisson,
        )
        ((with_it, without),) = press_pairs(
            self._probe, self._phantom(tissue, inclusion), forces_n=(self._force_n,), resolution=self._resolution
        )
        return (row_of_field(with_it) - row_of_field(without)) / float(signal_scale(diameter, depth, factor))

    def _phantom(self, tissue: float, inclusion: Inclusion | None) -> Phantom:
        return Phantom(young_kpa=tissue, thickness_mm=self._thickness_mm, poisson=self._poisson, inclusion=inclusion)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlabPresses:
    """Presses of one probe on slabs of many states, by both models."""

    probe: Probe
    box: CorrectionBox
    poisson: float
    narrow: PressContinuation  # for no sphere and spheres to `narrow_mm`
    wide: PressContinuation

    @classmethod
    def of(cls, probe: Probe, box: CorrectionBox, poisson: float, mesh: FiniteResolution | None = None) -> SlabPresses:
        """Presses on slabs of a box."""
        fine = mesh or FiniteResolution()
        continuations = []
        for diameter in (narrow_mm(probe, box), box.diameter_mm[1]):
            sphere = Inclusion(diameter_mm=diameter, depth_mm=1.0, young_kpa=1.0)
            thickness = max(30.0, diameter + 2, 0.6 * box.thickness_mm[1])
            like = Phantom(young_kpa=1.0, poisson=poisson, thickness_mm=thickness, inclusion=sphere)
            continuations.append(PressContinuation(probe, like, fine))
        narrow, wide = continuations
        return cls(probe=probe, box=box, poisson=poisson, narrow=narrow, wide=wide)

    def on(self, diameter_mm: float) -> PressContinuation:
        """Presses on a mesh that suits a sphere."""
        return self.narrow if diameter_mm <= narrow_mm(self.probe, self.box) else self.wide

    def small(
        self, tissue: float, thickness: float, sphere: tuple[float, float, float] | None
    ) -> tuple[Floats, Floats]:
        """Rows of `full_contact_rows` at small strain: without inclusion, and the signal over its scale."""
        slabs = SmallStrainSlabs(self.probe, self._mesh_box, Resolution(), full_contact_rows, thickness)
        without = slabs.without_inclusion([tissue])[0]
        if sphere is None:
            return without, np.zeros_like(without)
        diameter, depth, factor = sphere
        return without, slabs.changes((diameter, depth), np.array([factor]), [tissue])[0, 0]

    @property
    def _mesh_box(self) -> Box:
        """Ranges that all small-strain meshes of a build suit, those of an estimate's surrogate for this box."""
        ranges = self.box
        thinnest = max(ranges.thickness_mm[0], 1.01 * (ranges.diameter_mm[1] + ranges.depth_mm[1]))
        return Box(
            diameter_mm=ranges.diameter_mm,
            depth_mm=ranges.depth_mm,
            tissue_young_kpa=ranges.tissue_young_kpa,
            thickness_mm=(thinnest, max(1.01 * thinnest, ranges.thickness_mm[1])),
            poisson=self.poisson,
        )

    def unit_force_n(self, tissue: float, without: Floats) -> float:
        """Force of a unit load; ``without`` is the row at small strain."""
        if self.probe.face_curvature_mm is None:
            return tissue * self.probe.radius_mm**2 / MN_PER_N
        return float(without[-1])

    def at_force(self, row: Floats, force_n: float) -> Floats:
        """Pressures and displacements at small strain under a force."""
        pressed = force_n * row[:OUTPUTS]
        return pressed if len(row) == PRESS_OUTPUTS else pressed + row[PRESS_OUTPUTS : PRESS_OUTPUTS + OUTPUTS]

    def press(
        self, start: SolvedPress | None, state: tuple[float, float, float], sphere: tuple[float, float]
    ) -> SolvedPress:
        """The press without contrast on the mesh of a sphere; state: modulus in kPa, thickness in mm, force in N."""
        tissue, thickness, force = state
        target = SlabPress.on_sphere(
            diameter_mm=sphere[0],
            depth_mm=sphere[1],
            contrast=1.0,
            tissue_young_kpa=tissue,
            thickness_mm=thickness,
            force_n=force,
            poisson=self.poisson,
        )
        continuation = self.on(sphere[0])
        return continuation.first(target) if start is None else continuation.follow(start, target)


def narrow_mm(probe: Probe, box: CorrectionBox) -> float:
    """Diameter of the widest sphere whose mesh leaves the tissue under the rim alone."""
    return min(box.diameter_mm[1], NARROW * probe.radius_mm)


def _row(press: FacePress) -> Floats:
    return np.concatenate([press.pressure_kpa, press.face_displacement_mm, [press.approach_mm]])


def row_of_field(field: PressField) -> Floats:
    """A row at fewer radii; each pressure is a mean of means, so that they sum up to the force."""
    fine = field.radius_mm
    coarse = np.linspace(0.0, fine[-1], FACE_POINTS)
    weight = hats(coarse, fine) * hat_areas(fine)[:, None]
    pressure = field.pressure_kpa @ weight / weight.sum(axis=0)
    displacement = np.interp(coarse, fine, field.face_displacement_mm)
    return np.concatenate([pressure, displacement, [field.approach_mm]])


def design(box: CorrectionBox, count: int, seed: int) -> Floats:
    """States of a box in the order of a short tour: diameter, depth, contrast factor, tissue, thickness, load; (n, 6).

    Spheres that would reach below 0.97 of the thickness are left out.
    """
    unit = scipy.stats.qmc.Sobol(6, seed=seed).random_base2(int(np.ceil(np.log2(count))) + 2)
    low, high = box.coordinates
    states = low + unit * (high - low)
    states[:, 3:5] = np.exp(states[:, 3:5])
    # Even in the roots of diameter and depth: the largest signals are those of large spheres.
    for axis, ends in enumerate((box.diameter_mm, box.depth_mm)):
        first, last = np.sqrt(ends)
        states[:, axis] = (first + unit[:, axis] * (last - first)) ** 2
    states[:, 5] = box.load[0] + unit[:, 5] * (box.largest_load(states[:, 3]) - box.load[0])
    fitting = np.flatnonzero(states[:, 0] + states[:, 1] <= BOTTOM * states[:, 4])[:count]
    ordered: Floats = states[fitting[_tour(unit[fitting] * TOUR_WEIGHTS)]]
    return ordered


def _tour(places: Floats) -> list[int]:
    """A short open tour: the nearest next, then reversals of parts that shorten it."""
    distance = np.linalg.norm(places[:, None] - places, axis=2)
    left, tour = set(range(1, len(places))), [0]
    while left:
        tour.append(min(left, key=lambda other: float(distance[tour[-1], other])))
        left.remove(tour[-1])
    order = np.array(tour)
    for _ in range(TOUR_ROUNDS):
        shorter = False
        for first in range(1, len(order) - 2):
            ends, afters = order[first:-1], order[first + 1 :]
            before = order[first - 1]
            gain = distance[before, order[first]] + distance[ends, afters]
            gain = gain - distance[before, ends] - distance[order[first], afters]
            best = int(gain.argmax())
            if gain[best] > 1e-9:
                order[first : first + best + 1] = order[first : first + best + 1][::-1].copy()
                shorter = True
        if not shorter:
            break
    return [int(index) for index in order]

"""A domed probe on a slab at finite strain with NGSolve, in sliding contact through a spline between the two bodies.

Axisymmetric triangles around two bodies that share nothing; neo-Hookean energy
mu/2 (I1 - 3 - 2 ln J) + lambda/2 ln^2 J.
The contact is a third body without stiffness: an even cubic spline ``rho(theta)`` in polar coordinates around a point
on the axis above the face. The face pulls it along by a two-sided spring, the skin presses on it by a one-sided spring;
both springs are radial and so stiff that they change nothing that is read. Gaps are explicit functions of the unknowns:
no closest points, no kinks, and one energy whose Newton steps a line search shortens.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.peers.ngsolve_dome_mesh import BoundaryPoints, ContactSpline, Outline, meshed
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.linalg import splu

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from benchmarks.peers.ngsolve_dome_mesh import Fineness
    from numpy.typing import NDArray

    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe

    Floats = NDArray[np.float64]

TOUCH_MM = 0.25  # travel of the first touch
ROUNDS = 25
EXACT = 1e-9  # of the energy: decrease at which Newton's method ends
LOOSE = 1e-4  # bends the spline where no point of the face holds it, mm^2
HAT_MM = 0.5  # pressures are means with the weight max(0, 1 - |r' - r| / HAT_MM)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reading:
    """A press, read over the undeformed radii that were asked for."""

    approach_mm: float
    displacement_mm: Floats  # of the face towards the glass
    pressure_kpa: Floats  # axial force per undeformed area, means over hats
    force_mn: float  # sum of the axial forces on the face


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Side:
    """One surface that touches the spline: its points and the matrices from all unknowns to their displacements."""

    points: BoundaryPoints
    radial: Any
    axial: Any
    one_sided: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gap:
    """Gaps of a side's points and their derivatives by the points' positions (r, z)."""

    value: Floats
    on: NDArray[np.bool]  # points that press
    slope: Floats  # (k, 2)
    bend: Floats  # second derivatives rr, rz, zz, (k, 3)
    turn: Floats  # derivative of the angle, (k, 2)
    functions: tuple[Floats, Floats]  # of the spline, and their derivatives by the angle


class DomedPress:
    """The unknowns: free displacements, the slab's travel towards the probe, and the spline's coefficients."""

    def __init__(self, probe: Probe, phantom: Phantom, fine: Fineness) -> None:
        self.ng = ng = importlib.import_module("ngsolve")
        self.probe, self.phantom, self.fine = probe, phantom, fine
        self.mesh = mesh = meshed(probe, phantom, fine)
        self.spline = ContactSpline(Outline(probe), fine)
        self.softness = fine.softness_mm / min(phantom.young_kpa, probe.layers[0].young_kpa)
        self.space = ng.VectorH1(mesh, order=fine.order, dirichletx="axis|glass|wall", dirichlety="glass|wall")
        self._field = ng.GridFunction(self.space)
        self._residual = self._field.vec.CreateVector()
        self._bodies()
        self._number()

    def _bodies(self) -> None:
        ng = self.ng
        material = {f"layer{i}": _lame(layer.young_kpa, layer.poisson) for i, layer in enumerate(self.probe.layers)}
        material["slab"] = _lame(self.phantom.young_kpa, self.phantom.poisson)
        self._ball = (ng.Parameter(material["slab"][0]), ng.Parameter(material["slab"][1]))
        first, shear = (
            self.mesh.MaterialCF({name: pair[i] for name, pair in material.items()} | {"ball": self._ball[i]})
            for i in (0, 1)
        )
        u = self.space.TrialFunction()
        gradient, hoop = ng.Grad(u) + ng.Id(2), 1 + u[0] / ng.x
        log = ng.log(ng.Det(gradient) * hoop)
        squares = ng.InnerProduct(gradient, gradient) + hoop * hoop
        energy = 2 * np.pi * ng.x * (shear / 2 * (squares - 3 - 2 * log) + first / 2 * log * log)
        self._form = ng.BilinearForm(self.space, symmetric=False)
        self._form += ng.Variation(energy.Compile() * ng.dx(bonus_intorder=2))

    def _number(self) -> None:
        ng, space, mesh = self.ng, self.space, self.mesh
        free = np.flatnonzero(np.array(list(space.FreeDofs()), dtype=bool))
        wall, slab = ng.GridFunction(space), ng.GridFunction(space)
        wall.Set(ng.CF((0, 1)), definedon=mesh.Boundaries("wall"))
        slab.Set(ng.CF((0, 1)), definedon=mesh.Materials("slab|ball"))
        moved = wall.vec.FV().NumPy()
        driven = np.flatnonzero(np.abs(moved) > 1e-12)
        self.travel, self.size = len(free), len(free) + 1 + self.spline.count
        columns = np.concatenate([np.arange(len(free)), np.full(len(driven), self.travel)])
        values = np.concatenate([np.ones(len(free)), moved[driven]])
        places = (np.concatenate([free, driven]), columns)
        self._spread = csc_array(coo_array((values, places), shape=(space.ndof, self.size)))
        self._lift = slab.vec.FV().NumPy()[free].copy()
        scalar = ng.H1(mesh, order=self.fine.order)
        self.sides = tuple(
            self._side(BoundaryPoints(ng, scalar, name, self.fine.order + 3), scalar.ndof, one_sided=name == "skin")
            for name in ("face", "skin")
        )

    def _side(self, points: BoundaryPoints, count: int, *, one_sided: bool) -> Side:
        radial, axial = (csr_array(points.matrix @ self._spread[i * count : (i + 1) * count]) for i in (0, 1))
        return Side(points=points, radial=radial, axial=axial, one_sided=one_sided)

    def contrast(self, young_kpa: float) -> None:
        """Give the ball a modulus."""
        for parameter, value in zip(self._ball, _lame(young_kpa, self.phantom.poisson), strict=True):
            parameter.Set(value)

    @cached_property
    def untouched(self) -> Floats:
        """The unknowns of undeformed bodies, the slab moved by `TOUCH_MM`."""
        unknowns = np.zeros(self.size)
        unknowns[: self.travel] = TOUCH_MM * self._lift
        unknowns[self.travel] = TOUCH_MM
        unknowns[self.travel + 1 :] = self.spline.start
        return unknowns

    def gap(self, unknowns: Floats, side: Side) -> Gap:
        """Distance from the spline along rays, positive where the skin is clear of it."""
        spread = side.points.where + np.stack([side.radial @ unknowns, side.axial @ unknowns], axis=1)
        r, q = spread[:, 0], self.spline.centre - spread[:, 1]
        distance, angle = self.spline.polar(r, spread[:, 1])
        inside, at = angle < self.spline.end, np.minimum(angle, self.spline.end)
        functions = [one(at) for one in self.spline.basis]
        level, rise, curve = (one @ unknowns[self.travel + 1 :] for one in functions)
        value = np.where(inside, distance - level, 0.0)
        turn = np.stack([q, r], axis=1) / distance[:, None] ** 2
        ray = np.stack([q * q, r * q, r * r], axis=1) / distance[:, None] ** 3
        twist = np.stack([-2 * r * q, q * q - r * r, 2 * r * q], axis=1) / distance[:, None] ** 4
        twice = np.stack([turn[:, 0] ** 2, turn[:, 0] * turn[:, 1], turn[:, 1] ** 2], axis=1)
        return Gap(
            value=value,
            on=inside & ((value < 0) | (not side.one_sided)),
            slope=np.stack([r, -q], axis=1) / distance[:, None] - rise[:, None] * turn,
            bend=ray - rise[:, None] * twist - curve[:, None] * twice,
            turn=turn,
            functions=(functions[0], functions[1]),
        )

    def energy(self, unknowns: Floats, force_mn: float) -> float:
        """Total energy in mN mm."""
        self._field.vec.FV().NumPy()[:] = self._spread @ unknowns
        total = float(self._form.Energy(self._field.vec)) - force_mn * float(unknowns[self.travel])
        for side in self.sides:
            gap = self.gap(unknowns, side)
            total += float(side.points.area[gap.on] @ gap.value[gap.on] ** 2) / 2 / self.softness
        bent = unknowns[self.travel + 1 :] - self.spline.start
        return total + LOOSE / self.softness / 2 * float(bent @ self.spline.bending @ bent)

    def linearised(self, unknowns: Floats) -> tuple[Floats, Any]:
        """Gradient and tangent of the energy of bodies and springs."""
        self._field.vec.FV().NumPy()[:] = self._spread @ unknowns
        self._form.Apply(self._field.vec, self._residual)
        self._form.AssembleLinearization(self._field.vec)
        rows, columns, values = self._form.mat.COO()
        count = self.space.ndof
        bulk = csr_array((np.array(values), (np.array(rows), np.array(columns))), shape=(count, count))
        gradient = self._spread.T @ self._residual.FV().NumPy()
        tangent = self._spread.T @ bulk @ self._spread
        for side in self.sides:
            forces, matrix = self._pressing(self.gap(unknowns, side), side)
            gradient, tangent = gradient + forces, tangent + matrix
        numbers = self.travel + 1 + np.arange(self.spline.count)
        bending = LOOSE / self.softness * self.spline.bending
        gradient[numbers] += bending @ (unknowns[numbers] - self.spline.start)
        places = (np.repeat(numbers, len(numbers)), np.tile(numbers, len(numbers)))
        return gradient, tangent + coo_array((bending.ravel(), places), shape=(self.size, self.size)).tocsr()

    def _pressing(self, gap: Gap, side: Side) -> tuple[Floats, Any]:
        on = np.flatnonzero(gap.on)
        radial, axial, area = side.radial[on], side.axial[on], side.points.area[on] / self.softness
        slope, turn, bend = gap.slope[on], gap.turn[on], gap.bend[on]
        by_all = _rows(radial, slope[:, 0]) + _rows(axial, slope[:, 1]) - self._of_spline(gap.functions[0][on])
        push = area * gap.value[on]
        mixed = _rows(radial, push * bend[:, 1]).T @ axial
        turned = (_rows(radial, push * turn[:, 0]) + _rows(axial, push * turn[:, 1])).T
        sliding = turned @ self._of_spline(gap.functions[1][on])
        matrix = _rows(by_all, area).T @ by_all + mixed + mixed.T - sliding - sliding.T
        matrix += _rows(radial, push * bend[:, 0]).T @ radial + _rows(axial, push * bend[:, 2]).T @ axial
        return by_all.T @ push, matrix

    def _of_spline(self, functions: Floats) -> Any:
        rows, columns = np.nonzero(functions)
        places = (rows, columns + self.travel + 1)
        return csr_array((functions[rows, columns], places), shape=(len(functions), self.size))

    def solve(self, unknowns: Floats, force_mn: float, *, held: bool = False) -> tuple[Floats, Any] | None:
        """Equilibrium and the factors of its tangent, or None; ``held`` fixes the travel instead of the force."""
        level = self.energy(unknowns, force_mn)
        for _ in range(ROUNDS):
            gradient, tangent = self.linearised(unknowns)
            gradient[self.travel] -= force_mn
            if held:
                gradient[self.travel] = 0.0
                stiff = coo_array(([1e9], ([self.travel], [self.travel])), shape=tangent.shape)
                tangent = tangent + stiff.tocsr()
            factors = splu(
                csc_array(tangent),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
            step = -factors.solve(gradient)
            decrease, part = -float(gradient @ step), 1.0
            while not (reached := self.energy(unknowns + part * step, force_mn)) <= level + 1e-9 * abs(level):
                part /= 2
                if part < 1e-3:
                    return None
            unknowns, level = unknowns + part * step, reached
            if part == 1.0 and abs(decrease) < EXACT * max(abs(level), 1e-3):
                return unknowns, factors
        return None

    def read(self, unknowns: Floats, radius_mm: Floats) -> Reading:
        """Fields of the face."""
        face = self.sides[0]
        gap, at = self.gap(unknowns, face), face.points.where[:, 0]
        axial = -face.points.area * gap.value / self.softness * gap.slope[:, 1]
        hats = np.maximum(0.0, 1 - np.abs(at - radius_mm[:, None]) / HAT_MM)
        order = np.argsort(at)
        return Reading(
            approach_mm=float(unknowns[self.travel]),
            displacement_mm=np.interp(radius_mm, at[order], (face.axial @ unknowns)[order]),
            pressure_kpa=(hats @ axial) / (hats @ face.points.level),
            force_mn=float(axial.sum()),
        )


def _rows(matrix: Any, factors: Floats) -> Any:
    return csr_array(matrix.multiply(factors[:, None]))


def _lame(young_kpa: float, poisson: float) -> tuple[float, float]:
    return young_kpa * poisson / (1 + poisson) / (1 - 2 * poisson), young_kpa / 2 / (1 + poisson)


class PressPath:
    """States of one mesh: first a touch, then growing forces on uniform tissue, at each force growing contrast."""

    def __init__(self, model: DomedPress, say: Callable[[str], object]) -> None:
        self.model, self._say = model, say
        model.contrast(model.phantom.young_kpa)
        start = model.solve(model.untouched, 0.0, held=True)
        if start is None:
            raise RuntimeError("the first touch does not converge")
        gradient, _ = model.linearised(start[0])
        self.force_mn = float(gradient[model.travel])
        at = model.solve(start[0], self.force_mn)
        if at is None:
            raise RuntimeError("the first force does not converge")
        self._state = at

    def readings(self, force_mn: float, radius_mm: Floats) -> tuple[Reading, Reading]:
        """Presses without and with the phantom's inclusion on this mesh."""
        self._raise(force_mn)
        return self.model.read(self._state[0], radius_mm), self.model.read(self._stiffened(), radius_mm)

    def _raise(self, force_mn: float) -> None:
        growth = 1.8
        unit = np.zeros(self.model.size)
        unit[self.model.travel] = 1.0
        while self.force_mn < force_mn:
            ahead = min(self.force_mn * growth, self.force_mn + force_mn / 4)
            ahead = force_mn if 1.05 * ahead > force_mn else ahead
            unknowns, factors = self._state
            rate, part = factors.solve(unit) * (ahead - self.force_mn), 1.0
            while not np.isfinite(self.model.energy(unknowns + part * rate, ahead)):
                part /= 2
            state = self.model.solve(unknowns + part * rate, ahead)
            growth = min(1.8, 1 + (growth - 1) * (1.5 if state else 0.5))
            if state is not None:
                self._state, self.force_mn = state, ahead
                self._say(f"{ahead:.0f} of {force_mn:.0f} mN")
            elif growth < 1.005:
                raise RuntimeError(f"no state beyond {self.force_mn:.1f} mN")

    def _stiffened(self) -> Floats:
        own = self.model.phantom.inclusion
        assert own is not None
        unknowns, young, growth = self._state[0], self.model.phantom.young_kpa, 2.5
        while young < own.young_kpa:
            ahead = min(young * growth, own.young_kpa)
            self.model.contrast(ahead)
            state = self.model.solve(unknowns, self.force_mn)
            growth = min(2.5, 1 + (growth - 1) * (1.5 if state else 0.5))
            if state is not None:
                unknowns, young = state[0], ahead
                self._say(f"{self.force_mn:.0f} mN, ball of {young:.3g} kPa")
            elif growth < 1.005:
                raise RuntimeError(f"no state beyond a ball of {young:.3g} kPa")
        self.model.contrast(self.model.phantom.young_kpa)
        return unknowns


def presses(
    probe: Probe,
    phantom: Phantom,
    forces_n: Sequence[float],
    radius_mm: Floats,
    fine: Fineness,
    say: Callable[[str], object] = lambda text: None,
) -> list[tuple[Reading, Reading]]:
    """Presses without and with the inclusion on one mesh at ascending forces; ``say`` gets the progress."""
    path = PressPath(DomedPress(probe, phantom, fine), say)
    return [path.readings(1000 * force, radius_mm) for force in forces_n]

"""A press on relaxing tissue: force and pressure against time while the glass is at rest.

A generalised eigenbasis diagonalises the compliances of probe and tissue. Each mode is a spring (the probe) in series
with a relaxing spring (the tissue). Its history obeys a linear equation with one unknown for each time constant, so
the time course is a sum of exponentials, exact at every time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.errors import InputError, MechanicsError
from tsis.mechanics.small_strain.linear_press import compliances, strain_problem
from tsis.mechanics.small_strain.slab import Resolution
from tsis.model.phantom import Phantom, Relaxation
from tsis.model.press import MN_PER_N
from tsis.model.probe import Probe
from tsis.model.require import require_array, require_number, require_type

if TYPE_CHECKING:
    from tsis.mechanics.mesh import Floats
    from tsis.mechanics.small_strain.linear_press import PressKernel


MANY = 50.0  # time constants after which an exponential is zero


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelaxingPress:
    """Time course of a press during and after the travel of the glass.

    Attributes
    ----------
    time_s
        Times since the travel began, shape (t,).
    force_n
        Force at each of them, shape (t,).
    radius_mm
        Radii on the face, shape (n,).
    pressure_kpa, face_displacement_mm
        Mean pressure around each radius and displacement of the face, shape (t, n).
    approach_mm
        Travel of the glass.
    """

    time_s: Floats
    force_n: Floats
    radius_mm: Floats
    pressure_kpa: Floats
    face_displacement_mm: Floats
    approach_mm: float


def relaxing_press(
    probe: Probe,
    phantom: Phantom,
    relaxation: Relaxation,
    *,
    approach_mm: float,
    time_s: Any,
    ramp_s: float = 0.0,
    resolution: Resolution | None = None,
) -> RelaxingPress:
    """Press by a travel of the glass, stop it, and follow force and pressure in time.

    The probe is elastic; tissue and inclusion relax with the same function, at small strain. The contact must cover
    the face from the end of the travel on, as it does under a flat face and under a dome at enough travel.

    Parameters
    ----------
    probe, phantom
        The probe and the tissue under it; the phantom's moduli are the relaxed ones.
    relaxation
        Relaxation of the tissue's modulus.
    approach_mm
        Travel of the glass since first touch, mm, in [1e-4, 100].
    time_s
        Times since the travel began, s, each in [0, 1e7].
    ramp_s
        Duration of the travel at constant speed; 0 is an instant step.
    resolution
        Mesh density.

    Raises
    ------
    InputError
        When a value lies outside its range.
    MechanicsError
        When the contact does not cover the face, or the strain is too large.
    """
    _check(probe, phantom, relaxation, approach_mm, ramp_s)
    times = require_array("time_s", time_s, ndim=1)
    if times.min() < 0 or times.max() > 1e7:
        raise InputError(f"time_s must lie in [0, 1e+07] seconds; got {times.min():g} to {times.max():g}")
    kernel, course = _course_of(probe, phantom, relaxation, approach_mm, resolution)
    nodal = course.forces(times, ramp_s)
    pressure, displacement = _on_face(kernel, nodal)
    _refuse_opening(kernel, pressure[times >= ramp_s], approach_mm)
    return RelaxingPress(
        time_s=times,
        force_n=nodal.sum(axis=1) / MN_PER_N,
        radius_mm=kernel.radius_mm,
        pressure_kpa=pressure,
        face_displacement_mm=displacement,
        approach_mm=approach_mm,
    )


def settling_time_s(
    probe: Probe,
    phantom: Phantom,
    relaxation: Relaxation,
    *,
    approach_mm: float,
    tolerance: float = 0.01,
    ramp_s: float = 0.0,
    resolution: Resolution | None = None,
) -> float:
    """Time since the travel began after which the force stays within ``tolerance`` of its final value.

    Parameters
    ----------
    probe, phantom, relaxation, approach_mm, ramp_s, resolution
        As in `relaxing_press`.
    tolerance
        Fraction of the settled force, in [1e-6, 1].

    Returns
    -------
    The time in s; ``ramp_s`` when the force is settled at the end of the travel.

    Raises
    ------
    InputError
        When a value lies outside its range.
    MechanicsError
        When the settled contact does not cover the face, or the strain is too large.

    Examples
    --------
    Under a probe far stiffer than the tissue the tissue alone decides, 2 s * ln(0.3 / 0.7 / 0.01):

    >>> from tsis.model.phantom import Phantom
    >>> from tsis.model.probe import Layer, Probe
    >>> from tsis.model.phantom import Relaxation
    >>> rigid = Probe(radius_mm=12.0, layers=(Layer(thickness_mm=2.0, young_kpa=1e6),))
    >>> tissue = Relaxation(shares=(0.3,), times_s=(2.0,))
    >>> time = settling_time_s(rigid, Phantom(young_kpa=5.0, thickness_mm=30.0), tissue, approach_mm=1.0)
    >>> f"{time:.2f} s"
    '7.52 s'
    """
    require_number("tolerance", tolerance, 1e-6, 1.0, hint="a fraction of the settled force")
    _check(probe, phantom, relaxation, approach_mm, ramp_s)
    kernel, course = _course_of(probe, phantom, relaxation, approach_mm, resolution)
    settled = course.forces(np.array([np.inf]), ramp_s)
    _refuse_opening(kernel, _on_face(kernel, settled)[0], approach_mm)

    def excess(log_wait: float) -> float:
        return float(course.forces(np.array([ramp_s + np.exp(log_wait)]), ramp_s).sum() / settled.sum()) - 1 - tolerance

    first, last = float(np.log(1e-9 * min(relaxation.times_s))), float(np.log(MANY * course.slowest_s))
    return (
        ramp_s if excess(first) <= 0 else ramp_s + float(np.exp(scipy.optimize.brentq(excess, first, last, xtol=1e-10)))
    )


def _check(probe: Probe, phantom: Phantom, relaxation: Relaxation, approach_mm: float, ramp_s: float) -> None:
    require_type("probe", probe, Probe)
    require_type("phantom", phantom, Phantom)
    require_type("relaxation", relaxation, Relaxation)
    require_number("approach_mm", approach_mm, 1e-4, 100.0, hint="millimetres")
    if ramp_s != 0:
        require_number("ramp_s", ramp_s, 1e-6, 1e6, hint="seconds; 0 is an instant step")
    problem = strain_problem(approach_mm, probe, phantom.thickness_mm)
    if problem is not None:
        raise MechanicsError(f"{problem}: choose a smaller approach_mm")


def _course_of(
    probe: Probe, phantom: Phantom, relaxation: Relaxation, approach_mm: float, resolution: Resolution | None
) -> tuple[PressKernel, _Course]:
    with one_blas_thread():  # threads slow down matrices this small
        kernel, tissue = compliances(probe, phantom, resolution or Resolution())
        travel = approach_mm - probe.sag_mm(kernel.face.radius_mm)
        return kernel, _Course(kernel.probe_compliance, tissue, relaxation, travel)


class _Course:
    """Nodal forces in time, for a face whose nodes travel by ``travel_mm``."""

    def __init__(self, probe: Floats, tissue: Floats, relaxation: Relaxation, travel_mm: Floats) -> None:
        self._softness, self._vectors = scipy.linalg.eigh(
            probe, tissue
        )  # of each spring of the probe; the tissue's is 1
        self._travel = self._vectors.T @ travel_mm
        ratio, times = relaxation.instantaneous_ratio, np.array(relaxation.times_s)
        self._lost = ratio * np.array(relaxation.shares)
        # A tissue spring of stretch u has internal variables z: force = ratio * u - lost @ z, dz/dt = (u - z) / time.
        # Probe and tissue fill the travel: softness * force + u = travel.
        self._give = 1 / (1 + self._softness * ratio)
        by_memory = (self._softness * self._give)[:, None, None] * self._lost
        self._rates, self._modes = np.linalg.eig((by_memory - np.eye(len(times))) / times[:, None])
        drive = (self._give * self._travel)[:, None] / times
        self._drive = np.linalg.solve(self._modes, drive[..., None])[..., 0]
        self._ratio = ratio

    @property
    def slowest_s(self) -> float:
        """Time constant of the slowest exponential, longer than the tissue's own under a soft probe."""
        return float(-1 / self._rates.max())

    def forces(self, time_s: Floats, ramp_s: float) -> Floats:
        """Forces on the nodes, mN, shape (t, n)."""
        memory = np.einsum("nij,tnj->tni", self._modes, self._drive * self._memory(time_s, ramp_s))
        fraction = np.minimum(time_s / ramp_s, 1.0) if ramp_s else np.ones_like(time_s)
        relaxed = memory @ self._lost
        stretch = self._give * (fraction[:, None] * self._travel + self._softness * relaxed)
        return np.asarray((self._ratio * stretch - relaxed) @ self._vectors.T)

    def _memory(self, time_s: Floats, ramp_s: float) -> Floats:
        """Solution of ``dx/dt = rate * x + drive(t)`` over the drive at the end of the travel, shape (t, n, terms)."""
        rate, time = self._rates, time_s[:, None, None]
        if not ramp_s:
            return np.asarray(np.expm1(rate * time) / rate)
        moving = np.minimum(time, ramp_s)
        at_end = (np.expm1(rate * moving) / rate - moving) / (rate * ramp_s)
        rest = time - moving
        return np.asarray(at_end * np.exp(rate * rest) + np.expm1(rate * rest) / rate)


def _on_face(kernel: PressKernel, nodal: Floats) -> tuple[Floats, Floats]:
    return kernel.contact.closed_pressure(nodal.T).T, kernel.face_displacement(nodal.T).T


def _refuse_opening(kernel: PressKernel, pressure: Floats, approach_mm: float) -> None:
    inner = pressure[:, kernel.contact.inner]
    if inner.size and inner.min() < 0:
        raise MechanicsError(
            f"approach_mm must close the contact over the whole face, because this model has no moving edge of the "
            f"contact; got {approach_mm:g}: press further, or choose a flatter face"
        )

"""Young's modulus of a phantom's material by bench tests: a ball pressed on a bonded pad, and a bonded cylinder.

The ball: contact with a bonded layer (`tsis.mechanics.gel.contact.layer_contact`), which Hayes and others (1972) and
Zhang and others (1997) tabulate and Dimitriadis and others (2002) fit. The cylinder between plates that hold it: finite
elements, near Gent and Lindley's (1959) ``1 + 2 S²``, S = diameter / (4 height), where it is flat and nearly
incompressible.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.mechanics.gel.contact import layer_contact
from tsis.mechanics.mesh import face_lines, mesh_rectangle, stiffness
from tsis.model.require import require_array, require_number

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray


LEAST_POINTS = 5
ORDER = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredModulus:
    """Young's modulus and its standard deviation from the scatter of the points, kPa; travel at first contact, mm."""

    young_kpa: float
    sd_kpa: float
    contact_mm: float


def indentation_modulus(
    depth_mm: ArrayLike, force_mn: ArrayLike, *, radius_mm: float, thickness_mm: float, poisson: float = 0.49
) -> MeasuredModulus:
    """Modulus of a pad bonded to a rigid plate, from a rigid ball pressed on its middle; first contact is fitted.

    Parameters
    ----------
    depth_mm, force_mn
        Travel of the ball, mm, and force, mN; shape (points,), at least 5, forces positive.
    radius_mm, thickness_mm
        Of ball and pad. The pad is best 10 contact radii wide.
    poisson
        Of the material, in [0, 0.4999].

    Raises
    ------
    InputError
        When a value lies outside its range, or no modulus fits.

    Examples
    --------
    >>> depth = np.linspace(0.1, 1.0, 10)
    >>> hertz = 4 / 3 * 10 / (1 - 0.49**2) * np.sqrt(5.0) * depth**1.5
    >>> round(indentation_modulus(depth, hertz, radius_mm=5.0, thickness_mm=1e3).young_kpa, 1)
    10.0
    """
    depth, force = _points(depth_mm, force_mn, "depth_mm", "force_mn")
    require_number("radius_mm", radius_mm, 0.1, 1000.0, hint="millimetres")
    widest = np.sqrt(radius_mm * float(np.ptp(depth) + depth.max())) * 1.6
    contact = np.geomspace(1e-3, widest, 60)
    unit = layer_contact(
        contact,
        radius_mm=radius_mm,
        body_compliance=0.0,
        gel_compliance=1 - poisson**2,
        thickness_mm=thickness_mm,
        poisson=poisson,
    )
    rising = np.log(unit.dent_mm), np.log(unit.force)

    def model(below: NDArray[np.float64]) -> NDArray[np.float64]:
        """Force at a modulus of 1 kPa."""
        safe = np.log(np.maximum(below, unit.dent_mm[0]))
        return np.where(below > 0, np.exp(np.interp(safe, *rising)), 0.0)

    return _fitted(depth, force, model)


def compression_modulus(
    shortening_mm: ArrayLike, force_mn: ArrayLike, *, diameter_mm: float, height_mm: float, poisson: float = 0.49
) -> MeasuredModulus:
    """Modulus of a cylinder whose ends are held by plates, from small shortenings in mm and forces in mN.

    Points, errors and the fitted first contact as `indentation_modulus`; shorten by less than 10 % of the height.
    """
    shortening, force = _points(shortening_mm, force_mn, "shortening_mm", "force_mn")
    require_number("shortening_mm over height_mm", float(np.ptp(shortening)) / height_mm, 1e-5, 0.1)
    area = np.pi * diameter_mm**2 / 4
    slope = bonded_factor(diameter_mm, height_mm, poisson) * area / height_mm
    return _fitted(shortening, force, lambda below: slope * below)


@lru_cache(maxsize=64)
def bonded_factor(diameter_mm: float, height_mm: float, poisson: float) -> float:
    """Apparent over true modulus of a cylinder between plates that hold its ends, at small strain, by finite elements.

    Examples
    --------
    >>> round(bonded_factor(20.0, 10.0, 0.0), 6), bonded_factor(20.0, 10.0, 0.49) > 1.3
    (1.0, True)
    """
    require_number("diameter_mm", diameter_mm, 0.5, 1000.0, hint="millimetres")
    require_number("height_mm over diameter_mm", height_mm / diameter_mm, 0.02, 20.0)
    require_number("poisson", poisson, 0.0, 0.4999)
    radius, half = diameter_mm / 2, height_mm / 2
    columns = face_lines(radius, finest=0.002 * radius, growth=1.8, largest=radius / 4)
    rows = half - face_lines(half, finest=0.002 * half, growth=1.8, largest=half / 3)[::-1]
    mesh = mesh_rectangle(columns, rows, ORDER, a_is_radius=True)
    shape = mesh.nodes.shape[:2]
    unknown = np.arange(2 * shape[0] * shape[1]).reshape(*shape, 2)
    blocks, places = [], []
    for layer in range(mesh.layers):
        nodes = mesh.layer(layer, mesh.nodes)
        blocks.append(stiffness(nodes, ORDER, np.ones(len(nodes)), np.full(len(nodes), poisson)))
        places.append(mesh.layer(layer, unknown).reshape(len(nodes), -1))
    matrix, place = np.concatenate(blocks), np.concatenate(places)
    row, column = (np.broadcast_to(part, matrix.shape).ravel() for part in (place[:, :, None], place[:, None, :]))
    whole = scipy.sparse.coo_array((matrix.ravel(), (row, column)), shape=(unknown.size, unknown.size)).tocsr()
    moved = np.zeros(unknown.size)
    fixed = np.zeros(unknown.size, dtype=bool)
    fixed[unknown[0, :, 0]] = fixed[unknown[:, 0]] = fixed[unknown[:, -1, 1]] = True  # axis, plate, middle plane
    moved[unknown[:, 0, 1]] = 1.0
    free = ~fixed
    moved[free] = scipy.sparse.linalg.spsolve(whole[free][:, free], -(whole[free] @ moved))
    force = float((whole @ moved)[unknown[:, 0, 1]].sum())
    return abs(force) * half / (np.pi * radius**2)


def _points(
    length: ArrayLike, force: ArrayLike, length_name: str, force_name: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    lengths, forces = require_array(length_name, length, ndim=1), require_array(force_name, force, ndim=1)
    if lengths.shape != forces.shape or lengths.size < LEAST_POINTS:
        raise InputError(
            f"{length_name} and {force_name} must be of one length, at least {LEAST_POINTS}; got {lengths.size} and "
            f"{forces.size}"
        )
    if forces.min() <= 0 or np.ptp(lengths) <= 0:
        raise InputError(f"{force_name} must be positive and {length_name} must differ: leave out those before contact")
    return lengths, forces


def _fitted(
    length: NDArray[np.float64], force: NDArray[np.float64], model: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> MeasuredModulus:
    """Least squares of modulus and first contact; sd with the degrees of freedom of the points less 2."""
    span = float(np.ptp(length))

    def residuals(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.exp(values[0]) * model(length - values[1]) - force)

    start = length.min() - 0.05 * span
    first = float(force.max() / max(float(np.max(model(length - start))), 1e-300))
    fit = scipy.optimize.least_squares(residuals, [np.log(first), start], x_scale=[0.1, 0.1 * span])
    if not fit.success or not np.isfinite(fit.x).all():
        raise InputError("no modulus fits these points; check that forces rise with the travel, and the units")
    variance = 2 * fit.cost / (len(length) - 2)
    jacobian = np.asarray(fit.jac)
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * variance
    young = float(np.exp(fit.x[0]))
    return MeasuredModulus(young_kpa=young, sd_kpa=young * float(np.sqrt(covariance[0, 0])), contact_mm=float(fit.x[1]))

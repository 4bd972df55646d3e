"""Contact that can open: which nodes of a face touch, and with what force.

The bodies are condensed onto the face, so contact is a small linear complementarity problem: at each node either the
gap is closed and pushes, or it is open and nothing acts. With a positive definite compliance it has one solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.model.check import require_array, require_number
from tsis.model.errors import InputError, MechanicsError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

ROUNDING = 1e-12  # forces and gaps this small, relative to the largest, have no sign
PATIENCE = 3  # exchanges of all wrong nodes without progress before single ones are exchanged


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactDiagnostics:
    """How a contact was found.

    Attributes
    ----------
    closed
        Whether each node touches, shape (n,).
    gap_mm
        Gap that is left at each node, shape (n,), mm; zero where closed.
    iterations
        Linear solves.
    """

    closed: NDArray[np.bool]
    gap_mm: NDArray[np.float64]
    iterations: int


def unilateral_contact(
    compliance: ArrayLike, gap_mm: ArrayLike, approach_mm: float
) -> tuple[NDArray[np.float64], ContactDiagnostics]:
    """Nodal forces when two bodies approach each other and may touch but not pull.

    Finds ``f >= 0`` and ``gap = C f + gap_mm - approach_mm >= 0`` with ``f * gap = 0`` node by node, by block principal
    pivoting (Judice and Pires 1994): solve for the nodes taken as closed, exchange those whose force or gap is
    negative. When exchanging all of them stops helping, the last one alone is exchanged, which always ends.

    Parameters
    ----------
    compliance
        Displacement of the nodes by nodal forces, both bodies added, mm/mN; symmetric positive definite, shape (n, n).
    gap_mm
        Gap of the undeformed bodies at first touch, mm, shape (n,).
    approach_mm
        Travel since first touch, mm, in [-1e6, 1e6].

    Returns
    -------
    force : ndarray
        Nodal forces, mN, shape (n,), >= 0.
    diagnostics : ContactDiagnostics
        The nodes that touch, and the gaps.

    Raises
    ------
    InputError
        When the shapes do not belong together.
    MechanicsError
        When no contact is found, which a positive definite compliance excludes.

    Examples
    --------
    >>> force, found = unilateral_contact([[2.0, 1.0], [1.0, 2.0]], [0.0, 3.0], 1.0)
    >>> force.tolist(), found.gap_mm.tolist()
    ([0.5, 0.0], [0.0, 2.5])
    """
    matrix = require_array("compliance", compliance, ndim=2)
    gap = require_array("gap_mm", gap_mm, ndim=1)
    approach = require_number("approach_mm", approach_mm, -1e6, 1e6, hint="millimetres")
    if matrix.shape != (gap.size, gap.size):
        raise InputError(f"compliance must have shape ({gap.size}, {gap.size}), as gap_mm has; got {matrix.shape}")
    overlap = approach - gap
    closed, fewest, patience = overlap > 0, gap.size + 1, PATIENCE
    for iteration in range(1, 100 + 10 * gap.size):
        force = np.zeros(gap.size)
        force[closed] = np.linalg.solve(matrix[np.ix_(closed, closed)], overlap[closed])
        left = np.where(closed, 0.0, matrix @ force - overlap)
        wrong = (force < -ROUNDING * np.abs(force).max()) | (left < -ROUNDING * np.abs(overlap).max())
        count = int(np.count_nonzero(wrong))
        if count == 0:
            return np.maximum(force, 0.0), ContactDiagnostics(closed=closed, gap_mm=left, iterations=iteration)
        if count < fewest:
            fewest, patience = count, PATIENCE
        else:
            patience -= 1
        if patience < 0:
            wrong[: np.flatnonzero(wrong)[-1]] = False
        closed = closed ^ wrong
    raise MechanicsError("compliance must be symmetric positive definite for a contact to exist; none was found")

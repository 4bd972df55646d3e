"""Beam propagation: the wave marched along the guide from section to section, without what is thrown back.

One way along z the wave obeys ``du/dz = i sqrt(k**2 + d2/dx2) u``. The square root is replaced by Padé's (1,1) fraction
around a reference wave number, which stays good to wide angles, and a step becomes one tridiagonal solve for all modes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import zgttrf, zgttrs

from tsis.optics.propagation.elements import MASS, STIFFNESS, times, tridiagonal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.optics.propagation.grid import Axis


def march(
    across: Axis,
    along: Axis,
    wavenumber_squared: NDArray[np.float64],
    start: NDArray[np.complex128],
    reference: float,
) -> NDArray[np.complex128]:
    """March the columns of ``start`` through all sections.

    With ``X = (k**2 + d2/dx2) / reference**2 - 1`` it takes ``sqrt(1 + X) - 1 = (X / 2) / (1 + X / 4)`` and the
    trapezoidal rule, which in a flat guide without absorber keeps ``u.T @ mass @ u`` exactly.

    Parameters
    ----------
    across, along
        Axes x and z.
    wavenumber_squared
        ``(k0 n)**2`` in each cell, 1/µm², shape (cells along z, cells along x).
    start
        Fields on the first node of z, shape (nodes of x, columns).
    reference
        Wave number, 1/µm, near those of the waves of interest.

    Returns
    -------
    NDArray[np.complex128]
        Shape (nodes of z, nodes of x, columns).
    """
    size = across.stretch * across.step_um
    mass, stiffness = tridiagonal(size, MASS), tridiagonal(1 / size, STIFFNESS)
    field = np.empty((along.cells + 1, *start.shape), dtype=complex)
    field[0] = start
    half = 0.25j * reference * along.step_um
    factors: tuple[NDArray[np.complex128], ...] = ()
    passed = None
    explicit = mass
    for number, section in enumerate(wavenumber_squared):
        if passed is None or not np.array_equal(section, passed):
            operator = (tridiagonal(section * size, MASS) - stiffness) / reference**2 - mass
            diagonal, off = mass + (0.25 - half) * operator
            factors = zgttrf(off[:-1], diagonal, off[:-1])[:5]
            explicit = mass + (0.25 + half) * operator
            passed = section
        field[number + 1] = zgttrs(*factors, times(explicit, field[number]))[0]
    turned = np.exp(1j * reference * along.step_um * np.arange(along.cells + 1))
    field *= turned[:, np.newaxis, np.newaxis]
    return field

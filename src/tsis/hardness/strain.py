"""Lagrangian strain of a map between two states of a body, and what the source prints in its place.

A map ``f`` takes a place ``x`` of the first state to its place in the second. Strain belongs to the displacement
``u = f - x``: its tensor ``1/2 (H + H' + H' H)`` with ``H = du/dx`` is zero for every rigid motion. The source's (5.17)
puts the map itself where the displacement belongs, and cubes where squares do; a body that nobody touched then has a
strain of 1.5.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.model.check import require_array
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def lagrangian_strain(gradient: ArrayLike) -> NDArray[np.float64]:
    """The full strain tensor of a map at each place.

    Parameters
    ----------
    gradient
        Derivatives ``[n, i, j] = d f_i / d x_j`` of the map, as `ThinPlateSpline.gradient` gives them, shape (n, d, d).

    Returns
    -------
    Symmetric tensors, shape (n, d, d), without unit: half of the change of squared lengths. A rotation gives 0; a
    stretch by ``s`` gives ``(s**2 - 1) / 2``, which is ``s - 1`` while that is small.

    Raises
    ------
    InputError
        When the gradient is not a stack of square matrices of finite numbers.

    Examples
    --------
    >>> lagrangian_strain([[[1.1, 0.0], [0.0, 1.0]]]).round(3).tolist()
    [[[0.105, 0.0], [0.0, 0.0]]]
    """
    moved = _displacement_gradient(gradient)
    turned = np.swapaxes(moved, 1, 2)
    return np.asarray((moved + turned + turned @ moved) / 2)


def axial_strain(gradient: ArrayLike) -> NDArray[np.float64]:
    """The component ``e_zz`` of the strain along the last axis, shape (n,): (5.17) as it is right.

    ``e_zz = du_z/dz + 1/2 [(du_x/dz)**2 + (du_y/dz)**2 + (du_z/dz)**2]`` of the displacement u.

    Parameters
    ----------
    gradient
        Derivatives of the map, shape (n, d, d).

    Raises
    ------
    InputError
        When the gradient is not a stack of square matrices of finite numbers.

    Examples
    --------
    >>> axial_strain([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.8]]]).round(3).tolist()
    [-0.18]
    """
    along = _displacement_gradient(gradient)[:, :, -1]
    return np.asarray(along[:, -1] + (along**2).sum(axis=1) / 2)


def printed_axial_strain(gradient: ArrayLike) -> NDArray[np.float64]:
    """(5.17) to the letter, shape (n,): of the map instead of the displacement, with cubes instead of squares.

    ``df_z/dz + 1/2 [(df_x/dz)**3 + (df_y/dz)**3 + (df_z/dz)**3]``; for comparison, since it is no strain.

    Parameters
    ----------
    gradient
        Derivatives of the map, shape (n, d, d).

    Raises
    ------
    InputError
        When the gradient is not a stack of square matrices of finite numbers.

    Examples
    --------
    >>> printed_axial_strain([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]]).tolist()  # nothing has moved
    [1.5]
    """
    along = _gradient(gradient)[:, :, -1]
    return np.asarray(along[:, -1] + (along**3).sum(axis=1) / 2)


def _displacement_gradient(gradient: ArrayLike) -> NDArray[np.float64]:
    checked = _gradient(gradient)
    return np.asarray(checked - np.eye(checked.shape[1]))


def _gradient(gradient: ArrayLike) -> NDArray[np.float64]:
    checked = require_array("gradient", gradient, ndim=3)
    if checked.shape[1] != checked.shape[2]:
        raise InputError(f"gradient must be a square matrix at each place; got shape {checked.shape}")
    return checked

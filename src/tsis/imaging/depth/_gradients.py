"""From the change of colour to the slope of the face: a polynomial by ridge regression, or a table."""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import distance_transform_edt

if TYPE_CHECKING:
    from numpy.typing import NDArray


GRADIENT_DEGREE = 3  # of the polynomial in the colours
COLOUR_SCALE = 64.0  # levels
RIDGE = 1e-3  # of the mean square of the features
BINS, BIN_LEVELS = 32, 6.0  # of the table, a channel


def polynomial_features(
    change: NDArray[Any], place: NDArray[Any], degree: int = GRADIENT_DEGREE
) -> NDArray[np.float32]:
    """Monomials of the change of colour, each alone and times x and y of the frame; none is constant.

    Parameters
    ----------
    change
        Levels, shape (n, channels).
    place
        x and y from -1 to 1 over the frame, shape (n, 2).
    degree
        Highest degree in the colours.
    """
    colours = np.asarray(change, dtype=np.float32).T / np.float32(COLOUR_SCALE)
    products: dict[tuple[int, ...], NDArray[np.float32]] = {(): np.ones(colours.shape[1], np.float32)}
    for order in range(1, degree + 1):
        for key in combinations_with_replacement(range(len(colours)), order):
            products[key] = products[key[:-1]] * colours[key[-1]]
    monomials = [value for key, value in products.items() if key]
    x, y = np.asarray(place, dtype=np.float32).T
    low = [value for key, value in products.items() if 0 < len(key) < degree]
    return np.stack([*monomials, *(value * x for value in low), *(value * y for value in low)], axis=1)


def fit_polynomial(
    change: NDArray[np.float64], place: NDArray[np.float64], slope: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Weights of the features for both slopes, shape (features, 2)."""
    features = polynomial_features(change, place).astype(np.float64)
    normal = features.T @ features
    normal[np.diag_indices_from(normal)] += RIDGE * np.trace(normal) / len(normal)
    return np.asarray(np.linalg.solve(normal, features.T @ slope))


def fit_table(change: NDArray[np.float64], slope: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean slope in bins of the change of colour, shape (bins, bins, bins, 2); an empty bin has its nearest's."""
    index = table_index(change)
    cells = np.ravel_multi_index(index, (BINS,) * 3)
    count = np.bincount(cells, minlength=BINS**3).astype(float)
    table = np.stack(
        [np.bincount(cells, weights=slope[:, axis], minlength=BINS**3) / np.maximum(count, 1.0) for axis in (0, 1)],
        axis=-1,
    ).reshape(BINS, BINS, BINS, 2)
    empty = (count == 0).reshape(BINS, BINS, BINS)
    nearest = distance_transform_edt(empty, return_distances=False, return_indices=True)
    return np.asarray(table[tuple(nearest)])


def table_index(change: NDArray[Any]) -> tuple[NDArray[np.intp], ...]:
    """Bins of colours in the table, one array a channel."""
    bins = np.clip(np.floor(np.asarray(change) / BIN_LEVELS) + BINS // 2, 0, BINS - 1).astype(np.intp)
    return tuple(bins[..., channel] for channel in range(3))

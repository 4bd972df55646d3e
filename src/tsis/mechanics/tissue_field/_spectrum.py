"""An isotropic Gaussian field of log modulus, seen through the linear response of a press.

The field of unit variance has the correlation ``exp(-x**2 / (2 l**2))`` of points x apart. It is a sum of plane waves
whose wave numbers are normal with standard deviation 1/l in each direction. Harmonic m around the axis of a wave is a
Bessel function of the radius, so that covariances of the responses need no covariance between points.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import jv

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.mechanics._element import Floats

WAVES = ((3.0, 32), (4.5, 20), (np.inf, 12))  # nodes of the spectrum in each direction for lengths below, mm
DIRECTIONS = 40  # of the responses; the others are negligible


def field_features(harmonic: int, length_mm: float, radius_mm: Floats, depth_mm: Floats) -> tuple[Floats, Floats]:
    """Waves across the axis and along it, shape (waves, points) each.

    The products of one of each are features. Their Gram matrix is the covariance of the field's harmonic between points
    (r, z): of its mean around the axis for m = 0, of either part of its harmonic for m >= 1.
    """
    count = next(count for longest, count in WAVES if length_mm < longest)
    square, weight = np.polynomial.laguerre.laggauss(count)
    across = jv(harmonic, np.outer(np.sqrt(2 * square) / length_mm, radius_mm)) * np.sqrt(weight)[:, None]
    node, weight = np.polynomial.hermite_e.hermegauss(count)
    node, weight = node[count // 2 :], 2 * weight[count // 2 :] / weight.sum()  # symmetric in the wave number
    phase, root = np.outer(node / length_mm, depth_mm), np.sqrt(weight)[:, None]
    along = np.concatenate([root * np.cos(phase), root * np.sin(phase)])
    return (1.0 if harmonic == 0 else np.sqrt(2.0)) * across, along


def field_factors(response: Floats, features: Sequence[tuple[Floats, Floats]], *, rank: int) -> Floats:
    """Factors F (lengths, outputs, rank) of the covariances F F' of linear outputs of fields of unit variance.

    Parameters
    ----------
    response
        Outputs by a unit of the field at each point, shape (outputs, points).
    features
        `field_features` of the points for each correlation length.
    rank
        Number of directions; those of less variance are left out.
    """
    # The outputs are few smooth functions of the field: their directions do not depend on its length.
    _, directions = np.linalg.eigh(response @ response.T)
    directions = directions[:, ::-1][:, :DIRECTIONS]
    reduced, factors = directions.T @ response, []
    for across, along in features:
        columns = np.concatenate([(reduced * wave) @ along.T for wave in across], axis=1)
        left, size, _ = np.linalg.svd(columns, full_matrices=False)
        factors.append(directions @ (left[:, :rank] * size[:rank]))
    return np.array(factors)

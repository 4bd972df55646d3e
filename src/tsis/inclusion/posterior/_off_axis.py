"""An inclusion off the probe's axis: shift of the change that it causes, and its means around the axis.

Approximation: the change in pressure and displacement shifts with the inclusion, with the same shape, and grows by
``1 / (1 - (offset / R)**2)``; the press without inclusion stays. Both parts of a dome's press shift equally. Under a
rigid punch of radius R the pressure grows towards the rim as the root of this factor, which applies to the stress at
the inclusion and, by reciprocity, to the response of the face. ``benchmarks/off_axis.py`` prints the error against a
flat probe in three dimensions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics import hats
from tsis.model import require_number

if TYPE_CHECKING:
    from tsis.inclusion._prior import Floats


SHIFTED = 0.85  # of the face's radius; the change beyond belongs to the rim and does not shift
FARTHEST = 0.5  # of the face's radius; the benchmark prints the range of the approximation
DIRECTIONS = 48  # over half a circle; the other half is symmetric


def off_axis_profile(radius_mm: Floats, offset_mm: float) -> Floats:
    """Matrix from the change by an inclusion on the axis to the mean around the axis at an offset of the inclusion.

    It applies to profiles of pressure and displacement; the radial differences of a displacement's result are the means
    of its radial slope. The shifted profile is constant beyond `SHIFTED` of the face's radius, and the rest does not
    shift: the pressure is singular at the rim.

    Parameters
    ----------
    radius_mm
        Radii of the profile, ascending from 0 to the face's radius, shape (n,).
    offset_mm
        Distance of the inclusion's centre from the axis, in [0, `FARTHEST` of the face's radius].

    Returns
    -------
    Matrix of shape (n, n), the identity at offset 0 and even in the offset.

    Raises
    ------
    InputError
        When the offset lies outside its range.

    Examples
    --------
    >>> radius = np.linspace(0.0, 12.0, 121)
    >>> level = off_axis_profile(radius, 3.0) @ np.ones(121)
    >>> round(float(level[0]), 4)  # what is level stays level and grows by 1 / (1 - (3 / 12)**2)
    1.0667
    """
    edge = float(radius_mm[-1])
    require_number("offset_mm", offset_mm, 0.0, FARTHEST * edge, hint="millimetres, at most half of the face's radius")
    angle = np.pi * (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    away = np.hypot(radius_mm[:, None] - offset_mm * np.cos(angle), offset_mm * np.sin(angle))
    moving = hats(radius_mm, np.minimum(radius_mm, SHIFTED * edge))
    shifted = hats(radius_mm, np.minimum(away, SHIFTED * edge).ravel()).reshape(*away.shape, -1).mean(axis=1)
    growth = 1 / (1 - (offset_mm / edge) ** 2)
    return np.asarray(np.eye(len(radius_mm)) - moving + growth * shifted)

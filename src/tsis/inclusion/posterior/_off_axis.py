"""An inclusion beside the probe's axis: how the change that it makes moves, and what turns around the axis see.

Approximation: the change that an inclusion makes in pressure and displacement moves with it, unchanged in shape, and
grows by ``1 / (1 - (offset / R)**2)``; the press of plain tissue stays. Both parts of a dome's press are moved alike.
Under a rigid punch of radius R the pressure grows towards the rim as the root of this: once for the stress that the
inclusion meets and once, by reciprocity, for what the face answers to it. ``benchmarks/off_axis.py`` prints the error
against the press of a flat probe in three dimensions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics import hats
from tsis.model import require_number

if TYPE_CHECKING:
    from numpy.typing import NDArray


MOVES = 0.85  # of the face's radius; what the change does farther out belongs to the rim and stays with it
FARTHEST = 0.5  # of the face's radius, for any use; how far the approximation holds is in the benchmark
TURNS = 48  # directions over half a turn; the other half mirrors them


def off_axis_profile(radius_mm: NDArray[np.float64], offset_mm: float) -> NDArray[np.float64]:
    """Matrix from the change by an inclusion on the axis to the mean around the axis when it lies ``offset_mm`` beside.

    It takes profiles of pressure or displacement alike; differences along the radius of a displacement's result are the
    means of its slope along the radius. Beyond `MOVES` of the face's radius the profile moves as if it stayed level
    there, and what it does there stays where it is: the pressure is singular at the rim, which does not move.

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
    angle = np.pi * (np.arange(TURNS) + 0.5) / TURNS
    away = np.hypot(radius_mm[:, None] - offset_mm * np.cos(angle), offset_mm * np.sin(angle))
    moving = hats(radius_mm, np.minimum(radius_mm, MOVES * edge))
    shifted = hats(radius_mm, np.minimum(away, MOVES * edge).ravel()).reshape(*away.shape, -1).mean(axis=1)
    growth = 1 / (1 - (offset_mm / edge) ** 2)
    return np.asarray(np.eye(len(radius_mm)) - moving + growth * shifted)

"""Interface of the matching methods: map, correspondences and trust in normalised coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from tsis.errors import InputError
from tsis.model import require_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Booleans = NDArray[np.bool]
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

UNMATCHED = -1
BLOCK = 20_000  # points transformed at once


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MatchFit:
    """Result of a method, in its normalised coordinates."""

    move: Move  # map from the source's coordinates, shape (k, d), to the target's
    matches: Integers  # index of each source point's target point, or `UNMATCHED`, shape (n,); no target point twice
    trust: Floats  # confidence of each match, in [0, 1], shape (n,); 0 where there is none


class Move(Protocol):
    """A map of points, shape (k, d), to points."""

    def __call__(self, points: Floats, /) -> Floats:
        """Transform the points."""


def transformed_in_blocks(move: Move, points: Floats) -> Floats:
    """Transform many points, shape (k, d), in blocks of limited memory."""
    return np.concatenate([move(points[start : start + BLOCK]) for start in range(0, len(points), BLOCK)])


class MatchMethod(Protocol):
    """A method that matches two normalised point sets, shapes (n, d) and (m, d), with d = 2 or 3.

    A normalised set has its mean in the origin and a root-mean-square distance of 1 from it. All randomness comes from
    ``rng``.
    """

    def __call__(self, source: Floats, target: Floats, /, *, rng: np.random.Generator) -> MatchFit:
        """Match the sets."""


def require_points(name: str, value: ArrayLike, dimension: int | None = None) -> Floats:
    """Points of shape (n, d) with d = 2 or 3, or with d = ``dimension``."""
    points = require_array(name, value, ndim=2)
    if points.shape[1] not in ((2, 3) if dimension is None else (dimension,)):
        required = "2 or 3" if dimension is None else str(dimension)
        raise InputError(f"{name} must have {required} coordinates each; got shape {points.shape}")
    return points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NormalFrame:
    """Centre, shape (d,), and size of a point set in its own unit."""

    centre: Floats
    size: float

    @classmethod
    def of(cls, points: Floats) -> NormalFrame:
        """The frame of points, shape (n, d), that do not all coincide."""
        centre = points.mean(axis=0)
        return cls(centre=centre, size=float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean())))

    def inward(self, points: Floats) -> Floats:
        """From the set's own unit to its frame."""
        return np.asarray((points - self.centre) / self.size)

    def outward(self, points: Floats) -> Floats:
        """From the frame to the set's own unit."""
        return np.asarray(points * self.size + self.centre)


def ridge_solution(normal: Floats, right: Floats, ridge: Floats | float) -> Floats:
    """Solution x of ``(normal + diag(ridge)) x = right``, shape (k, d), for inner loops: inputs are not checked.

    ``normal``, shape (k, k), is symmetric and is overwritten.
    """
    normal[np.diag_indices_from(normal)] += ridge
    factor = cho_factor(normal, overwrite_a=True, check_finite=False)
    return np.asarray(cho_solve(factor, right, check_finite=False))

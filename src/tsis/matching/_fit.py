"""What a method of matching returns: where points go, which belong together, and how sure each pair is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve

if TYPE_CHECKING:
    from numpy.typing import NDArray


UNMATCHED = -1
BLOCK = 20_000  # points that are moved at once


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MatchFit:
    """A method's answer in the normalised coordinates that it was given.

    Attributes
    ----------
    move
        Takes points of the source's coordinates, shape (k, d), to the target's.
    matches
        Index of each source point's target point, or `UNMATCHED`, shape (n,); no target point twice.
    trust
        How sure each match is, in [0, 1], shape (n,); 0 where there is none.
    """

    move: Move
    matches: NDArray[np.int64]
    trust: NDArray[np.float64]


class Move(Protocol):
    """A map of points, shape (k, d), to points."""

    def __call__(self, points: NDArray[np.float64], /) -> NDArray[np.float64]:
        """Where the points go."""


def transformed_in_blocks(move: Move, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where many points go, shape (k, d), without room for the terms of all of them at once."""
    return np.concatenate([move(points[start : start + BLOCK]) for start in range(0, len(points), BLOCK)])


class MatchMethod(Protocol):
    """One way of matching two normalised point sets, shapes (n, d) and (m, d), d being 2 or 3.

    Each set has its mean in the origin and a root-mean-square distance of 1 from it. ``rng`` is the only source of
    chance, for those that need any.
    """

    def __call__(
        self, source: NDArray[np.float64], target: NDArray[np.float64], /, *, rng: np.random.Generator
    ) -> MatchFit:
        """Match them."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NormalFrame:
    """Where a point set lies, ``centre`` of shape (d,), and how large it is, in its own unit."""

    centre: NDArray[np.float64]
    size: float

    @classmethod
    def of(cls, points: NDArray[np.float64]) -> NormalFrame:
        """The frame of points, shape (n, d), that are not all in one place."""
        centre = points.mean(axis=0)
        return cls(centre=centre, size=float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean())))

    def inward(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """From the set's own unit to its frame."""
        return np.asarray((points - self.centre) / self.size)

    def outward(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """From the frame to the set's own unit."""
        return np.asarray(points * self.size + self.centre)


def ridge_solution(
    normal: NDArray[np.float64], right: NDArray[np.float64], ridge: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Solution x of ``(normal + diag(ridge)) x = right``, shape (k, d); unchecked, for inner loops.

    ``normal``, shape (k, k), is symmetric and used up: its content is another one afterwards.
    """
    normal[np.diag_indices_from(normal)] += ridge
    factor = cho_factor(normal, overwrite_a=True, check_finite=False)
    return np.asarray(cho_solve(factor, right, check_finite=False))

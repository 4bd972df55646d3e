"""What a method of matching returns: where points go, which belong together, and how sure each pair is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

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


def moved_in_blocks(move: Move, points: NDArray[np.float64]) -> NDArray[np.float64]:
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

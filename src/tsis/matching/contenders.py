"""Methods under one call, those of this package and those of others, so that one run can judge them all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.matching.peers import PEERS, peer
from tsis.matching.registration import METHODS, match_points
from tsis.matching.trial_runs import MatchOutcome
from tsis.model.check import require_one_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

OWN_METHODS = tuple(METHODS)
RIVAL_METHODS = ("cpd", *PEERS)  # every way of coherent point drift: a method is compared with the best of them


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchmarkMethod:
    """A method by its name; a value, so that it can be handed to another process.

    Attributes
    ----------
    name
        One of `OWN_METHODS`, or of `tsis.matching.peers.PEERS`.
    """

    name: str

    def __post_init__(self) -> None:
        require_one_of("method", self.name, (*OWN_METHODS, *PEERS))

    def absent(self) -> str:
        """Why it cannot be run here; empty when it can."""
        return peer(self.name).absent() if self.name in PEERS else ""

    def __call__(
        self, source: NDArray[np.float64], target: NDArray[np.float64], *, rng: np.random.Generator
    ) -> MatchOutcome:
        """Match two point sets, shapes (n, d) and (m, d).

        The answer of a method of this package is judged even where `tsis.matching.register` would withhold it, as it
        does when the confidence is low: other programs withhold nothing.
        """
        if self.name in PEERS:
            return MatchOutcome(moved=peer(self.name).moved(source, target), reliable=None)
        found = match_points(source, target, method=self.name, rng=rng)
        return MatchOutcome(moved=found.moved, reliable=found.reliable)


__all__ = ["OWN_METHODS", "RIVAL_METHODS", "BenchmarkMethod"]

"""What a search finds, judged: areas under the curve, the detection limit over size and depth, and probabilities.

Every line that is judged is one target: its truth, what was drawn for it, and what the estimate said.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.study.proportions import Proportion
from tsis.study.roc import Roc, at_specificity
from tsis.study.search import detection_range_of_trials

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray


DIAMETERS_MM = (2.0, 3.5, 5.0, 7.0, 9.0, 12.0, 15.0)  # ends of the map's cells
DEPTHS_MM = (4.0, 6.0, 8.0, 10.0, 12.0)
WITHIN = (5.0, 8.0)  # at least so large and at most so deep is where the area is wanted
SPECIFICITIES = (0.9, 0.95)
FARTHEST_OUT = 1 - 1e-12  # a probability that is nearer to 0 or 1 counts as this for slopes of logits


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Searched:
    """Targets that were judged.

    Attributes
    ----------
    present
        Whether a target holds an inclusion, shape (n,).
    presence
        Probability of an inclusion that its estimate gave, shape (n,); hundreds of nats of evidence are rounded to 1.
    evidence
        Natural logarithm of how much better an inclusion explains its frames, before that is rounded, shape (n,).
    truth
        Diameter, depth and modulus as drawn, for blanks of what was left out, shape (n, 3).
    offset_mm, uneven_sd, tissue_kpa, thickness_mm, poisson
        Nuisances that were drawn, shape (n,) each.
    """

    present: NDArray[np.bool_]
    presence: NDArray[np.float64]
    evidence: NDArray[np.float64]
    truth: NDArray[np.float64]
    offset_mm: NDArray[np.float64]
    uneven_sd: NDArray[np.float64]
    tissue_kpa: NDArray[np.float64]
    thickness_mm: NDArray[np.float64]
    poisson: NDArray[np.float64]

    @classmethod
    def of(cls, lines: Iterable[Mapping[str, Any]]) -> Searched:
        """From lines of `benchmarks.detection_study` whose estimate was not refused."""
        every = list(lines)

        def column(name: str, dtype: type = float) -> NDArray[Any]:
            return np.array([line[name] for line in every], dtype=dtype)

        return cls(
            present=column("present", bool),
            presence=column("presence"),
            evidence=column("evidence"),
            truth=column("truth").reshape(-1, 3),
            offset_mm=column("offset_mm"),
            uneven_sd=column("uneven_sd"),
            tissue_kpa=column("tissue_kpa"),
            thickness_mm=column("thickness_mm"),
            poisson=column("poisson"),
        )

    @property
    def wanted(self) -> NDArray[np.bool_]:
        """Blanks, and the inclusions for which the area is wanted."""
        return ~self.present | ((self.truth[:, 0] >= WITHIN[0]) & (self.truth[:, 1] <= WITHIN[1]))

    def curve(self, among: NDArray[np.bool_] | None = None, score: NDArray[np.float64] | None = None) -> Roc:
        """Curve of a score, by default the evidence, over some of the targets."""
        kept = np.ones(len(self.present), dtype=bool) if among is None else among
        return Roc.of((self.evidence if score is None else score)[kept], self.present[kept])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectionLimit:
    """How many inclusions of a size and depth are found, by a threshold that other blanks chose.

    Attributes
    ----------
    wanted
        Specificity that the threshold was chosen for.
    specificity
        On the blanks that had no part in the choice.
    found
        Of each cell of `DIAMETERS_MM` and `DEPTHS_MM`, None where no target fell.
    """

    wanted: float
    specificity: Proportion
    found: tuple[tuple[Proportion | None, ...], ...]
    decided: NDArray[np.bool_]


def detection_limit(searched: Searched, wanted: float, score: NDArray[np.float64] | None = None) -> DetectionLimit:
    """Choose a threshold on every other blank; judge it on the other blanks and all inclusions; then change places.

    Every blank is decided once, by a threshold that it had no part in; inclusions are decided by the threshold of one
    half or the other in turn.
    """
    said = searched.evidence if score is None else score
    half = np.empty(len(said), dtype=int)
    for kind in (True, False):
        half[searched.present == kind] = np.arange(np.count_nonzero(searched.present == kind)) % 2
    decided = np.empty(len(said), dtype=bool)
    for part in (0, 1):
        choosing = searched.present | (half == part)
        point = at_specificity(Roc.of(said[choosing], searched.present[choosing]), wanted)
        decided[half != part] = point.decide(said[half != part])
    blanks = ~searched.present
    return DetectionLimit(
        wanted=wanted,
        specificity=Proportion(
            successes=int(np.count_nonzero(~decided & blanks)), trials=int(np.count_nonzero(blanks))
        ),
        found=_by_cell(searched, decided),
        decided=decided,
    )


def _by_cell(searched: Searched, decided: NDArray[np.bool_]) -> tuple[tuple[Proportion | None, ...], ...]:
    size, depth = (
        np.digitize(searched.truth[:, axis], ends[1:-1]) for axis, ends in ((0, DIAMETERS_MM), (1, DEPTHS_MM))
    )

    def cell(i: int, j: int) -> Proportion | None:
        here = searched.present & (size == i) & (depth == j)
        trials = int(np.count_nonzero(here))
        return Proportion(successes=int(np.count_nonzero(decided & here)), trials=trials) if trials else None

    return tuple(
        tuple(cell(i, j) for j in range(len(DEPTHS_MM) - 1)) for i in range(len(DIAMETERS_MM) - 1)
    )  # fmt: skip


def areas_by(searched: Searched, name: str, parts: int = 3) -> list[tuple[str, Roc]]:
    """Curves over thirds of a nuisance: what blanks have too is parted on both sides."""
    values = searched.truth[:, 2] if name == "young_kpa" else getattr(searched, name)
    of_inclusions = name in ("young_kpa", "offset_mm")
    ends = np.quantile(values[searched.present] if of_inclusions else values, np.linspace(0, 1, parts + 1))
    place = np.digitize(values, ends[1:-1])
    return [
        (
            f"{name} {ends[part]:.3g} to {ends[part + 1]:.3g}",
            searched.curve((place == part) | (~searched.present & of_inclusions)),
        )
        for part in range(parts)
    ]


def reaches(searched: Searched, limit: DetectionLimit, *, probability: float) -> list[tuple[float, float, float]]:
    """Diameter, depth and how far beside the axis inclusions are found with a probability, cell by cell.

    A cell's row names its smallest diameter and greatest depth: those of its inclusions that are hardest to find. No
    cell is said to reach farther than one of larger, shallower inclusions: chance in few trials promises nothing.
    """
    size, depth = searched.truth[:, 0], searched.truth[:, 1]

    def reach(low: float, high: float, top: float, bottom: float) -> float:
        here = searched.present & (size >= low) & (size < high) & (depth >= top) & (depth < bottom)
        if not here.any():
            return 0.0
        return detection_range_of_trials(searched.offset_mm[here], limit.decided[here], probability=probability)

    table = np.array([[reach(*sizes, *depths) for depths in pairwise(DEPTHS_MM)] for sizes in pairwise(DIAMETERS_MM)])
    table = np.minimum.accumulate(np.minimum.accumulate(table[::-1], axis=0)[::-1], axis=1)
    return [
        (low, bottom, float(table[i, j]))
        for i, low in enumerate(DIAMETERS_MM[:-1])
        for j, bottom in enumerate(DEPTHS_MM[1:])
    ]


def clipped(probabilities: NDArray[np.float64]) -> NDArray[np.float64]:
    """Probabilities for logits: those that were rounded to 0 or 1 a little inside."""
    return np.clip(probabilities, 1 - FARTHEST_OUT, FARTHEST_OUT)


def counted(flags: Iterable[Sequence[str]]) -> dict[str, int]:
    """How often each flag was raised, the most frequent first."""
    names: dict[str, int] = {}
    for each in flags:
        for name in each:
            names[name] = names.get(name, 0) + 1
    return dict(sorted(names.items(), key=lambda one: -one[1]))

"""How many inclusions were found among small and large, shallow and deep ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.detection import Proportion

if TYPE_CHECKING:
    from tsis.study.judged import DeviceResults

EDGES_MM = {"diameter_mm": (5.0, 8.0), "depth_mm": (6.0, 8.0)}  # a value at an edge belongs below it, but sizes above


@dataclass(frozen=True, slots=True, kw_only=True)
class Stratum:
    """Inclusions of like size or depth.

    Attributes
    ----------
    quantity
        ``"diameter_mm"`` or ``"depth_mm"``.
    low, high
        Ends, mm; infinite where there is none.
    found
        Found among those that were decided; None where there was none.
    undecided
        How many more were read without an answer.
    """

    quantity: str
    low: float
    high: float
    found: Proportion | None
    undecided: int


def strata(judged: DeviceResults) -> tuple[Stratum, ...]:
    """Inclusions by size, then by depth."""
    return tuple(
        _of(judged, quantity, low, high)
        for quantity, edges in EDGES_MM.items()
        for low, high in zip((0.0, *edges), (*edges, math.inf), strict=True)
    )


def _of(judged: DeviceResults, quantity: str, low: float, high: float) -> Stratum:
    def inside(value: float) -> bool:
        return low <= value < high if quantity == "diameter_mm" else low < value <= high

    held = [one for one in judged.targets if one.truth.has_inclusion and inside(one.truth.values[quantity])]
    decided = [one for one in held if one.score is not None]
    found = sum(judged.calls(one) for one in decided)
    return Stratum(
        quantity=quantity,
        low=low,
        high=high,
        found=Proportion(successes=found, trials=len(decided)) if decided else None,
        undecided=sum(one.reading is not None and one.score is None for one in held),
    )


__all__ = ["EDGES_MM", "Stratum", "strata"]

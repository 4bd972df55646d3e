"""Solves, time and error of a surrogate over the width of its box, and over the number of quantities that vary."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from benchmarks.curves.curve import Curve, Line
from benchmarks.mechanics import PROBE

from tsis.mechanics.surrogate.building import build_surrogate
from tsis.mechanics.surrogate.polynomial import Box, Degrees

if TYPE_CHECKING:
    from collections.abc import Callable

WIDTHS = (0.125, 0.25, 0.5, 1.0)  # of the default box, in the logarithm around its middle
WANTED = 1e-3  # of the mean pressure
LADDER = (2, 3, 4, 5, 6, 7, 9, 11, 13)  # points along the diameter, the first that holds the error is taken
FIXED = Degrees(diameter=5, depth=3)
NARROW = 1e-3
VARIED = ("diameter_mm", "depth_mm", "young_kpa", "tissue_young_kpa", "thickness_mm")


@dataclass(frozen=True, slots=True, kw_only=True)
class Built:
    """One surrogate: slabs with inclusions that were solved, presses on them, core-seconds, and error."""

    slabs: int
    presses: int
    seconds: float
    error: float


def over_width(told: Callable[[str], None]) -> Curve:
    """The least degrees that hold the error, and the error of degrees that stay the same."""
    least, fixed = [], []
    for width in WIDTHS:
        told(f"surrogate of a box {width:g} as wide as the default")
        box = boxed(dict.fromkeys(VARIED, width))
        least.append(_least(box))
        fixed.append(built(box, FIXED))
    return Curve(
        title="Surrogate",
        size_name="width of the box over that of the default",
        lines=(
            Line(
                name=f"slabs for an error of {WANTED:.1%}",
                unit="slabs",
                size=WIDTHS,
                value=tuple(one.slabs for one in least),
            ),
            Line(name="building it", unit="core-s", size=WIDTHS, value=tuple(one.seconds for one in least)),
            Line(
                name=f"error of {fixed[0].slabs} slabs",
                unit="%",
                size=WIDTHS,
                value=tuple(100 * one.error for one in fixed),
            ),
        ),
    )


def over_dimensions(told: Callable[[str], None]) -> list[tuple[str, Built]]:
    """The default box with the first quantities varied and the others held; by the quantity that joined."""
    found = []
    for count, name in enumerate(VARIED, start=1):
        told(f"surrogate of {count} quantities")
        widths = {other: 1.0 if number < count else NARROW for number, other in enumerate(VARIED)}
        chosen = dict(zip(("diameter", "depth", "contrast", "tissue", "thickness"), (11, 7, 3, 3, 3), strict=True))
        degrees = {other: points if number < count else 1 for number, (other, points) in enumerate(chosen.items())}
        plain = 6 if count > 3 else 1
        found.append((name, built(boxed(widths), Degrees(**degrees, baseline=plain))))
    return found


def boxed(widths: dict[str, float]) -> Box:
    """The default box with its ranges narrowed in the logarithm around their geometric middles.

    Examples
    --------
    >>> box = boxed({"depth_mm": 0.5})
    >>> [round(end, 3) for end in box.depth_mm], box.diameter_mm
    ([5.264, 9.118], (1.0, 15.0))
    """
    default = Box()
    ranges: dict[str, Any] = {}
    for name, width in widths.items():
        low, high = map(math.log, getattr(default, name))
        middle, half = (low + high) / 2, (high - low) / 2 * width
        if width < 1:  # the ends of the default are kept to the last digit
            ranges[name] = (math.exp(middle - half), math.exp(middle + half))
    return replace(default, **ranges)


def built(box: Box, degrees: Degrees) -> Built:
    """Build one anew on all cores; its checks and plain tissue are part of the processor time."""
    began = time.process_time()
    found = build_surrogate(PROBE, box, degrees=degrees, cached=False)
    slabs = degrees.diameter * degrees.depth * degrees.thickness
    return Built(
        slabs=slabs,
        presses=slabs * degrees.contrast * degrees.tissue,
        seconds=time.process_time() - began,
        error=found.error,
    )


def _least(box: Box) -> Built:
    for points in LADDER:
        degrees = Degrees(diameter=points, depth=max(2, round(points * 7 / 11)))
        found = built(box, degrees)
        if found.error <= WANTED:
            return found
    return found

"""A figure or table of the source beside what is found here: the values are kept in one file each.

``studies/values/figure-5-3.json`` holds, for every quantity, what the source prints (null where it prints no number),
what is found here, how far a fresh run may lie from that, and either how far the printed value may lie from it or the
reason why they differ. Whatever differs without a reason is an error.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    from matplotlib.figure import Figure

VALUES = Path(__file__).parent / "values"
DIGITS = 6  # of the numbers that are kept
ROUNDING = 10.0 ** (1 - DIGITS)  # so far a number may lie from the kept one, as a share


@dataclass(frozen=True, slots=True, kw_only=True)
class Value:
    """One quantity of a figure or table.

    Attributes
    ----------
    quantity, unit
        What it is; the unit is empty for pure numbers.
    printed
        What the source prints; None where it prints no number.
    ours
        What is found here.
    repeats_within
        How far a fresh run may lie from ``ours``, in the same unit; 0 where nothing is random.
    tolerance
        How far the printed value may lie from ours, in the same unit; None where a reason says why it lies elsewhere.
    reason
        Why ours differs from the printed value.
    """

    quantity: str
    unit: str
    printed: float | None
    ours: float
    repeats_within: float
    tolerance: float | None = None
    reason: str = ""

    def __post_init__(self) -> None:
        held = (self.ours, self.repeats_within, *(each for each in (self.printed, self.tolerance) if each is not None))
        if not all(math.isfinite(each) for each in held):
            raise ValueError(f"values of {self.quantity!r} must be finite; got {held}")
        if self.printed is None:
            return
        if self.tolerance is None and not self.reason:
            raise ValueError(f"{self.quantity!r} needs a tolerance, or a reason why it differs from the printed value")
        if self.tolerance is not None and abs(self.ours - self.printed) > self.tolerance:
            raise ValueError(
                f"{self.quantity!r} must lie within {self.tolerance:g} of the printed {self.printed:g}; "
                f"got {self.ours:g}: say why"
            )

    def repeats(self, fresh: float) -> bool:
        """Whether a fresh run found the same; numbers that nothing random enters may differ by rounding."""
        return abs(fresh - self.ours) <= self.repeats_within + ROUNDING * abs(self.ours)


@dataclass(frozen=True, slots=True, kw_only=True)
class Beside:
    """What a values file holds.

    Attributes
    ----------
    name
        Of the file, as ``"figure-5-3"``.
    title, section
        What the source calls it, and where.
    says, found
        What the source reads from it, and what is found here, a sentence or two each.
    values
        Quantities in the order in which they are shown.
    """

    name: str
    title: str
    section: str
    says: str
    found: str
    values: tuple[Value, ...]

    def differing(self, fresh: Mapping[str, float]) -> list[str]:
        """Sentences about quantities that a fresh run did not find again; it may have found only some of them."""
        known = {value.quantity: value for value in self.values}
        unknown = [f"{self.name}: {quantity} is in no values file" for quantity in fresh if quantity not in known]
        return unknown + [
            f"{self.name}: {quantity} is {found:.6g} now and was {known[quantity].ours:.6g} "
            f"± {known[quantity].repeats_within:g}"
            for quantity, found in fresh.items()
            if quantity in known and not known[quantity].repeats(found)
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """A figure or table of the source that is made here.

    Attributes
    ----------
    name
        As ``"figure-5-3"``; that of its values file and of its picture.
    run
        The study, as ``run(rng)``; figures that share it run it once.
    values
        Numbers by quantity, from what it found.
    draw
        Draws it, on an empty figure; None for a table of numbers alone.
    short
        A cheaper run of the same, for tests, from which ``values`` may find fewer quantities; None where the study
        takes a few seconds anyway.
    needs
        A file that the study reads and that may not be copied into this repository; None where it needs none.
    """

    name: str
    run: Callable[[np.random.Generator], Any]
    values: Callable[[Any], Mapping[str, float]]
    draw: Callable[[Any, Figure], None] | None = None
    short: Callable[[np.random.Generator], Any] | None = None
    needs: Path | None = None

    def absent(self) -> str:
        """Why it cannot be made here; empty when it can."""
        if self.needs is None or self.needs.is_file():
            return ""
        return f"{self.name} needs {self.needs.name}, which others published and is not part of this repository"


def read_values(name: str) -> Beside:
    """Read a values file.

    Raises
    ------
    ValueError
        When it holds something else, or a difference without a reason.
    """
    held = json.loads((VALUES / f"{name}.json").read_text())
    try:
        values = tuple(Value(**each) for each in held.pop("values"))
        return Beside(name=name, values=values, **held)
    except (TypeError, KeyError) as error:
        raise ValueError(f"{name}.json must hold title, section, says, found and values: {error}") from error


def write_ours(name: str, fresh: Mapping[str, float]) -> None:
    """Put freshly found numbers into a values file; whatever else it says stays."""
    path = VALUES / f"{name}.json"
    held = json.loads(path.read_text())
    for each in held["values"]:
        if each["quantity"] in fresh:
            each["ours"] = float(f"{fresh[each['quantity']]:.{DIGITS}g}")
    path.write_text(json.dumps(held, indent=2, ensure_ascii=False) + "\n")

"""Numbers that were measured, and where they are wanted: a benchmark that misses one says which, and ends with 1."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """One number.

    Attributes
    ----------
    name, value
        What was measured.
    least, most
        Where it is wanted, both included; anywhere by default.
    form
        How a value is shown, as of `str.format`.
    """

    name: str
    value: float
    least: float = -math.inf
    most: float = math.inf
    form: str = "{:.1f}"

    @property
    def met(self) -> bool:
        """Whether it lies there; what is not a number does not."""
        unbounded = math.isinf(self.least) and math.isinf(self.most)
        return unbounded or self.least <= self.value <= self.most

    @property
    def shown(self) -> str:
        """The value."""
        return self.form.format(self.value)

    @property
    def wish(self) -> str:
        """Where it is wanted; empty for anywhere."""
        ends = ((">=", self.least), ("<=", self.most))
        return " and ".join(f"{sign} {self.form.format(end)}" for sign, end in ends if math.isfinite(end))

    @property
    def row(self) -> tuple[str, str, str]:
        """Name, value and wish."""
        return self.name, self.shown, self.wish


def told(found: Iterable[Wanted]) -> int:
    """Print a line for each number that was missed; the exit code of the program."""
    missed = [each for each in found if not each.met]
    for each in missed:
        print(f"missed: {each.name} is {each.shown}, wanted {each.wish}")
    return int(bool(missed))

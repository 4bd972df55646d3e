"""Measured numbers and their goals: a benchmark that misses one says which, and ends with 1."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A measured number and its goal.

    Attributes
    ----------
    name, value
        What was measured.
    least, most
        Its bounds, both included; none by default.
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
        """Whether the value lies within its bounds; what is not a number does not."""
        unbounded = math.isinf(self.least) and math.isinf(self.most)
        return unbounded or self.least <= self.value <= self.most

    @property
    def shown(self) -> str:
        """The value."""
        return self.form.format(self.value)

    @property
    def goal(self) -> str:
        """The bounds as a text; empty without any."""
        ends = ((">=", self.least), ("<=", self.most))
        return " and ".join(f"{sign} {self.form.format(end)}" for sign, end in ends if math.isfinite(end))

    @property
    def row(self) -> tuple[str, str, str]:
        """Name, value and goal."""
        return self.name, self.shown, self.goal


def missed_goals(numbers: Iterable[Goal]) -> int:
    """Print a line for each missed number; the exit code of the program."""
    missed = [number for number in numbers if not number.met]
    for number in missed:
        print(f"missed: {number.name} is {number.shown}, its goal {number.goal}")
    return int(bool(missed))

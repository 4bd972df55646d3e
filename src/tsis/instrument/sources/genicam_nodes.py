"""The features of a GenICam camera, as Basler's, Allied Vision's and Harvesters' libraries all offer them.

Each library wraps the same node map in classes of its own. `Nodes` is the little that is needed of it: two kinds of
values to read, one call to write.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberNode:
    """A number that a camera holds; a switch is a number from 0 to 1.

    Parameters
    ----------
    value
        What it is now.
    low, high
        The range that the camera takes in its present state, ends included.
    step
        Distance of the values that it takes, counted from ``low``; 0 where any will do.
    unit
        As the camera names it, e.g. ``"us"``; empty when it does not.
    """

    value: float
    low: float = -math.inf
    high: float = math.inf
    step: float = 0.0
    unit: str = ""

    def nearest(self, value: float) -> float:
        """The value nearest to ``value`` that the camera takes.

        Examples
        --------
        >>> NumberNode(value=0, low=2, high=10, step=4).nearest(7.9)
        6.0
        >>> NumberNode(value=0, low=2, high=9, step=4).nearest(100)
        6.0
        """
        if self.step <= 0 or not math.isfinite(self.low):
            return float(min(max(value, self.low), self.high))
        last = math.inf if math.isinf(self.high) else math.floor((self.high - self.low) / self.step)
        return float(self.low + min(max(round((value - self.low) / self.step), 0), last) * self.step)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChoiceNode:
    """A word that a camera holds, out of those that it takes now."""

    value: str
    options: tuple[str, ...]


class Nodes(Protocol):
    """The node map of one open camera."""

    def read(self, name: str) -> NumberNode | ChoiceNode | None:
        """What the camera holds under that name; None when there is no such feature or it cannot be read now."""

    def write(self, name: str, value: float | str) -> None:
        """Change it; the errors of its library when the camera refuses."""


def number_node(nodes: Nodes, name: str) -> NumberNode | None:
    """The number of that name, or None."""
    held = nodes.read(name)
    return held if isinstance(held, NumberNode) else None


def choice_node(nodes: Nodes, name: str) -> ChoiceNode | None:
    """The word of that name, or None."""
    held = nodes.read(name)
    return held if isinstance(held, ChoiceNode) else None


def first_number(nodes: Nodes, names: Iterable[str]) -> tuple[str, NumberNode] | None:
    """The first of the names that the camera holds a number under: newer names come before older ones."""
    for name in names:
        held = number_node(nodes, name)
        if held is not None:
            return name, held
    return None


def set_choice(nodes: Nodes, name: str, option: str) -> None:
    """Set a word, where the camera has it, offers that option, and holds another."""
    held = choice_node(nodes, name)
    if held is not None and held.value != option and option in held.options:
        nodes.write(name, option)

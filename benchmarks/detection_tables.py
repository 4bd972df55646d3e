"""What tables of a large study are made of."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

from benchmarks.tables import show

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.study.proportions import Proportion
    from tsis.study.roc import Roc


class Printed:
    """Tables, printed unless only a program reads."""

    def __init__(self, *, markdown: bool, quiet: bool) -> None:
        self._markdown, self._quiet = markdown, quiet

    def table(self, title: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Print a table."""
        if not self._quiet:
            show(title, heads, rows, markdown=self._markdown)

    def line(self, text: str) -> None:
        """Print a line."""
        if not self._quiet:
            print(text)


def area(curve: Roc) -> dict[str, Any]:
    """Area with its interval, as plain values."""
    within = curve.auc_interval()
    return {
        "auc": curve.auc,
        "interval": [within.low, within.high],
        "method": within.method,
        "inclusions": curve.targets,
        "blanks": curve.blanks,
    }


def area_cells(one: Mapping[str, Any]) -> list[str]:
    """The same for a table."""
    low, high = one["interval"]
    return [f"{one['inclusions']}, {one['blanks']}", f"{one['auc']:.4f}", f"{low:.4f} to {high:.4f}", one["method"]]


def pairs(ends: tuple[float, ...]) -> list[tuple[float, float]]:
    """Ends of neighbouring cells."""
    return list(pairwise(ends))


def share(one: Proportion | None) -> str:
    """A share with Wilson's interval and the number of targets."""
    if one is None:
        return "-"
    low, high = one.interval()
    return f"{one.value:.2f} ({low:.2f}-{high:.2f}), {one.trials}"

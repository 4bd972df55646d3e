"""A curve: what was measured at growing sizes, and the power of the size that it follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One quantity at several sizes.

    Attributes
    ----------
    name, unit
        What it is.
    size, value
        Where it was measured, and what was found; both positive.
    fit_from
        Size from which the exponent is fitted, because smaller ones are ruled by something else.
    """

    name: str
    unit: str
    size: tuple[float, ...]
    value: tuple[float, ...]
    fit_from: float = 0.0

    @property
    def exponent(self) -> float:
        """Slope of the logarithm of the value over that of the size, by least squares.

        Examples
        --------
        >>> round(Line(name="n", unit="s", size=(1, 2, 4), value=(3.0, 12.0, 48.0)).exponent, 6)
        2.0
        """
        kept = [(size, value) for size, value in zip(self.size, self.value, strict=True) if size >= self.fit_from]
        sizes, values = np.log(np.array(kept)).T
        return float(np.polyfit(sizes, values, 1)[0])

    @property
    def label(self) -> str:
        """Name, unit and exponent."""
        return f"{self.name}, {self.unit} (exponent {self.exponent:+.2f})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Lines over one kind of size.

    Attributes
    ----------
    title, size_name
        What is shown, and over what.
    lines
        What was measured.
    """

    title: str
    size_name: str
    lines: tuple[Line, ...]

    def table(self) -> tuple[list[str], list[list[str]]]:
        """Heads and rows: a row a size, then the exponents."""
        sizes = sorted({size for line in self.lines for size in line.size})
        found = [dict(zip(line.size, line.value, strict=True)) for line in self.lines]
        rows = [
            [
                f"{size:,.4g}" if size < 1 else f"{size:,.0f}",
                *(f"{one[size]:.3g}" if size in one else "" for one in found),
            ]
            for size in sizes
        ]
        heads = [self.size_name, *(f"{line.name}, {line.unit}" for line in self.lines)]
        return heads, [*rows, ["exponent", *(f"{line.exponent:+.2f}" for line in self.lines)]]

"""Name, symbol, unit and rounding of every estimated quantity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.model.estimate import NO_UNIT, label_of, unit_of

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityLabel:
    """How a quantity is named, and to how many decimals an error of it is shown."""

    label: str
    symbol: str = ""
    unit: str = ""
    decimals: int = 2

    @property
    def title(self) -> str:
        """Name and symbol, for the head of a main result."""
        return f"{self.label[:1].upper()}{self.label[1:]} {self.symbol}".strip()

    @property
    def heading(self) -> str:
        """Name over unit."""
        return f"{self.label} / {self.unit}" if self.unit else self.label

    @property
    def axis(self) -> str:
        """Name and symbol over unit."""
        name = f"{self.label} {self.symbol}".strip()
        return f"{name} / {self.unit}" if self.unit else name


def counted(count: int, what: str) -> str:
    """A number of things.

    Examples
    --------
    >>> counted(1, "frame"), counted(2, "frame"), counted(2, "press")
    ('1 frame', '2 frames', '2 presses')
    """
    plural = f"{what}es" if what.endswith("s") else f"{what}s"
    return f"{count} {what if count == 1 else plural}"


def plain_number(value: float, digits: int = 4) -> str:
    """A number rounded to so many digits, in full where it is large.

    Examples
    --------
    >>> plain_number(2_518_734.0), plain_number(12.3456), plain_number(2_518_734.0, 3)
    ('2,519,000', '12.35', '2,520,000')
    """
    text = f"{value:.{digits}g}"
    return f"{float(text):,.0f}" if 1e3 <= abs(value) < 1e15 and "e" in text else text


KNOWN = {
    "diameter_mm": QuantityLabel(label="diameter", symbol="d", unit="mm"),
    "depth_mm": QuantityLabel(label="depth", symbol="h", unit="mm"),
    "young_kpa": QuantityLabel(label="modulus", symbol="E", unit="kPa", decimals=1),
    "score": QuantityLabel(label="score"),
}


def quantity_of(name: str) -> QuantityLabel:
    """The quantity of a parameter; that of a plug-in is named after its parameter.

    Examples
    --------
    >>> quantity_of("depth_mm").axis, quantity_of("depth_mm").heading, quantity_of("young_kpa").title
    ('depth h / mm', 'depth / mm', 'Modulus E')
    """
    unit = unit_of(name)
    return KNOWN.get(name) or QuantityLabel(label=label_of(name), unit="" if unit == NO_UNIT else unit)


def in_order(values: Mapping[str, float]) -> dict[str, float]:
    """Values by quantity in the order in which cards, tables and figures have them: d, h, E, then others.

    Examples
    --------
    >>> in_order({"young_kpa": 80.0, "depth_mm": 5.0, "other": 1.0, "diameter_mm": 10.0})
    {'diameter_mm': 10.0, 'depth_mm': 5.0, 'young_kpa': 80.0, 'other': 1.0}
    """
    known = [name for name in KNOWN if name in values]
    return {name: values[name] for name in (*known, *(name for name in values if name not in KNOWN))}

"""The page that sets every figure and table of the source beside what is found here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from studies.catalogue import SHOWN
from studies.shown import VALUES, read_values

if TYPE_CHECKING:
    from pathlib import Path

    from studies.shown import Beside, Value

PICTURES = "images/figures"
HEADINGS = "| | printed | here | |\n| --- | --- | --- | --- |"


def page(root: Path) -> str:
    """All of it, in Markdown.

    Parameters
    ----------
    root
        Of the repository, in which pictures are looked for.
    """
    return "\n\n".join(_part(read_values(shown.name), root) for shown in SHOWN) + "\n"


def sources() -> list[Path]:
    """Files that the page is made of."""
    return sorted(VALUES.glob("*.json"))


def _part(one: Beside, root: Path) -> str:
    parts = [f"## {one.title}", f"*Section {one.section}.* The source: {one.says}", f"Here: {one.found}"]
    if (root / "docs" / PICTURES / f"{one.name}.png").exists():
        parts.append(f"```{{image}} {PICTURES}/{one.name}.png\n:alt: {one.title}, made here\n```")
    parts.append("\n".join([HEADINGS, *(_row(value) for value in one.values)]))
    return "\n\n".join(parts)


def _row(value: Value) -> str:
    printed = "" if value.printed is None else _number(value.printed, value.unit)
    within = f" ± {value.repeats_within:.2g}" if value.repeats_within else ""
    said = value.reason if value.tolerance is None else f"within {_number(value.tolerance, value.unit)}"
    return f"| {value.quantity} | {printed} | {_number(value.ours, value.unit)}{within} | {said} |"


def _number(number: float, unit: str) -> str:
    return f"{number:.4g} {unit}".rstrip()

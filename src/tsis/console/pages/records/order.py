"""Which targets a list shows: those that were searched for, in the order and on the sheet that was asked for."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from tsis.records import TargetSummary

ALL, ESTIMATED, NOT_ESTIMATED = "all", "estimated", "not estimated"
KINDS = (ALL, ESTIMATED, NOT_ESTIMATED)
SHEETS = (25, 50, 100)  # rows of a sheet that one may choose
NEVER = datetime.min.replace(tzinfo=UTC)
KEYS: dict[str, Callable[[TargetSummary], Any]] = {
    "number": lambda each: each.target.number,
    "name": lambda each: each.target.name.casefold(),
    "presses": lambda each: each.presses,
    "estimates": lambda each: each.estimates,
    "last": lambda each: each.last or NEVER,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What was asked for.

    Attributes
    ----------
    search
        Part of a name, or how a number begins; case does not matter.
    kind
        ``"all"``, ``"estimated"`` or ``"not estimated"``.
    column, descending
        By what to sort, and in which direction.
    sheet, rows
        Which sheet, from 1, and rows of one.
    """

    search: str = ""
    kind: str = ALL
    column: str = "number"
    descending: bool = False
    sheet: int = 1
    rows: int = SHEETS[1]

    @classmethod
    def asked(cls, pagination: Mapping[str, Any], *, search: str, kind: str) -> Order:
        """What the table in a browser asks for; anything odd in it becomes what a new page shows."""
        column, sheet, rows = (pagination.get(name) for name in ("sortBy", "page", "rowsPerPage"))
        return cls(
            search=search,
            kind=kind if kind in KINDS else ALL,
            column=column if isinstance(column, str) and column in KEYS else "number",
            descending=pagination.get("descending") is True,
            sheet=sheet if isinstance(sheet, int) and sheet > 0 else 1,
            rows=next((each for each in SHEETS if each == rows), SHEETS[1]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """A sheet of a list: its targets, its number, and how many targets all sheets hold."""

    targets: tuple[TargetSummary, ...]
    sheet: int
    found: int


def sheet_of(targets: Sequence[TargetSummary], order: Order) -> Sheet:
    """The targets to show; a sheet behind the last one is the last one."""
    wanted = order.search.strip().casefold()
    found = [each for each in targets if _is_wanted(each, wanted, order.kind)]
    found.sort(key=lambda each: each.target.number)
    found.sort(key=KEYS[order.column], reverse=order.descending)  # stable: equal ones stay by number
    sheet = min(order.sheet, max(1, -(-len(found) // order.rows)))
    begin = (sheet - 1) * order.rows
    return Sheet(targets=tuple(found[begin : begin + order.rows]), sheet=sheet, found=len(found))


def _is_wanted(each: TargetSummary, wanted: str, kind: str) -> bool:
    if kind != ALL and (each.estimates > 0) != (kind == ESTIMATED):
        return False
    return wanted in each.target.name.casefold() or str(each.target.number).startswith(wanted)

"""List of targets: search, order and page."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from nicegui import ui

from tsis.console.pages.components import follow_store, panel_title
from tsis.console.pages.records._transfer import import_button, verify_button
from tsis.report.target import count_of, time_text

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from nicegui.events import GenericEventArguments

    from tsis.console.pages.components import Viewer
    from tsis.console.services import Instrument
    from tsis.records.store import TargetSummary


ALL, ESTIMATED, NOT_ESTIMATED = "all", "estimated", "not estimated"
KINDS = (ALL, ESTIMATED, NOT_ESTIMATED)
SHEETS = (25, 50, 100)  # rows of a sheet that one may choose
NEVER = datetime.min.replace(tzinfo=UTC)
KEYS: dict[str, Callable[[TargetSummary], Any]] = {
    "number": lambda item: item.target.number,
    "name": lambda item: item.target.name.casefold(),
    "presses": lambda item: item.presses,
    "estimates": lambda item: item.estimates,
    "last": lambda item: item.last or NEVER,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """The request of a list: part of a name or the start of a number, kind, order and page."""

    search: str = ""
    kind: str = ALL  # one of KINDS
    column: str = "number"
    descending: bool = False
    sheet: int = 1  # page, from 1
    rows: int = SHEETS[1]  # of a page

    @classmethod
    def requested(cls, pagination: Mapping[str, Any], *, search: str, kind: str) -> Order:
        """The request of a browser's table; invalid values become defaults."""
        column, sheet, rows = (pagination.get(name) for name in ("sortBy", "page", "rowsPerPage"))
        return cls(
            search=search,
            kind=kind if kind in KINDS else ALL,
            column=column if isinstance(column, str) and column in KEYS else "number",
            descending=pagination.get("descending") is True,
            sheet=sheet if isinstance(sheet, int) and sheet > 0 else 1,
            rows=next((sheet for sheet in SHEETS if sheet == rows), SHEETS[1]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """A page of a list: its targets, its number, and the number of all targets."""

    targets: tuple[TargetSummary, ...]
    sheet: int
    total: int


def sheet_of(targets: Sequence[TargetSummary], order: Order) -> Sheet:
    """The targets to show; a page beyond the last becomes the last."""
    requested = order.search.strip().casefold()
    results = [target for target in targets if _is_requested(target, requested, order.kind)]
    results.sort(key=lambda item: item.target.number)
    results.sort(key=KEYS[order.column], reverse=order.descending)  # stable: equal ones stay by number
    sheet = min(order.sheet, max(1, -(-len(results) // order.rows)))
    begin = (sheet - 1) * order.rows
    return Sheet(targets=tuple(results[begin : begin + order.rows]), sheet=sheet, total=len(results))


def _is_requested(summary: TargetSummary, search: str, kind: str) -> bool:
    if kind != ALL and (summary.estimates > 0) != (kind == ESTIMATED):
        return False
    return search in summary.target.name.casefold() or str(summary.target.number).startswith(search)


COLUMNS = (
    ("number", "Number", "left"),
    ("name", "Name", "left"),
    ("presses", "Presses", "right"),
    ("estimates", "Estimates", "right"),
    ("last", "Last press (UTC)", "left"),
)
LINK = '<q-td :props="props"><a class="link" :href="props.row.address">{{ props.value }}</a></q-td>'
BEGIN = (
    "Nothing is saved yet. Start the camera on the page Examine and take a snapshot: it becomes the first press of a "
    "target. A bundle of another store can be imported here. On the command line, tsis demo --save fills a store."
)


def target_listing(instrument: Instrument, viewer: Viewer) -> None:
    """Build the list."""
    with ui.element("section").classes("panel stack"):
        with ui.element("div").classes("row"):
            panel_title("Targets")
            count = ui.label().classes("muted")
            ui.element("div").classes("spring")
            buttons = ui.element("div").classes("row")
        below = ui.element("div")
        with buttons:
            verify_button(instrument, viewer, below)
            import_button(instrument, viewer, below)
        targets = _TargetTable(instrument, viewer, count)
    follow_store(viewer, targets.load)


class _TargetTable:
    """The table of targets, and its request."""

    def __init__(self, instrument: Instrument, viewer: Viewer, count: ui.label) -> None:
        self._instrument, self._viewer, self._count = instrument, viewer, count
        self._targets: tuple[TargetSummary, ...] = ()
        self._order = Order()
        with ui.element("div").classes("row") as self._request:
            self._search = ui.input("Search number or name", on_change=self._requested).props(
                "dense outlined clearable debounce=200"
            )
            self._kind = (
                ui.select(list(KINDS), value=KINDS[0], label="Show", on_change=self._requested)
                .props("dense outlined")
                .classes("kind-choice")
            )
        self._empty = ui.label(BEGIN).classes("muted")
        self._table = ui.table(
            rows=[],
            columns=[
                {"name": name, "label": label, "field": name, "align": align, "sortable": True}
                for name, label, align in COLUMNS
            ],
            row_key="number",
            pagination=self._pages(sheet_of((), self._order)),  # else it asks for a sheet of its own making
        )
        self._table.props(
            f'flat dense :rows-per-page-options="{list(SHEETS)}" rows-per-page-label="Targets on a sheet"'
        ).classes("targets")
        for name in ("number", "name"):
            self._table.add_slot(f"body-cell-{name}", LINK)
        self._table.on("request", self._page_changed)
        self._table.on_pagination_change(self._notified)
        for part in (self._request, self._empty, self._table):
            part.set_visibility(False)

    async def load(self) -> None:
        """Read the list anew."""
        targets = await self._viewer.attempt(self._instrument.store.targets)
        if targets is None:
            return
        self._targets = targets
        presses = sum(target.presses for target in targets)
        kind = self._instrument.store.kind
        self._count.text = f"{count_of(len(targets), 'target')} ({kind}s), {count_of(presses, 'press')}"
        self._empty.set_visibility(not targets)
        self._request.set_visibility(bool(targets))
        self._table.set_visibility(bool(targets))
        self._show()

    def _requested(self) -> None:
        self._order = replace(self._order, search=self._search.value or "", kind=self._kind.value, sheet=1)
        self._show()

    def _page_changed(self, event: GenericEventArguments) -> None:
        pagination = event.args.get("pagination") if isinstance(event.args, dict) else None
        requested: dict[str, Any] = pagination if isinstance(pagination, dict) else {}
        self._order = Order.requested(requested, search=self._order.search, kind=self._order.kind)
        self._show()

    def _notified(self) -> None:
        """Restore the pagination after a slow browser has sent an older one."""
        pages = self._pages(sheet_of(self._targets, self._order))
        if self._table.pagination != pages:
            self._table.pagination = pages

    def _show(self) -> None:
        sheet = sheet_of(self._targets, self._order)
        self._table.rows = [_row(target) for target in sheet.targets]
        self._table.pagination = self._pages(sheet)

    def _pages(self, sheet: Sheet) -> dict[str, Any]:
        """Pagination for the browser's table."""
        return {
            "sortBy": self._order.column,
            "descending": self._order.descending,
            "page": sheet.sheet,
            "rowsPerPage": self._order.rows,
            "rowsNumber": sheet.total,
        }


def _row(summary: TargetSummary) -> dict[str, Any]:
    return {
        "number": summary.target.number,
        "name": summary.target.name or "(no name)",
        "presses": summary.presses,
        "estimates": summary.estimates,
        "last": "never" if summary.last is None else time_text(summary.last),
        "address": f"/records/{summary.target.number}",
    }

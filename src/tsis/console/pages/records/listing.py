"""The list of targets: searched, sorted, a sheet at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.importing import import_button
from tsis.console.pages.records.order import KINDS, SHEETS, Order, sheet_of
from tsis.console.pages.records.verifying import verify_button
from tsis.console.pages.store_changes import follow_store
from tsis.report.target_words import count_of, time_text

if TYPE_CHECKING:
    from nicegui.events import GenericEventArguments

    from tsis.console.bench import Bench
    from tsis.console.pages.records.order import Sheet
    from tsis.console.pages.viewer import Viewer
    from tsis.records import TargetSummary

COLUMNS = (
    ("number", "Number", "left"),
    ("name", "Name", "left"),
    ("presses", "Presses", "right"),
    ("estimates", "Estimates", "right"),
    ("last", "Last press (UTC)", "left"),
)
LINK = '<q-td :props="props"><a class="link" :href="props.row.address">{{ props.value }}</a></q-td>'
BEGIN = (
    "Nothing is kept yet. Start the camera on the page Examine and take a snapshot: it becomes the first press of a "
    "target. A bundle of another store can be imported here. On the command line, tsis demo --keep fills a store."
)


def listing(bench: Bench, viewer: Viewer) -> None:
    """Build the list."""
    with ui.element("section").classes("panel stack"):
        with ui.element("div").classes("row"):
            panel_title("Targets")
            told = ui.label().classes("muted")
            ui.element("div").classes("spring")
            buttons = ui.element("div").classes("row")
        below = ui.element("div")
        with buttons:
            verify_button(bench, viewer, below)
            import_button(bench, viewer, below)
        found = _Found(bench, viewer, told)
    follow_store(viewer, found.load)


class _Found:
    """The table of targets, and what was asked of it."""

    def __init__(self, bench: Bench, viewer: Viewer, told: ui.label) -> None:
        self._bench, self._viewer, self._told = bench, viewer, told
        self._targets: tuple[TargetSummary, ...] = ()
        self._order = Order()
        with ui.element("div").classes("row") as self._asking:
            self._search = ui.input("Search number or name", on_change=self._asked).props(
                "dense outlined clearable debounce=200"
            )
            self._kind = (
                ui.select(list(KINDS), value=KINDS[0], label="Show", on_change=self._asked)
                .props("dense outlined")
                .classes("asked-kind")
            )
        self._empty = ui.label(BEGIN).classes("muted")
        self._table = ui.table(
            rows=[],
            columns=[_column(*each) for each in COLUMNS],
            row_key="number",
            pagination=self._pages(sheet_of((), self._order)),  # else it asks for a sheet of its own making
        )
        self._table.props(
            f'flat dense :rows-per-page-options="{list(SHEETS)}" rows-per-page-label="Targets on a sheet"'
        ).classes("targets")
        for name in ("number", "name"):
            self._table.add_slot(f"body-cell-{name}", LINK)
        self._table.on("request", self._turned)
        self._table.on_pagination_change(self._told_back)
        for part in (self._asking, self._empty, self._table):
            part.set_visibility(False)

    async def load(self) -> None:
        """Read the list anew."""
        targets = await self._viewer.attempt(self._bench.store.targets)
        if targets is None:
            return
        self._targets = targets
        presses = sum(each.presses for each in targets)
        kind = self._bench.store.kind
        self._told.text = f"{count_of(len(targets), 'target')} ({kind}s), {count_of(presses, 'press')}"
        self._empty.set_visibility(not targets)
        self._asking.set_visibility(bool(targets))
        self._table.set_visibility(bool(targets))
        self._show()

    def _asked(self) -> None:
        self._order = Order(
            search=self._search.value or "",
            kind=self._kind.value,
            column=self._order.column,
            descending=self._order.descending,
            rows=self._order.rows,
        )
        self._show()

    def _turned(self, event: GenericEventArguments) -> None:
        pagination = event.args.get("pagination") if isinstance(event.args, dict) else None
        wanted: dict[str, Any] = pagination if isinstance(pagination, dict) else {}
        self._order = Order.asked(wanted, search=self._order.search, kind=self._order.kind)
        self._show()

    def _told_back(self) -> None:
        """A browser that was slow tells how many there were: what is known here stands."""
        pages = self._pages(sheet_of(self._targets, self._order))
        if self._table.pagination != pages:
            self._table.pagination = pages

    def _show(self) -> None:
        sheet = sheet_of(self._targets, self._order)
        self._table.rows = [_row(each) for each in sheet.targets]
        self._table.pagination = self._pages(sheet)

    def _pages(self, sheet: Sheet) -> dict[str, Any]:
        """What the table in the browser is told of the sheet that it shows."""
        return {
            "sortBy": self._order.column,
            "descending": self._order.descending,
            "page": sheet.sheet,
            "rowsPerPage": self._order.rows,
            "rowsNumber": sheet.found,
        }


def _column(name: str, label: str, align: str) -> dict[str, Any]:
    return {"name": name, "label": label, "field": name, "align": align, "sortable": True}


def _row(each: TargetSummary) -> dict[str, Any]:
    return {
        "number": each.target.number,
        "name": each.target.name or "(no name)",
        "presses": each.presses,
        "estimates": each.estimates,
        "last": "never" if each.last is None else time_text(each.last),
        "address": f"/records/{each.target.number}",
    }

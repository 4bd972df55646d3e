"""Records: every target of the store, and one target."""

from __future__ import annotations

import json
import logging
import shutil
import tempfile
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nicegui import ui

from tsis.calibration.guard.limits import GUARD_FLAGS
from tsis.console import widgets
from tsis.console.files import target_of
from tsis.console.messages import plain_message
from tsis.console.services.jobs import DONE
from tsis.errors import FileInputError, InputError, TsisError
from tsis.present.records import FORM_LABELS, MASKED, import_message, verdict, verification_notes
from tsis.present.target import newest_first, result_text, time_text, without_identity
from tsis.records.reader import ARCHIVED, DELETED
from tsis.records.store import back_up_store, verify_store
from tsis.records.target import read_bundle

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Mapping, Sequence

    from nicegui.events import GenericEventArguments, UploadEventArguments

    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import Job
    from tsis.console.viewer import Viewer
    from tsis.records.reader import TargetState, TargetSummary
    from tsis.records.store import Store, StoreVerification
    from tsis.records.transfer import ImportedTarget
    from tsis.records.values import StoredPress, Target, TargetRecord


AT_ONCE = 24  # presses of a sheet
UNKNOWN_FLAG = "a flag unknown to tsis"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetView:
    """A target as it is stored now."""

    target: Target
    record: TargetRecord  # without presses; of a subject the pseudonym only
    presses: tuple[StoredPress, ...]  # one page of them
    offset: int  # presses before that page
    total: int  # of all presses
    state: TargetState | None = None  # whether it is archived or deleted
    stale: tuple[str, ...] = ()  # a message for each current result whose presses were edited since

    @property
    def private(self) -> bool:
        """Whether this is a subject, whose notes and names are hidden at first."""
        return self.target.kind == "subject"

    @property
    def deleted(self) -> bool:
        """Whether it accepts no change before it is restored."""
        return self.state is not None and self.state.name == DELETED

    @property
    def sheet(self) -> tuple[object, ...]:
        """Fingerprint of the presses: equal ones have the same view."""
        return self.private, self.offset, self.total, self.presses

    @property
    def fingerprint(self) -> tuple[object, ...]:
        """Fingerprint of the whole page: equal ones have the same view."""
        record = self.record
        estimates = tuple(estimate.id for estimate in record.estimates)
        return self.target, self.state, self.sheet, estimates, tuple(record.calibrations), record.damaged, self.stale


def read_target(store: Store, number: str, offset: int) -> TargetView:
    """Read a target; ``offset`` behind its presses becomes that of the last page of presses.

    Raises `InputError` when there is no target of that number, and `RecordsError` when the store cannot be read.
    """
    target = target_of(store, number)
    total = store.press_count(target)
    offset = min(offset, max(0, (total - 1) // AT_ONCE * AT_ONCE))
    return TargetView(
        target=target,
        record=without_identity(store.record(target, limit=0)),
        presses=store.presses(target, limit=AT_ONCE, offset=offset),
        offset=offset,
        total=total,
        state=store.state(target),
        stale=tuple(result.message(numbered=True) for result in store.stale_results(target)),
    )


def flags_of(press: StoredPress, *, private: bool) -> tuple[str, ...]:
    """Flags as they may be shown: of a subject only those that tsis raises."""
    return tuple(flag if not private or flag in GUARD_FLAGS else UNKNOWN_FLAG for flag in press.flags)


def flag_text(name: str) -> str:
    """What a flag of the press guard means; one that somebody wrote down stays as it is."""
    return GUARD_FLAGS[name].means if name in GUARD_FLAGS else name


LONGEST_S = 600.0
FETCH = """
    const answer = await fetch(%s);
    if (!answer.ok) return await answer.text();
    const link = document.createElement("a");
    const said = answer.headers.get("content-disposition") || "";
    link.download = (said.match(/filename="([^"]+)"/) || ["", "tsis"])[1];
    link.href = URL.createObjectURL(await answer.blob());
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
    return "";
"""
CUT = "the download failed: the connection was lost or it took too long; try again"


async def fetch_file(viewer: Viewer, address: str) -> bool:
    """Download a file in the browser; False, after a message, when there is none."""
    try:
        message = await ui.run_javascript(FETCH % json.dumps(address), timeout=LONGEST_S)
    except TimeoutError:
        message = CUT
    if message:
        viewer.complain(plain_message(str(message)))
    return not message


class ReportButton:
    """Saves the report of a target as PDF, and shows that it is being made."""

    def __init__(self, viewer: Viewer, number: int | None = None) -> None:
        self._viewer, self._number = viewer, number
        self.element = widgets.button("Report", self.save, icon="picture_as_pdf", look="outline dense")
        self.show(number)

    def show(self, number: int | None) -> None:
        """Say of which target; None where there is none."""
        self._number = number
        self.element.set_visibility(number is not None)

    async def save(self) -> None:
        """Save the report, where there is one."""
        if self._number is not None:
            with widgets.loading(self.element):
                await fetch_file(self._viewer, f"/files/report/{self._number}.pdf")


EVERY_S = 0.3


async def follow_job(viewer: Viewer, place: ui.element, begin: Callable[[], Job], show: Callable[[Any], None]) -> bool:
    """Begin a job and show it in ``place`` until it is over; then ``show`` its result there, or say why it failed.

    False, after a message, when it cannot begin.
    """
    job = await viewer.attempt(begin)
    if job is None:
        return False
    place.clear()
    with place:
        line = widgets.JobLine(job.title, job.end)

    def refresh() -> None:
        state = job.state()
        if line.show(state, f"{job.title}: {f'{state.done} of {state.total}' if state.total else 'under way'}"):
            return
        timer.cancel()
        place.clear()
        with place:
            if state.status == DONE:
                show(job.result)
            else:
                ui.label(state.sentence).classes("flag").props('role="alert"')

    with place:
        timer = ui.timer(EVERY_S, refresh)
    return True


IDENTIFIED = "include label, names and true times"
MEANT = {
    True: "Masked: label, names and times are removed or shifted unless you include them below.",
    False: "Not masked: notes, names and settings are included.",
}
PAGE = "Contains what the report shows; of a subject only the pseudonym."


def export_button(viewer: Viewer, place: ui.element, targets: Callable[[], Sequence[int]], *, text: str) -> ui.button:
    """A button that asks for the form of an export of these targets, and downloads the file."""
    return widgets.button(text, lambda: _ask(viewer, place, targets()), icon="download", look="outline dense")


def _ask(viewer: Viewer, place: ui.element, targets: Sequence[int]) -> None:
    title = f"Export target {targets[0]}" if len(targets) == 1 else f"Export {len(targets)} targets"
    with widgets.open_dialog(place, title) as dialog:
        form = widgets.select_field(FORM_LABELS, value="csv", label="Form", on_change=lambda: explain())
        meant = widgets.muted()
        identified = ui.switch(IDENTIFIED, value=False).props("dense")
        waiting = ui.linear_progress(show_value=False).props('indeterminate aria-label="writing the file"')
        waiting.set_visibility(False)

        def explain() -> None:
            masked = form.value in MASKED
            meant.text = PAGE if form.value in ("html", "pdf") else MEANT[masked]
            identified.set_visibility(masked)

        async def begin() -> None:
            with_names = bool(identified.value) and form.value in MASKED
            waiting.set_visibility(True)
            button.disable()
            if await fetch_file(viewer, export_address(targets, str(form.value), identified=with_names)):
                viewer.notify(f"Exported as {form.value}: the browser saves the file.")
                dialog.close()
            waiting.set_visibility(False)
            button.enable()

        button = widgets.dialog_buttons(dialog, "Export", begin)
        explain()


def export_address(targets: Sequence[int], form: str, *, identified: bool) -> str:
    """The address of an export: of one target its file, of several a zip file.

    Examples
    --------
    >>> export_address([7], "csv", identified=False), export_address([7, 9], "dicom", identified=True)
    ('/files/export/7/csv', '/files/exports/dicom?targets=7,9&identified=true')
    """
    more = "identified=true" if identified else ""
    if len(targets) == 1:
        return f"/files/export/{targets[0]}/{form}" + (f"?{more}" if more else "")
    return f"/files/exports/{form}?targets={','.join(map(str, targets))}" + (f"&{more}" if more else "")


STORE_EVERY_S = 1.0  # between two readings
UNREAD, FAILED = -2, -1  # in place of the number of the store's entries
_log = logging.getLogger(__name__)


def follow_store(viewer: Viewer, changed: Callable[[], Awaitable[None]]) -> None:
    """Call ``changed`` now and after every change of the store, while the present part of the page is visible."""
    last: int | None = UNREAD

    async def refresh() -> None:
        nonlocal last
        try:
            entries = await viewer.entries()
        except TsisError as error:  # a page that is shown needs no message every second
            _log.debug("the store was not read: %s", error)
            entries = FAILED
        if entries != last:
            last = entries
            await changed()

    viewer.every(STORE_EVERY_S, refresh)


ALL, ESTIMATED, NOT_ESTIMATED = "all", "estimated", "not estimated"
KINDS = (ALL, ESTIMATED, NOT_ESTIMATED, ARCHIVED, DELETED)
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
    search = order.search.strip().casefold()
    found = [target for target in targets if _is_requested(target, search, order.kind)]
    found.sort(key=lambda item: item.target.number)
    found.sort(key=KEYS[order.column], reverse=order.descending)  # stable: equal ones stay by number
    sheet = min(order.sheet, max(1, -(-len(found) // order.rows)))
    begin = (sheet - 1) * order.rows
    return Sheet(targets=tuple(found[begin : begin + order.rows]), sheet=sheet, total=len(found))


def _is_requested(summary: TargetSummary, search: str, kind: str) -> bool:
    if (summary.state.name if summary.state else "") != (kind if kind in (ARCHIVED, DELETED) else ""):
        return False
    if kind in (ESTIMATED, NOT_ESTIMATED) and (summary.estimates > 0) != (kind == ESTIMATED):
        return False
    words = f"{summary.target.name} {'' if summary.target.kind == 'subject' else summary.target.note}".casefold()
    return search in words or str(summary.target.number).startswith(search)


COLUMNS = (
    ("number", "Number", "left"),
    ("name", "Name", "left"),
    ("presses", "Presses", "right"),
    ("estimates", "Estimates", "right"),
    ("last", "Last press (UTC)", "left"),
    ("result", "Result", "left"),
    ("note", "Tags and note", "left"),
    ("picture", "First press", "left"),
)
LINK = '<q-td :props="props"><a class="link" :href="props.row.address">{{ props.value }}</a></q-td>'
PICTURE = """<q-td :props="props">
  <img v-if="props.value" class="target-picture" loading="lazy" :src="props.value"
    :alt="'first press of target ' + props.row.number">
</q-td>"""
ROOM = {
    "name": "min-width: 9em",
    "last": "min-width: 7em",
    "result": "min-width: 15em",
    "note": "min-width: 12em",
}  # else a telephone breaks words
PICTURE_PX = 96
CHOOSE = '<q-checkbox v-model="props.selected" dense :aria-label="\'Choose target \' + props.row.number" />'
CHOOSE_ALL = '<q-checkbox v-model="props.selected" dense aria-label="Choose all targets of this sheet" />'
EXPORT = "Export the listed"
BEGIN = (
    "Nothing is saved yet. Start the camera on the page Examine and take a snapshot: it becomes the first press of a "
    "target. A bundle of another store can be imported here."
)


def target_listing(instrument: Instrument, viewer: Viewer) -> None:
    """Build the list."""
    with ui.element("section").classes("panel stack"):
        with ui.element("div").classes("row"):
            widgets.panel_title("Targets")
            count = widgets.muted()
            ui.element("div").classes("spring")
            buttons = ui.element("div").classes("row")
        below = ui.element("div")
        with buttons:
            verify_button(instrument, viewer, below)
            backup_button(instrument, viewer, below)
            import_button(instrument, viewer, below)
            save = partial(fetch_file, viewer, "/files/targets.csv")
            widgets.button("Save as CSV", save, icon="table_view", look="outline dense")
        targets = _TargetTable(instrument, viewer, count)
        with buttons:
            targets.export = export_button(viewer, below, targets.chosen, text=EXPORT)
    follow_store(viewer, targets.load)


class _TargetTable:
    """The table of targets, and its request."""

    def __init__(self, instrument: Instrument, viewer: Viewer, count: ui.label) -> None:
        self._instrument, self._viewer, self._count = instrument, viewer, count
        self._targets: tuple[TargetSummary, ...] = ()
        self._order = Order()
        self.export: ui.button | None = None  # whose text says what it exports
        with ui.element("div").classes("row") as self._request:
            self._search = widgets.text_field("Search number, name, note or #tag", on_change=self._requested).props(
                "clearable debounce=200"
            )
            self._search.classes("path")
            self._kind = widgets.select_field(list(KINDS), value=KINDS[0], label="Show", on_change=self._requested)
            self._kind.classes("kind-choice")
        self._empty = widgets.muted(BEGIN)
        self._table = ui.table(
            rows=[],
            columns=[
                {
                    "name": name,
                    "label": label,
                    "field": name,
                    "align": align,
                    "sortable": name in KEYS,
                    "style": ROOM.get(name, ""),
                }
                for name, label, align in COLUMNS
            ],
            row_key="number",
            pagination=self._pages(sheet_of((), self._order)),  # else it asks for a sheet of its own making
            selection="multiple",
            on_select=lambda: self._say_chosen(),
        )
        widgets.sheets_of_targets(self._table, SHEETS, lambda: self._pages(sheet_of(self._targets, self._order)))
        for name in ("number", "name"):
            self._table.add_slot(f"body-cell-{name}", LINK)
        self._table.add_slot("body-cell-picture", PICTURE)
        self._table.add_slot("body-selection", CHOOSE)
        self._table.add_slot("header-selection", CHOOSE_ALL)
        self._table.on("request", self._page_changed)
        for part in (self._request, self._empty, self._table):
            part.set_visibility(False)

    async def load(self) -> None:
        """Read the list anew."""
        everything = await self._viewer.attempt(self._instrument.store.targets, hidden=True)
        if everything is None:
            return
        self._targets = everything
        known = {item.target.number for item in everything}
        self._table.selected = [row for row in self._table.selected if row["number"] in known]
        self._say_chosen()
        targets = tuple(item for item in everything if item.state is None)
        presses = sum(target.presses for target in targets)
        kind = self._instrument.store.kind
        of_kind = "phantoms" if kind == "phantom" else "subjects"
        self._count.text = (
            f"{widgets.count_text(len(targets), 'target')} ({of_kind}), {widgets.count_text(presses, 'press')}"
        )
        self._empty.set_visibility(not everything)
        self._request.set_visibility(bool(everything))
        await self._show()
        self._table.set_visibility(bool(everything))

    def chosen(self) -> list[int]:
        """Numbers of the targets whose rows are chosen, else of those that the search finds, of all sheets."""
        if self._table.selected:
            return sorted(row["number"] for row in self._table.selected)
        order = replace(self._order, sheet=1, rows=max(len(self._targets), 1))
        return [item.target.number for item in sheet_of(self._targets, order).targets]

    def _say_chosen(self) -> None:
        count = len(self._table.selected)
        if self.export is not None:
            self.export.text = f"Export the {count} chosen" if count else EXPORT

    async def _requested(self) -> None:
        self._order = replace(self._order, search=self._search.value or "", kind=self._kind.value, sheet=1)
        await self._show()

    async def _page_changed(self, event: GenericEventArguments) -> None:
        pagination = event.args.get("pagination") if isinstance(event.args, dict) else None
        requested: dict[str, Any] = pagination if isinstance(pagination, dict) else {}
        self._order = Order.requested(requested, search=self._order.search, kind=self._order.kind)
        await self._show()

    async def _show(self) -> None:
        order, sheet = self._order, sheet_of(self._targets, self._order)
        rows = await self._viewer.attempt(lambda: [_row(self._instrument.store, item) for item in sheet.targets])
        if rows is not None and order == self._order:  # else another sheet was asked for meanwhile
            self._table.rows = rows
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


def _row(store: Store, summary: TargetSummary) -> dict[str, Any]:
    """A target with its newest estimate and, of a phantom, its note; one that cannot be read says why."""
    target, private = summary.target, summary.target.kind == "subject"
    result, picture = "", ""
    try:
        for press in store.presses(target, limit=1):
            picture = f"/files/press/{target.number}/{press.id}.png?size={PICTURE_PX}"
        if summary.estimates:
            result = result_text(newest_first(store.record(target, limit=0))[0])
    except (TsisError, IndexError) as error:
        result = str(error)
    return {
        "picture": picture,
        "result": result,
        "note": "" if private else target.note,
        "number": summary.target.number,
        "name": summary.target.name or "(no name)",
        "presses": summary.presses,
        "estimates": summary.estimates,
        "last": "never" if summary.last is None else time_text(summary.last),
        "address": f"/records/{summary.target.number}",
    }


BUNDLE = "bundle.zip"
EXPLAINED = (
    "A bundle is the zip file that a target's export creates. Existing targets, presses and estimates are not "
    "changed, and nothing is imported twice."
)
TOO_LARGE = f"a bundle must be one zip file of at most {widgets.LARGEST_MIB} MiB here"


def import_button(instrument: Instrument, viewer: Viewer, place: ui.element) -> None:
    """A button that asks for a bundle, imports it, and shows the result in ``place``."""
    with widgets.titled_dialog("Import a bundle") as dialog:
        widgets.muted(EXPLAINED)
        upload = widgets.one_file(viewer, "Zip file of a bundle", accept=".zip", refused=TOO_LARGE)
        widgets.button("Close", dialog.close, look="flat dense")

    async def uploaded(event: UploadEventArguments) -> None:
        upload.reset()
        dialog.close()
        folder = await _saved(event, viewer)
        if folder is None:
            return
        remove = partial(shutil.rmtree, folder, ignore_errors=True)
        work = partial(_import, instrument, folder)
        begin = partial(instrument.jobs.begin, "import of a bundle", work, after=remove)  # also of a cancelled one
        if not await follow_job(viewer, place, begin, _show):
            remove()

    upload.on_upload(uploaded)
    widgets.button("Import a bundle", dialog.open, icon="upload_file", look="outline dense")


async def _saved(event: UploadEventArguments, viewer: Viewer) -> Path | None:
    """The upload in its own folder; None, after a message, when the disk is full."""
    folder: Path | None = None
    try:
        folder = Path(tempfile.mkdtemp(prefix="tsis-import-"))
        await event.file.save(folder / BUNDLE)
    except OSError as error:
        viewer.complain(f"There is no space for a copy of the bundle: {error.strerror or error}")
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)
        return None
    return folder


def _import(instrument: Instrument, folder: Path, job: Job) -> ImportedTarget:
    try:
        return instrument.store.import_target(read_bundle(folder / BUNDLE), progress=job.advance)
    except FileInputError as error:  # it names the temporary folder
        raise FileInputError(str(error).replace(f"{folder}/", "")) from error


def _show(imported: ImportedTarget) -> None:
    with ui.element("div").classes("row").props('role="status"'):
        ui.label(import_message(imported)).classes("good")
        ui.link(f"Open target {imported.target.number}", f"/records/{imported.target.number}").classes("link")


MOST_SHOWN = 100  # faults; a store that has more has one cause


def verify_button(instrument: Instrument, viewer: Viewer, place: ui.element) -> None:
    """A button that verifies the store against its audit, and shows the result in ``place``."""

    async def begin() -> None:
        def verify() -> Job:
            return instrument.jobs.begin(
                "verify the store", lambda job: verify_store(instrument.store, progress=job.advance)
            )

        await follow_job(viewer, place, verify, partial(_show_verification, place))

    widgets.button("Verify the store", begin, icon="verified_user", look="outline dense")


BACKUP = (
    "Copies the whole store to a new folder on the console's computer and verifies the copy, which is a store itself. "
    "Whoever runs the console can restore a store from it."
)


def backup_button(instrument: Instrument, viewer: Viewer, place: ui.element) -> None:
    """A button that asks for a folder, copies the store there, and shows the verification of the copy in ``place``."""

    def ask() -> None:
        with widgets.open_dialog(place, "Back up the store") as dialog:
            widgets.muted(BACKUP)
            folder = widgets.text_field(
                "New folder (absolute path)", value=str(instrument.store.folder.resolve()) + "-backup"
            )

            async def begin() -> None:
                path = await widgets.submit(viewer, {"folder": folder}, _whole_path, folder.value or "")
                if path is None:
                    return
                dialog.close()
                await follow_job(
                    viewer, results, lambda: _backup(instrument, path), partial(_show_backup, results, path)
                )

            widgets.dialog_buttons(dialog, "Back up", begin)

    with place:
        results = ui.element("div")
    widgets.button("Back up", ask, icon="save", look="outline dense")


def _whole_path(text: str) -> Path:
    path = Path(text.strip())
    if not path.is_absolute():
        requirement = "must be a whole path on the console's computer"
        raise InputError(name="folder", requirement=requirement, value=f"{text.strip()!r:.80}")
    return path


def _backup(instrument: Instrument, path: Path) -> Job:
    return instrument.jobs.begin(
        "backup of the store", lambda job: back_up_store(instrument.store, path, progress=job.advance)
    )


def _show_backup(place: ui.element, path: Path, verification: StoreVerification) -> None:
    _show_verification(place, verification)
    with place:
        ui.label(f"The backup is in {path}").classes("good identity")


def _show_verification(place: ui.element, verification: StoreVerification) -> None:
    with ui.element("section").classes("outcome").props('role="status"'):
        ui.label(verdict(verification)).classes("good" if verification.sound else "flag")
        with widgets.message_list():
            for fault in verification.faults[:MOST_SHOWN]:
                widgets.list_message(fault, "doubtful")
        if len(verification.faults) > MOST_SHOWN:
            ui.label(f"and {len(verification.faults) - MOST_SHOWN} more faults")
        for note in verification_notes(verification):
            ui.label(note).classes("muted identity")
        widgets.button("Close", place.clear, look="flat dense")

"""Contents of a target's page, read at once, and its downloads and jobs."""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from nicegui import ui

from tsis.calibration.guard import GUARD_FLAGS
from tsis.console.files import target_of
from tsis.console.pages import components as kit
from tsis.console.services import DONE
from tsis.errors import TsisError
from tsis.present.records import FORM_LABELS, MASKED
from tsis.present.target import without_identity

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from tsis.console.services import Instrument, Job
    from tsis.records.reader import TargetState
    from tsis.records.store import Store
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

    @property
    def private(self) -> bool:
        """Whether this is a subject, whose notes and names are hidden at first."""
        return self.target.kind == "subject"

    @property
    def sheet(self) -> tuple[object, ...]:
        """Fingerprint of the presses: equal ones have the same view."""
        return self.private, self.offset, self.total, self.presses

    @property
    def fingerprint(self) -> tuple[object, ...]:
        """Fingerprint of the whole page: equal ones have the same view."""
        record = self.record
        estimates = tuple(estimate.id for estimate in record.estimates)
        return self.target, self.state, self.sheet, estimates, tuple(record.calibrations), record.damaged


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
    )


def fault_of(store: Store, press: StoredPress) -> str:
    """Why the frame of a press cannot be read; empty when it can."""
    try:
        store.levels(press.frame)
    except TsisError as error:
        return str(error)
    return ""


def flags_of(press: StoredPress, *, private: bool) -> tuple[str, ...]:
    """Flags as they may be shown: of a subject only those that tsis raises."""
    return tuple(flag if not private or flag in GUARD_FLAGS else UNKNOWN_FLAG for flag in press.flags)


class ChosenPresses(Protocol):
    """The presses that the person has ticked."""

    chosen: list[str]


class TargetContext(Protocol):
    """The open page of a target, as its parts use it; ``below``, ``dialogs`` and ``compared`` are places on it."""

    instrument: Instrument
    viewer: kit.Viewer
    below: ui.element
    dialogs: ui.element
    compared: ui.element

    @property
    def presses(self) -> ChosenPresses:
        """The table of presses."""

    async def load(self) -> None:
        """Read the target anew and show it."""

    async def compare(self, view: TargetView) -> None:
        """Show the two chosen presses beside each other."""


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
CUT = "the download failed: the connection was lost or it took too long; try again, or use tsis records export"


async def fetch_file(viewer: kit.Viewer, address: str) -> bool:
    """Download a file in the browser; False, after a message, when there is none."""
    try:
        message = await ui.run_javascript(FETCH % json.dumps(address), timeout=LONGEST_S)
    except TimeoutError:
        message = CUT
    if message:
        viewer.complain(str(message))
    return not message


EVERY_S = 0.3


async def follow_job(
    viewer: kit.Viewer, place: ui.element, begin: Callable[[], Job], show: Callable[[Any], None]
) -> bool:
    """Begin a job and show it in ``place`` until it is over; then ``show`` its result there, or say why it failed.

    False, after a message, when it cannot begin.
    """
    job = await viewer.attempt(begin)
    if job is None:
        return False
    place.clear()
    with place, ui.element("div").classes("job").props('role="status"'):
        ui.label(job.title)
        bar = kit.ProgressBar(job.title)
        count = kit.muted()
        kit.button("Cancel", job.end, look="outline dense")

    def refresh() -> None:
        state = job.state()
        if state.running:
            bar.show(state)
            count.text = f"{state.done} of {state.total}" if state.total else "under way"
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


def export_button(page: TargetContext, view: TargetView) -> None:
    """A button that asks for the form, and downloads the file."""
    kit.button("Export", lambda: _ask(page, view), icon="download", look="outline dense")


def _ask(page: TargetContext, view: TargetView) -> None:
    with kit.open_dialog(page.dialogs, f"Export target {view.target.number}") as dialog:
        form = kit.select_field(FORM_LABELS, value="csv", label="Form", on_change=lambda: explain())
        meant = kit.muted()
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
            address = f"/files/export/{view.target.number}/{form.value}" + ("?identified=true" if with_names else "")
            if await fetch_file(page.viewer, address):
                page.viewer.notify(f"Exported as {form.value}: the browser saves the file.")
                dialog.close()
            waiting.set_visibility(False)
            button.enable()

        button = kit.dialog_buttons(dialog, "Export", begin)
        explain()


STORE_EVERY_S = 1.0  # between two readings
UNREAD, FAILED = -2, -1  # in place of the number of the store's entries
_log = logging.getLogger(__name__)


def follow_store(viewer: kit.Viewer, changed: Callable[[], Awaitable[None]]) -> None:
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

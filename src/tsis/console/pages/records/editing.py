"""A dialog in which a record is changed: saved, or kept open with what somebody else has changed meanwhile."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Generic

from nicegui import ui

from tsis.console.pages.records.conflict import show_conflict
from tsis.console.pages.records.edits import Record

if TYPE_CHECKING:
    from tsis.console.pages.records.context import TargetContext
    from tsis.console.pages.records.edits import Edited


class Editing(ABC, Generic[Record]):
    """The fields of a record in a dialog.

    Parameters
    ----------
    page, dialog
        Where it is open.
    record
        As it was read.
    leave
        What the button says that changes nothing.
    """

    def __init__(self, page: TargetContext, record: Record, dialog: ui.dialog, *, leave: str) -> None:
        self._page, self._record, self._dialog = page, record, dialog
        self._lay_out()
        self._conflict = ui.element("div")
        self._fill(record)
        with ui.element("div").classes("row"):
            ui.button("Save", on_click=self._save).props("no-caps dense unelevated")
            ui.button(leave, on_click=dialog.close).props("no-caps dense flat")

    @abstractmethod
    def _lay_out(self) -> None:
        """Make the fields."""

    @abstractmethod
    def _show(self, record: Record) -> None:
        """Write a record into the fields."""

    @abstractmethod
    def _written(self) -> tuple[Any, ...]:
        """What stands in the fields, for `_edited`."""

    @abstractmethod
    def _edited(self, *written: Any) -> Edited[Record]:
        """Change the record in the store, away from the event loop."""

    @abstractmethod
    def _saved(self, record: Record) -> str:
        """Say that it was saved."""

    def _fill(self, record: Record) -> None:
        self._record = record
        self._show(record)
        self._conflict.clear()

    async def _save(self) -> None:
        found = await self._page.viewer.attempt(self._edited, *self._written())
        if found is None:
            return
        now = found.record
        if found.refused:
            show_conflict(self._conflict, found, take=lambda: self._fill(now), keep=lambda: self._save_over(now))
            return
        self._dialog.close()
        self._page.viewer.tell(self._saved(now))
        await self._page.load()

    async def _save_over(self, now: Record) -> None:
        self._record = now
        await self._save()

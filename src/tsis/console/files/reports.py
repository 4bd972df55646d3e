"""Reports of targets, drawn and laid out beside the console and not in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.console.apart import Apart
from tsis.records.export.whole import export_file
from tsis.report.of_store import StoreAddress, report_of_stored_target

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.records import Store, Target


class Reports:
    """Makes the reports of a store, one at a time, in a process of its own.

    Parameters
    ----------
    store
        Whose targets.
    database
        URL of the PostgreSQL database with its rows, if any.
    """

    def __init__(self, store: Store, *, database: str | None = None) -> None:
        self._place = StoreAddress(folder=store.folder, kind=store.kind, database=database, identity=store.identity)
        self._apart = Apart()

    def content(self, target: Target, form: str) -> bytes:
        """The report in a form of `tsis.report.forms.PAGES`; errors as `tsis.report.of_store` and `Apart.ask`."""
        return self._apart.ask(report_of_stored_target, self._place, target.number, form)

    def write(self, target: Target, form: str, path: Path) -> None:
        """The same as a new file; also `FileInputError` when it cannot be written."""
        content = self.content(target, form)
        with export_file(path) as draft:
            draft.write_bytes(content)

    def close(self) -> None:
        """Make none any more."""
        self._apart.close()

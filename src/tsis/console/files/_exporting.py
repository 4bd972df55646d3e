"""Exports of a target for a browser: one file in its own folder, removed once it was sent."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from tsis.console._worker import WorkerProcess
from tsis.errors import FileInputError, InputError
from tsis.records.export import export_file
from tsis.report import ENDINGS, MASKED, PAGE_FORMS, StoreAddress, report_of_stored_target, write_form

if TYPE_CHECKING:
    from tsis.records import Target
    from tsis.records.store import Store


MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".pdf": "application/pdf",
    ".h5": "application/x-hdf5",
    ".json": "application/fhir+json",
    ".zip": "application/zip",
}


def write_export(
    store: Store, target: Target, form: str, *, identified: bool = False, reports: Reports | None = None
) -> Path:
    """Write a form of `tsis.report.ENDINGS` of a target into its own new folder; a folder becomes a zip file.

    With ``identified`` fhir and dicom include label, names and true times; other forms mask nothing. Without
    ``reports`` html and pdf are built in this process.

    Raises
    ------
    InputError
        When the form masks nothing and ``identified`` is set.
    FileInputError
        When it cannot be written.
    MissingExtraError
        When the form needs an extra that is not installed.
    RecordsError
        When a stored file is damaged; html and pdf say so in their text instead.
    """
    if identified and form not in MASKED:
        raise InputError(f"identified is of {' and '.join(MASKED)}; {form} masks nothing (leave it out)")
    try:
        folder = Path(tempfile.mkdtemp(prefix="tsis-export-"))
    except OSError as error:
        raise FileInputError(f"a folder for the export must be writable; got: {error.strerror or error}") from error
    try:
        path = folder / f"target-{target.number}{ENDINGS[form]}"
        if reports is not None and form in PAGE_FORMS:
            reports.write(target, form, path)
        else:
            record = store.record(target)
            if form not in PAGE_FORMS:
                record.require_whole()
            write_form(form, record, path, identified=identified)
        return _one_file(path)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _one_file(path: Path) -> Path:
    """The file itself; of a folder a zip file of it."""
    if path.is_file():
        return path
    try:
        packed = Path(shutil.make_archive(str(path), "zip", path.parent, path.name))
    except OSError as error:
        raise FileInputError(f"a zip file of {path.name} must be writable; got: {error.strerror or error}") from error
    shutil.rmtree(path, ignore_errors=True)
    return packed


class Reports:
    """Builds the reports of a store, one at a time, in a worker process."""

    def __init__(self, store: Store, *, database: str | None = None) -> None:
        self._folder = StoreAddress(folder=store.folder, kind=store.kind, database=database, identity=store.identity)
        self._worker = WorkerProcess()

    def content(self, target: Target, form: str) -> bytes:
        """The report in a form of `tsis.report.PAGE_FORMS`; errors as `tsis.report._forms` and `WorkerProcess.call`."""
        return self._worker.call(report_of_stored_target, self._folder, target.number, form)

    def write(self, target: Target, form: str, path: Path) -> None:
        """The same as a new file; also `FileInputError` when it cannot be written."""
        content = self.content(target, form)
        with export_file(path) as draft:
            draft.write_bytes(content)

    def close(self) -> None:
        """Make none any more."""
        self._worker.close()

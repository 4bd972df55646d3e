"""The export forms of a target record, each written atomically as a new file or folder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.errors import FileInputError, PluginError, RecordsError, TsisError
from tsis.plugins import find_plugins, load_plugin

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from tsis.records import TargetRecord


ENDINGS = {  # of default names
    "html": ".html",
    "pdf": ".pdf",
    "csv": "-csv",
    "hdf5": ".h5",
    "zarr": ".zarr",
    "dicom": "-dicom",
    "bundle": ".zip",
}
FORM_LABELS = {
    "html": "HTML: the report as one page",
    "pdf": "PDF: the report on paper",
    "csv": "CSV: tables, and frames as PNG",
    "hdf5": "HDF5: everything as arrays",
    "zarr": "Zarr: everything as arrays",
    "dicom": "DICOM: series, report and document",
    "bundle": "Bundle: everything, for another store",
}
PAGE_FORMS = ("html", "pdf")  # forms that report damage; the others refuse it
MASKED = ("dicom",)  # forms that omit labels and times by default


def export_endings() -> Mapping[str, str]:
    """Ending of the default name, by form: those of tsis, then those of plug-ins."""
    return {name: f".{name}" for name in sorted(find_plugins("exporters"))} | ENDINGS


def write_form(form: str, record: TargetRecord, path: Path, *, identified: bool) -> str:
    """Write a target record in a form; return the SHA-256 of a bundle, else an empty string.

    Raises
    ------
    FileInputError
        When the name is taken, or it cannot be written.
    MissingExtraError
        When the form needs an extra that is not installed.
    RecordsError
        When a stored file is damaged.
    PluginError
        When the form is a plug-in that fails.
    """
    if form in PAGE_FORMS:
        require_absent(path)  # before the page is drawn
        _write_file(path, page_bytes(form, record))
    elif form == "dicom":
        from tsis.records.dicom import write_dicom

        write_dicom(record, path, identified=identified)
    elif form not in ENDINGS:
        _write_by_plugin(form, record, path)
    elif form == "bundle":
        from tsis.records.export.bundle import write_bundle

        return write_bundle(record, path)
    elif form == "csv":
        from tsis.records.export import write_csv

        write_csv(record, path)
    else:
        from tsis.records.export.arrays import write_hdf5, write_zarr

        {"hdf5": write_hdf5, "zarr": write_zarr}[form](record, path)
    return ""


def _write_by_plugin(form: str, record: TargetRecord, path: Path) -> None:
    """The file that an exporter of a plug-in writes, complete or not at all."""
    from tsis.records.export import export_file

    exporter = load_plugin("exporters", form)
    with export_file(path) as draft:
        try:
            exporter(record, draft)
        except TsisError:
            raise
        except Exception as error:  # a plug-in may raise anything
            package = find_plugins("exporters")[form].package
            reason = " ".join(str(error).split()) or type(error).__name__
            raise PluginError(f"the exporter {form} of {package} failed: {reason:.200}") from error


def page_bytes(form: str, record: TargetRecord) -> bytes:
    """The report of a target in one of `PAGE_FORMS`."""
    from tsis.report.target import target_page

    page = target_page(record)
    if form == "html":
        from tsis.report._page import html

        return html(page)
    from tsis.report.paper import pdf

    return pdf(page)


def _write_file(path: Path, content: bytes) -> None:
    from tsis.records.export import export_file

    with export_file(path) as draft:
        draft.write_bytes(content)


def require_absent(path: Path) -> None:
    """Raise `FileInputError` when a path exists, before any computation."""
    try:
        taken = path.is_symlink() or path.exists()
    except OSError as error:
        raise FileInputError(f"{str(path)!r:.120} must be a new name; got: {error.strerror or error}") from error
    if taken or path.name in ("", ".."):
        raise FileInputError(f"{str(path)!r:.120} must be a new name; there is such a file or folder (choose another)")


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreAddress:
    """Location of a store, as for `tsis.records.store.open_store`, and its identity."""

    folder: Path
    kind: str
    database: str | None
    identity: str


def report_of_stored_target(store_address: StoreAddress, number: int, form: str) -> bytes:
    """The report of the present state of a target in a form of `tsis.report.PAGE_FORMS`.

    Raises
    ------
    RecordsError
        When the store is unreadable, or was replaced by another.
    InputError
        When there is no such target.
    """
    from tsis.records.store import open_store  # loads the libraries of records

    address = store_address
    with open_store(address.folder, kind=address.kind, database=address.database, create=False) as store:
        if store.identity != address.identity:
            raise RecordsError(
                f"the store must be {address.identity[:12]}, which was opened; got {store.identity[:12]}"
            )
        return page_bytes(form, store.record(store.target(number)))

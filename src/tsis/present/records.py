"""Files of a stored target, and texts of its recomputations."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from tsis.errors import PluginError, RecordsError, TsisError
from tsis.files.json_values import free_to_json
from tsis.files.result_folder import require_absent
from tsis.plugins import find_plugins, load_plugin
from tsis.present.labels import counted
from tsis.present.page import Table

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from tsis.records.recomputation import Recomputation
    from tsis.records.store import StoreVerification
    from tsis.records.transfer import ImportedTarget
    from tsis.records.values import Target, TargetRecord


ENDINGS = {  # of default names
    "html": ".html",
    "pdf": ".pdf",
    "csv": "-csv",
    "netcdf": ".nc",
    "zarr": ".zarr",
    "dicom": "-dicom",
    "bundle": ".zip",
}
FORM_LABELS = {
    "html": "HTML: the report as one page",
    "pdf": "PDF: the report on paper",
    "csv": "CSV: tables, and frames as PNG",
    "netcdf": "netCDF: frames and estimates as arrays",
    "zarr": "Zarr: frames and estimates as arrays",
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
        from tsis.records.target import write_bundle

        return write_bundle(record, path)
    elif form == "csv":
        from tsis.records.export import write_csv

        write_csv(record, path)
    else:
        from tsis.records.arrays import write_netcdf, write_zarr

        {"netcdf": write_netcdf, "zarr": write_zarr}[form](record, path)
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
    from tsis.present.target import target_page

    page = target_page(record)
    if form == "html":
        from tsis.present.html import html_bytes

        return html_bytes(page)
    from tsis.present.pdf import pdf_bytes

    return pdf_bytes(page)


def _write_file(path: Path, content: bytes) -> None:
    from tsis.records.export import export_file

    with export_file(path) as draft:
        draft.write_bytes(content)


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreAddress:
    """Location of a store, as for `tsis.records.store.open_store`, and its identity."""

    folder: Path
    kind: str
    database: str | None
    identity: str


def report_of_stored_target(store_address: StoreAddress, number: int, form: str) -> bytes:
    """The report of the present state of a target in a form of `tsis.present.records.PAGE_FORMS`.

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


SHORT = 8  # shown digits of an identity


def recomputation_notes(recomputation: Recomputation) -> tuple[str, ...]:
    """Notes beside the main message of a recomputation."""
    messages = [f"Note: {note}." for note in recomputation.notes]
    for what, flags in (("gained", recomputation.flags_gained), ("lost", recomputation.flags_lost)):
        if flags:
            messages.append(f"Flags {what}: {', '.join(flags)}.")
    if recomputation.before.estimate.trusted != recomputation.after.estimate.trusted:
        messages.append(f"It is {'now' if recomputation.after.estimate.trusted else 'no longer'} to be trusted.")
    return tuple(messages)


def recomputation_message(recomputation: Recomputation) -> str:
    """Where the new estimate is stored; empty where nothing changed."""
    if recomputation.stored:
        return f"Stored as {recomputation.after.id[:SHORT]}."
    return "" if recomputation.same else "Nothing was stored: this was a dry run."


def shift_table(recomputation: Recomputation) -> Table:
    """The shift of each parameter."""
    headings = ("", "before", "after", "moved (old sd)", "90 % interval before", "90 % interval after")
    rows: list[tuple[str, ...]] = []
    for shift in recomputation.shifts:
        (low, high), (now_low, now_high) = shift.interval_before, shift.interval_after
        means = (_text(shift.before), _text(shift.after), _text(shift.moved, "+.2g"))
        rows.append((shift.name, *means, f"{low:.3g} to {high:.3g}", f"{now_low:.3g} to {now_high:.3g}"))
    return Table(title="What moved", columns=headings, values=tuple(rows))


def _text(value: float | None, form: str = ".3g") -> str:
    return "not identified" if value is None else format(value, form)


def recomputation_document(target: Target, recomputation: Recomputation) -> dict[str, Any]:
    """A recomputation as a JSON document."""
    return {
        "target": target.number,
        "kind": recomputation.before.kind,
        "same": recomputation.same,
        "sentence": recomputation.message,
        "causes": list(recomputation.causes),
        "notes": list(recomputation.notes),
        "shifts": [free_to_json(asdict(shift), "shift") for shift in recomputation.shifts],
        "flags_gained": list(recomputation.flags_gained),
        "flags_lost": list(recomputation.flags_lost),
        "trusted": {"before": recomputation.before.estimate.trusted, "after": recomputation.after.estimate.trusted},
        "before": recomputation.before.id,
        "stored_as": recomputation.after.id if recomputation.stored else None,
    }


def verdict(store_verification: StoreVerification) -> str:
    """Whether the store is sound."""
    fault = f"NOT as it was stored: {counted(len(store_verification.faults), 'fault')}"
    state = "as it was stored" if store_verification.sound else fault
    return f"The store is {state}: {store_verification.rows} rows and {store_verification.files} files were read."


def verification_notes(store_verification: StoreVerification) -> tuple[str, ...]:
    """Notes on a store beside its faults."""
    messages = [f"Note: {note}." for note in store_verification.notes]
    if store_verification.unnamed:
        messages.append(
            f"{store_verification.unnamed} files belong to saves that were cut short; nobody was told they were kept."
        )
    if store_verification.unanchored:
        messages.append(
            f"The anchor does not vouch for the last {store_verification.unanchored} entries of the audit; the next "
            "record brings it up to date."
        )
    return (*messages, f"Audit: entry {store_verification.head.number}, {store_verification.head.hash}")


def store_verification_document(store_verification: StoreVerification) -> dict[str, Any]:
    """A verification as a JSON document."""
    return {
        "sound": store_verification.sound,
        "faults": list(store_verification.faults),
        "notes": list(store_verification.notes),
        "audit": {"number": store_verification.head.number, "hash": store_verification.head.hash},
        "rows": store_verification.rows,
        "files": store_verification.files,
        "unnamed": store_verification.unnamed,
        "unanchored": store_verification.unanchored,
    }


def entered_text(target: Target, *, new: bool, added: int, present: int, estimates: int) -> str:
    """The target of imported presses, and how many are new."""
    parts = [f"{counted(added, 'press')} added"]
    parts += [f"{present} there already"] if present else []
    parts += [f"{counted(estimates, 'estimate')} added"] if estimates else []
    return f"target {target.number}{' (new)' if new else ''}; {', '.join(parts)}"


def import_message(taken: ImportedTarget) -> str:
    """Result of the import of a bundle."""
    text = entered_text(
        taken.target, new=taken.new, added=taken.presses, present=taken.present, estimates=taken.estimates
    )
    differing = f"; {counted(taken.differing, 'press')} here differ from it and stay" if taken.differing else ""
    return f"Taken in as {text}{differing}."

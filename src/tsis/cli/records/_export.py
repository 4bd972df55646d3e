"""``tsis records export``: a target as a report, tables, arrays, DICOM or a bundle."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import print_json
from tsis.cli._progress import waiting
from tsis.cli._store import PHANTOM, StoreDatabase, StoreFolder, StoreKind, TargetNumber, opened
from tsis.errors import InputError
from tsis.present.terminal import people, print_notice

Identified = Annotated[
    bool, typer.Option("--identified", help="Include label, names and true times in dicom; masked otherwise.")
]


def export(
    number: TargetNumber,
    *,
    forms: Annotated[
        list[str],
        typer.Option("--format", help="Form: html, pdf, csv, netcdf, zarr, dicom, bundle, or a plug-in's; repeatable."),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="New file or folder; for several forms a new folder of them.", show_default="target-N with its ending"
        ),
    ] = None,
    identified: Identified = False,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Export a target; no file is overwritten.

    Several forms appear together or not at all. html and pdf are reports; csv, netcdf, zarr and bundle contain notes
    and names too; dicom masks names and times.
    """
    requested = list(dict.fromkeys(part for form in forms for part in form.split(",")))
    endings = tsis.present.records.export_endings()
    for form in requested:
        tsis.model.require_one_of("form of export", form, endings)
    if identified and not set(requested) & set(tsis.present.records.MASKED):
        masked = " and ".join(tsis.present.records.MASKED)
        raise InputError(f"--identified belongs to {masked}; the other forms mask nothing (leave it out)")
    stem = f"target-{number}"
    destination = out or Path(stem if len(requested) > 1 else f"{stem}{endings[requested[0]]}")
    tsis.files.require_absent(destination)
    with opened(store, kind, database) as records, waiting("writing"), ExitStack() as together:
        record = records.record(records.target(number))
        if set(requested) - set(tsis.present.records.PAGE_FORMS):  # they name missing libraries
            record.require_whole()
        if len(requested) == 1:
            seal = tsis.present.records.write_form(requested[0], record, destination, identified=identified)
        else:
            from tsis.records.export import export_folder

            draft, seal = together.enter_context(export_folder(destination)), ""
            for form in requested:
                seal += tsis.present.records.write_form(
                    form, record, draft / f"{stem}{endings[form]}", identified=identified
                )
    single = len(requested) == 1
    files = {
        form: str((destination if single else destination / f"{stem}{endings[form]}").resolve()) for form in requested
    }
    if as_json:
        print_json(
            tsis.present.document.envelope("records export", target=number, files=files, bundle_sha256=seal or None)
        )
        return
    console = people()
    for form, file in files.items():
        console.print(f"{form}: {file}", markup=False, soft_wrap=True)
    if seal:
        console.print(f"SHA-256 of the bundle, for its receiver: {seal}", markup=False, soft_wrap=True)
    print_notice(console)

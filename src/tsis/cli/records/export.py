"""``tsis records export``: a target as a report, tables, arrays, FHIR, DICOM or a bundle."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.progress import waiting
from tsis.cli.records.chosen_store import PHANTOM, StoreDatabase, StoreFolder, StoreKind, TargetNumber, opened
from tsis.cli.targets import AsJson
from tsis.model.check import require_one_of
from tsis.model.errors import InputError
from tsis.report.document import envelope
from tsis.report.forms import ENDINGS, MASKED, PAGES, require_absent, write_form

Identified = Annotated[
    bool, typer.Option("--identified", help="Tell label, names and true times in fhir and dicom; masked otherwise.")
]


def export(
    number: TargetNumber,
    *,
    forms: Annotated[
        list[str], typer.Option("--format", help=f"Form: {', '.join(ENDINGS)}; repeat it for several at once.")
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
    """Write a target for people and other programs; nothing is ever written over.

    Several forms appear together or not at all. html and pdf are reports; csv, hdf5, zarr and bundle hold everything,
    notes and names too; fhir and dicom mask names and times.
    """
    wanted = list(dict.fromkeys(part for each in forms for part in each.split(",")))
    for form in wanted:
        require_one_of("form of export", form, ENDINGS)
    if identified and not set(wanted) & set(MASKED):
        raise InputError(f"--identified is of {' and '.join(MASKED)}; the other forms mask nothing (leave it out)")
    stem = f"target-{number}"
    place = out or Path(stem if len(wanted) > 1 else f"{stem}{ENDINGS[wanted[0]]}")
    require_absent(place)
    with opened(store, kind, database) as records, waiting("writing"), ExitStack() as together:
        dossier = records.dossier(records.target(number))
        if set(wanted) - set(PAGES):  # which say what is missing
            dossier.require_whole()
        if len(wanted) == 1:
            seal = write_form(wanted[0], dossier, place, identified=identified)
        else:
            from tsis.records.export.whole import export_folder

            draft, seal = together.enter_context(export_folder(place)), ""
            for form in wanted:
                seal += write_form(form, dossier, draft / f"{stem}{ENDINGS[form]}", identified=identified)
    single = len(wanted) == 1
    files = {form: str((place if single else place / f"{stem}{ENDINGS[form]}").resolve()) for form in wanted}
    if as_json:
        print_json(envelope("records export", target=number, files=files, bundle_sha256=seal or None))
        return
    console = people()
    for form, file in files.items():
        console.print(f"{form}: {file}", markup=False, soft_wrap=True)
    if seal:
        console.print(f"SHA-256 of the bundle, for its receiver: {seal}", markup=False, soft_wrap=True)
    print_notice(console)

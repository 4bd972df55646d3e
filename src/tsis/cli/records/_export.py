"""``tsis records export``: a target as a report, tables, arrays, DICOM or a bundle."""

from __future__ import annotations

import os
import re
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import people, print_json, print_notice
from tsis.cli._progress import waiting
from tsis.cli._store import PHANTOM, StoreDatabase, StoreFolder, StoreKind, TargetNumber, opened
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.records.dicom import DicomFile


Identified = Annotated[
    bool, typer.Option("--identified", help="Include label, names and true times in dicom; masked otherwise.")
]


def export(
    number: TargetNumber,
    *,
    forms: Annotated[
        list[str],
        typer.Option("--format", help="Form: html, pdf, csv, hdf5, zarr, dicom, bundle, or of a plug-in; repeatable."),
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

    Several forms appear together or not at all. html and pdf are reports; csv, hdf5, zarr and bundle contain all,
    notes and names too; dicom masks names and times.
    """
    requested = list(dict.fromkeys(part for form in forms for part in form.split(",")))
    endings = tsis.report.export_endings()
    for form in requested:
        tsis.model.require_one_of("form of export", form, endings)
    if identified and not set(requested) & set(tsis.report.MASKED):
        raise InputError(
            f"--identified belongs to {' and '.join(tsis.report.MASKED)}; the other forms mask nothing (leave it out)"
        )
    stem = f"target-{number}"
    destination = out or Path(stem if len(requested) > 1 else f"{stem}{endings[requested[0]]}")
    tsis.report.require_absent(destination)
    with opened(store, kind, database) as records, waiting("writing"), ExitStack() as together:
        record = records.record(records.target(number))
        if set(requested) - set(tsis.report.PAGE_FORMS):  # they name missing libraries
            record.require_whole()
        if len(requested) == 1:
            seal = tsis.report.write_form(requested[0], record, destination, identified=identified)
        else:
            from tsis.records.export import export_folder

            draft, seal = together.enter_context(export_folder(destination)), ""
            for form in requested:
                seal += tsis.report.write_form(form, record, draft / f"{stem}{endings[form]}", identified=identified)
    single = len(requested) == 1
    files = {
        form: str((destination if single else destination / f"{stem}{endings[form]}").resolve()) for form in requested
    }
    if as_json:
        print_json(tsis.report.envelope("records export", target=number, files=files, bundle_sha256=seal or None))
        return
    console = people()
    for form, file in files.items():
        console.print(f"{form}: {file}", markup=False, soft_wrap=True)
    if seal:
        console.print(f"SHA-256 of the bundle, for its receiver: {seal}", markup=False, soft_wrap=True)
    print_notice(console)


TOKEN = "TSIS_DICOMWEB_TOKEN"
ARCHIVE = re.compile(r"(?P<entity>[^@]+)@(?P<host>\[[0-9A-Fa-f:.]+\]|[^@:\s/]+):(?P<port>[0-9]{1,5})")


def send(
    number: TargetNumber,
    *,
    to: Annotated[
        str,
        typer.Option(help=f"AETITLE@host:port, or https://... of a DICOMweb service (its token in ${TOKEN})."),
    ],
    calling: Annotated[str, typer.Option(help="Name of this program as the archive knows it.")] = "TSIS",
    plain_http: Annotated[
        bool, typer.Option("--allow-plain-http", help="Send without encryption to another machine.")
    ] = False,
    timeout_s: Annotated[float, typer.Option(help="Seconds to wait for each response.")] = 30.0,
    identified: Identified = False,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Send frames and report of a target to a DICOM archive; needs the extra dicom.

    Names and times are masked unless --identified is given. Sending it again does no harm: the archive
    recognises it.
    """
    address = None if to.startswith(("http://", "https://")) else ARCHIVE.fullmatch(to)
    if address is None and not to.startswith(("http://", "https://")):
        raise InputError(f"--to must be AETITLE@host:port or the address of a DICOMweb service; got {to!r:.120}")
    from tsis.records.dicom import c_store, dicom_files, stow_rs

    with opened(store, kind, database) as records, waiting("sending"):
        record = records.record(records.target(number))
        record.require_whole()
        files: Sequence[DicomFile] = dicom_files(record, identified=identified)
        if address is not None:
            stored = c_store(
                files,
                host=address["host"].strip("[]"),
                port=int(address["port"]),
                called_ae=address["entity"],
                calling_ae=calling,
                timeout_s=timeout_s,
            )
        else:
            token = os.environ.get(TOKEN) or None
            stored = stow_rs(files, url=to, token=token, timeout_s=timeout_s, allow_plain_http=plain_http)
    if as_json:
        print_json(tsis.report.envelope("records send", target=number, to=to, stored=list(stored)))
        return
    console = people()
    console.print(f"{len(stored)} instances of target {number} are in the archive.", markup=False)
    print_notice(console)

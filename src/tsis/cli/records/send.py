"""``tsis records send``: a target to an archive by DICOM or DICOMweb."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Annotated

import typer

from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.progress import waiting
from tsis.cli.records.chosen_store import PHANTOM, StoreDatabase, StoreFolder, StoreKind, TargetNumber, opened
from tsis.cli.records.export import Identified
from tsis.cli.targets import AsJson
from tsis.model.errors import InputError
from tsis.report.document import envelope

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.records.dicom import DicomFile

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
    timeout_s: Annotated[float, typer.Option(help="Seconds to wait for each answer.")] = 30.0,
    identified: Identified = False,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Send frames and report of a target to a DICOM archive; needs the extra dicom.

    Names and times are masked unless --identified is given. Sending the same again does no harm: it is the same to
    the archive, too.
    """
    address = None if to.startswith(("http://", "https://")) else ARCHIVE.fullmatch(to)
    if address is None and not to.startswith(("http://", "https://")):
        raise InputError(f"--to must be AETITLE@host:port or the address of a DICOMweb service; got {to!r:.120}")
    from tsis.records.dicom import c_store, dicom_files, stow_rs

    with opened(store, kind, database) as records, waiting("sending"):
        dossier = records.dossier(records.target(number))
        dossier.require_whole()
        files: Sequence[DicomFile] = dicom_files(dossier, identified=identified)
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
        print_json(envelope("records send", target=number, to=to, stored=list(stored)))
        return
    console = people()
    console.print(f"{len(stored)} instances of target {number} are in the archive.", markup=False)
    print_notice(console)

"""``tsis records verify``: whether a store is as it was stored."""

from __future__ import annotations

import typer

from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.progress import progress_bar
from tsis.cli.records.chosen_store import PHANTOM, StoreDatabase, StoreFolder, StoreKind, opened
from tsis.cli.targets import AsJson
from tsis.report.document import envelope
from tsis.report.verification import store_verification_document, verdict, verification_notes

UNSOUND = 1  # exit code of a store that is not as it was stored


def verify(
    *,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Compare every row and file of a store with its audit; exit code 1 and a list of faults when they differ."""
    from tsis.records import verify_store as verification

    with opened(store, kind, database) as records, progress_bar("reading every file") as advance:
        found = verification(records, progress=advance)
    if as_json:
        print_json(envelope("records verify", **store_verification_document(found)))
    else:
        console = people()
        for fault in found.faults:
            console.print(f"- {fault}", markup=False, soft_wrap=True)
        console.print(verdict(found))
        for note in verification_notes(found):
            console.print(note, markup=False, soft_wrap=True)
        print_notice(console)
    if not found.sound:
        raise typer.Exit(UNSOUND)

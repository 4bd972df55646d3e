"""``tsis records verify``: whether a store is as it was stored."""

from __future__ import annotations

import typer

from tsis.cli.console_output import people, print_json, print_notice, progress_bar
from tsis.cli.records.chosen_store import PHANTOM, StoreDatabase, StoreFolder, StoreKind, opened
from tsis.cli.targets import AsJson
from tsis.report.document import envelope

UNSOUND = 1  # exit code of a store that is not as it was stored


def verify(
    *,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    database: StoreDatabase = None,
    as_json: AsJson = False,
) -> None:
    """Compare every row and file of a store with its audit; exit code 1 and a list of faults when they differ."""
    from tsis.records import verify as verification

    with opened(store, kind, database) as records, progress_bar("reading every file") as advance:
        found = verification(records, progress=advance)
    head = {"number": found.head.number, "hash": found.head.hash}
    if as_json:
        print_json(
            envelope(
                "records verify",
                sound=found.sound,
                faults=list(found.faults),
                notes=list(found.notes),
                audit=head,
                rows=found.rows,
                files=found.files,
                unnamed=found.unnamed,
                unanchored=found.unanchored,
            )
        )
    else:
        console = people()
        for fault in found.faults:
            console.print(f"- {fault}", markup=False, soft_wrap=True)
        for note in found.notes:
            console.print(f"Note: {note}.", markup=False, soft_wrap=True)
        state = "as it was stored" if found.sound else f"NOT as it was stored: {len(found.faults)} faults"
        console.print(f"The store is {state}: {found.rows} rows and {found.files} files were read.")
        if found.unnamed:
            console.print(f"{found.unnamed} files belong to saves that were cut short; nobody was told they were kept.")
        if found.unanchored:
            console.print(
                f"The anchor does not vouch for the last {found.unanchored} entries of the audit; the next record "
                "brings it up to date.",
                soft_wrap=True,
            )
        console.print(f"Audit: entry {found.head.number}, {found.head.hash}", soft_wrap=True)
        print_notice(console)
    if not found.sound:
        raise typer.Exit(UNSOUND)

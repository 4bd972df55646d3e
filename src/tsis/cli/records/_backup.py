"""``tsis records backup`` and ``tsis records restore``: verified copies of a store."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import print_json
from tsis.cli._progress import progress_bar
from tsis.cli._store import PHANTOM, StoreFolder, StoreKind, opened
from tsis.present.terminal import people, print_notice

if TYPE_CHECKING:
    from tsis.records.store import Store, StoreVerification


def backup(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="New folder for the copy.")],
    *,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    as_json: AsJson = False,
) -> None:
    """Copy a store into a new folder and verify the copy; others may save meanwhile."""
    with opened(store, kind, None) as records:
        result, position = _copied(records, folder), str(folder.resolve())
    if as_json:
        document = tsis.present.records.store_verification_document(result)
        print_json(tsis.present.document.envelope("records backup", store=position, **document))
    else:
        _show(result, position)


def restore(
    folder: Annotated[Path, typer.Argument(metavar="BACKUP", help="Folder that tsis records backup wrote.")],
    *,
    store: StoreFolder = None,
    kind: StoreKind = PHANTOM,
    as_json: AsJson = False,
) -> None:
    """Copy a backup to where a store shall be, and verify the copy; a store that is there is never replaced."""
    from tsis.records.store import default_folder

    with opened(folder, kind, None) as records:
        requested = default_folder(kind) if store is None else store
        result, position = _copied(records, requested), str(requested.resolve())
    if as_json:
        document = tsis.present.records.store_verification_document(result)
        print_json(tsis.present.document.envelope("records restore", store=position, **document))
    else:
        _show(result, position)


def _copied(records: Store, folder: Path) -> StoreVerification:
    from tsis.records.store import back_up_store

    with progress_bar("copying every file, and reading it again") as advance:
        return back_up_store(records, folder, progress=advance)


def _show(result: StoreVerification, position: str) -> None:
    console = people()
    console.print(tsis.present.records.verdict(result))
    console.print(f"The store is in {position}", markup=False, soft_wrap=True)
    print_notice(console)

"""Backups of a store: a copy of one state of it, whole, verified, and a store itself."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

from tsis.errors import RecordsError
from tsis.files import PRIVATE_FILE, as_path, atomic_folder, file_error, one_line, printable_path
from tsis.records.store._audit import write_anchor
from tsis.records.store._database import DATABASE_FILE, Database
from tsis.records.store._files import Blobs
from tsis.records.store._opening import open_store
from tsis.records.store._store import FILES
from tsis.records.store._verification import cited_files, last_entry, verify_store

if TYPE_CHECKING:
    import os
    from collections.abc import Callable
    from pathlib import Path

    from tsis.records.store._store import Store
    from tsis.records.store._verification import StoreVerification


def back_up_store(
    store: Store, folder: str | os.PathLike[str], *, progress: Callable[[int, int], None] = lambda done, total: None
) -> StoreVerification:
    """Copy a store into a new folder, and verify the copy against its audit; it opens as any store.

    Others may save meanwhile: the copy has the state of its beginning. To restore is the same with the backup as the
    store. ``progress`` is called with (done, all) files, each of which is copied and read again.

    Raises
    ------
    RecordsError
        When rows are in PostgreSQL, a file is missing or damaged, or the copy differs from its audit; no copy is left.
    FileInputError
        When the folder exists already or cannot be written.
    """
    requested = as_path(folder)
    if store.database.file is None:
        raise RecordsError(
            f"a backup copies a store in SQLite; the rows of this one are in {store.database.name} (back the database "
            f"up by pg_dump, and copy {printable_path(store.folder)})"
        )
    try:
        with atomic_folder(requested) as draft:
            draft.chmod(0o700)
            return _copied(store, draft, progress)
    except FileExistsError as error:
        raise file_error(requested, "must be a new folder; there is such a name (choose another)") from error
    except OSError as error:
        raise file_error(requested, f"must be a place that can be written; got: {one_line(error)}") from error


def _copied(store: Store, draft: Path, progress: Callable[[int, int], None]) -> StoreVerification:
    (draft / DATABASE_FILE).touch(mode=PRIVATE_FILE)
    (draft / FILES).mkdir(mode=0o700)
    with store.database.reading() as connection:
        driver = connection.connection.driver_connection
        driver.execute("VACUUM INTO ?", (str(draft / DATABASE_FILE),))  # type: ignore[union-attr]
    with closing(Database(None, draft)) as copy, copy.reading() as connection:  # of the same state, whatever is added
        files = list(dict(cited_files(connection)))
        write_anchor(draft, store.identity, last_entry(connection))
    blobs = Blobs(draft / FILES)
    for done, (name, ending) in enumerate(files, start=1):
        blobs.put(store.blobs.get(name, ending), ending)
        progress(done, 2 * len(files))
    with open_store(draft, kind=store.kind, create=False, actor=store.actor) as opened:
        result = verify_store(opened, progress=lambda done, total: progress(total + done, 2 * total))
    if not result.sound:
        raise RecordsError(
            f"a backup must be as its audit says; it is not, and neither is the store: {result.faults[0]} (tsis "
            "records verify shows all; a copy of its folder keeps what there is)"
        )
    return result

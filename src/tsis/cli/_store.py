"""The store of a command."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.__about__ import LARGEST_TARGET
from tsis.errors import InputError

if TYPE_CHECKING:
    from tsis.records.store import Store


PHANTOM = "phantom"
DATABASE = "TSIS_RECORDS_DATABASE"

StoreFolder = Annotated[
    Path | None,
    typer.Option("--store", help="Folder of the store.", show_default="this user's own of that kind"),
]
StoreKind = Annotated[
    str, typer.Option("--kind", help="Kind of the store: phantom or subject, each a store of its own.")
]
StoreDatabase = Annotated[
    str | None,
    typer.Option(
        "--database",
        envvar=DATABASE,
        show_envvar=True,
        help="URL of a PostgreSQL database for the rows.",
        show_default="SQLite in the folder",
    ),
]
TargetNumber = Annotated[int, typer.Argument(metavar="N", help="Number of the target, as tsis records list shows it.")]


def opened(folder: Path | None, kind: str, database: str | None, *, create: bool = False) -> Store:
    """The chosen store, to be closed by a ``with``."""
    from tsis.records.store import open_store

    return open_store(folder, kind=kind, database=database or None, create=create)


def is_there(folder: Path | None, kind: str, database: str | None) -> bool:
    """Whether the store exists, intact or not."""
    from tsis.records.database import DATABASE_FILE, Database
    from tsis.records.store import default_folder

    position = default_folder(kind) if folder is None else folder
    if not database:
        return (position / DATABASE_FILE).is_file()
    if not position.is_dir():
        return False
    rows = Database(database, position)
    try:
        return not rows.empty()
    finally:
        rows.close()


def target_number(text: str) -> int:
    """A target's number from text."""
    if not text.isascii() or not text.isdigit():
        raise InputError(f"--target must be a number from 1 to {LARGEST_TARGET}, or new; got {text!r:.40}")
    return tsis.model.require.require_integer("--target", int(text[:20]), 1, LARGEST_TARGET)

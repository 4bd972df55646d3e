"""The store of records as commands use it."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

import tsis
from tsis.__about__ import LARGEST_TARGET
from tsis.cli.output import RESULT, leave, print_outcome, publish, result_bytes, write_outcome
from tsis.cli.progress import FAILED
from tsis.errors import InputError, TsisError

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from tsis.cli.output import CommandOutcome
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

    place = default_folder(kind) if folder is None else folder
    if not database:
        return (place / DATABASE_FILE).is_file()
    if not place.is_dir():
        return False
    rows = Database(database, place)
    try:
        return not rows.empty()
    finally:
        rows.close()


def target_number(text: str) -> int:
    """A target's number from text."""
    if not text.isascii() or not text.isdigit():
        raise InputError(f"--target must be a number from 1 to {LARGEST_TARGET}, or new; got {text!r:.40}")
    return tsis.model.require.require_integer("--target", int(text[:20]), 1, LARGEST_TARGET)


SaveOption = Annotated[
    bool, typer.Option("--save", help="Save frames, calibration and estimate in the store: tsis records list.")
]
StoreOption = Annotated[
    Path | None,
    typer.Option("--store", help="Folder of that store.", show_default="this user's own of that kind"),
]
KindOption = Annotated[
    str | None, typer.Option("--kind", help="Kind of that store: phantom or subject.", show_default=PHANTOM)
]
TargetOption = Annotated[
    int | None,
    typer.Option(
        "--target",
        help="Number of the target to keep it under; entered when there is none.",
        show_default="a new one",
        min=1,
        max=LARGEST_TARGET,
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Destination:
    """The store, and the target in it, where a command shall keep what it finds."""

    folder: Path | None
    kind: str
    number: int | None
    database: str | None = None

    def opened(self) -> Store:
        """The store, to be closed by a ``with``."""
        return opened(self.folder, self.kind, self.database or os.environ.get(DATABASE), create=True)


def chosen_destination(
    save: bool,
    folder: Path | None,
    kind: str | None = None,
    number: int | None = None,
    *,
    database: str | None = None,
) -> Destination | None:
    """Where to keep, found ready before anything is computed; None where nothing is to be kept.

    Raises
    ------
    InputError
        When a store is named and nothing is to be kept.
    RecordsError
        When the store cannot be opened.
    """
    if not save:
        typed = {"--store": folder, "--kind": kind, "--target": number}
        for option, value in typed.items():
            if value is not None:
                raise InputError(f"{option} needs --save, without which nothing goes into a store")
        return None
    destination = Destination(folder=folder, kind=kind or PHANTOM, number=number, database=database)
    destination.opened().close()
    return destination


def save_estimate(store: Store, number: int | None, **entries: Any) -> dict[str, Any]:
    """Keep an estimate with its frames; ``entries`` are those of `tsis.records.importing.SavableResult`."""
    from tsis.records.importing import SavableResult, save_results  # loads the libraries of records

    return save_results(store, SavableResult(**entries), number=number)


def save_map(store: Store, number: int | None, **entries: Any) -> dict[str, Any]:
    """Keep a map with the presses of its scan; ``entries`` are those of `tsis.records.importing.save_map`."""
    from tsis.records.importing import save_map as save  # loads the libraries of records

    return save(store, number, **entries)


def publish_and_save(
    outcome: CommandOutcome,
    out: Path,
    destination: Destination | None,
    keep: Callable[[Store, int | None], dict[str, Any]],
    *,
    as_json: bool,
) -> None:
    """Write the folder of results, then ``keep`` what they rest on under the destination's number, and print both.

    The folder comes first, so that a store that takes nothing loses nothing: then it stays without the word ``kept``,
    a sentence tells why, and the exit code is 1.
    """
    if destination is None:
        publish(outcome, out, as_json=as_json)
        return
    from tsis.records.importing import saved_notes  # loads the libraries of records

    folder = write_outcome(outcome, out)
    try:
        with destination.opened() as store:
            saved = keep(store, destination.number)
        outcome = outcome.with_notes(*saved_notes(saved))
        outcome = replace(outcome, document={**outcome.document, "saved": saved})
        tsis.files.atomic.write_durably(folder / RESULT, result_bytes(outcome.document))
    except TsisError as error:
        print_outcome(outcome, folder, as_json=as_json)
        stop_not_saved(error, str(folder))
    except OSError as error:
        outcome = outcome.with_notes(f"{RESULT} does not tell it: {error.strerror or error}.")
    print_outcome(outcome, folder, as_json=as_json)
    leave(trusted=outcome.trusted)


def stop_not_saved(error: TsisError, location: str) -> NoReturn:
    """End a command whose results are all there but for the store."""
    typer.echo(f"Error: the results are in {location}, but they could not be kept: {error}", err=True)
    raise typer.Exit(FAILED)

"""From the schema that a database has to the present one, in one transaction; of an old file a copy stays."""

from __future__ import annotations

import sqlite3
import threading
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING

from alembic import command
from alembic.config import Config
from alembic.script import ScriptDirectory
from sqlalchemy import inspect, text

from tsis.instrument import printable_path
from tsis.instrument.file_bytes import one_line
from tsis.model.durable import DISK, PRIVATE_FILE, UNFINISHED
from tsis.model.errors import RecordsError

if TYPE_CHECKING:
    from pathlib import Path

    from sqlalchemy import Connection

VERSIONS = "alembic_version"
_one_at_a_time = threading.Lock()  # Alembic's context belongs to the whole process


@cache
def known_revisions() -> tuple[str, ...]:
    """Every schema that this release can read, the present one first."""
    return tuple(step.revision for step in ScriptDirectory.from_config(_alembic()).walk_revisions())


def wanted_revision() -> str:
    """The present schema."""
    return known_revisions()[0]


def revision(connection: Connection, name: str) -> str | None:
    """The schema of a database; None for an empty one.

    Raises
    ------
    RecordsError
        When it is one that this release does not know; ``name`` is what messages call the database.
    """
    if not inspect(connection).has_table(VERSIONS):
        return None
    found = list(connection.execute(text(f"SELECT version_num FROM {VERSIONS}")).scalars())
    if len(found) != 1 or found[0] not in known_revisions():
        raise RecordsError(
            f"{name} must have a schema up to {wanted_revision()}; it has {', '.join(map(repr, found)) or 'none':.60} "
            "(was it written by a newer release of tsis? then update tsis)"
        )
    return str(found[0])


def upgraded(connection: Connection) -> None:
    """Run the steps that are missing, within the transaction of ``connection``."""
    with _one_at_a_time:
        command.upgrade(_alembic(connection), "head")


def copied(connection: Connection, file: Path, present: str) -> None:
    """Keep a copy of a SQLite ``file`` of schema ``present`` beside it: whole, on the disk, or not at all.

    Raises
    ------
    RecordsError
        When it cannot be written; then nothing is migrated.
    """
    copy = file.with_name(f"records-of-schema-{present}.sqlite3")
    draft = copy.with_name(f".{copy.name}{UNFINISHED}")
    try:
        draft.unlink(missing_ok=True)  # of a migration that was killed
        draft.touch(mode=PRIVATE_FILE)
        # SQLite writes such a copy outside of a transaction only, into a file that is empty or missing.
        connection.connection.driver_connection.execute("VACUUM INTO ?", (str(draft),))  # type: ignore[union-attr]
        with draft.open("rb+") as written:
            DISK.sync(written)
        DISK.rename(draft, copy)
        DISK.sync_folder(copy.parent)
    except (OSError, sqlite3.Error) as error:
        raise RecordsError(
            f"a copy of the old records must be written to {printable_path(copy)}; got: {one_line(error)} "
            "(nothing was changed; free some space)"
        ) from error
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)  # where it did not become the copy


def _alembic(connection: Connection | None = None) -> Config:
    config = Config()
    config.set_main_option("script_location", "tsis.records:migrations")
    config.attributes["connection"] = connection
    return config

"""A store of schema 1 as its release wrote it: rows and hashes as text that never changes, and its files."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import psycopg

if TYPE_CHECKING:
    from tests.records.place import Place

FROZEN = Path(__file__).parent / "schema_1"
IDENTITY = "2a39c39fd87b44aabf99e110c4b49670"
ENTRIES, HEAD = 11, "62bb9970a4b3207f9998410f71de57b27e873be6085235cf5567ae35cf75f248"


def make_old(place: Place) -> None:
    """Put it into an empty place."""
    place.folder.mkdir(mode=0o700, parents=True)
    shutil.copytree(FROZEN / "files", place.folder / "files")
    shutil.copy(FROZEN / "audit-anchor.json", place.folder)
    rows = (FROZEN / "records.sql").read_text(encoding="utf-8")
    if place.database is None:
        with closing(sqlite3.connect(place.folder / "records.sqlite3")) as connection:
            connection.executescript(rows + (FROZEN / "triggers-sqlite.sql").read_text())
    else:
        with psycopg.connect(place.database) as server:
            server.execute(rows + (FROZEN / "triggers-postgresql.sql").read_text())

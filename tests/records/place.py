"""Where a test's store lies: in SQLite or in PostgreSQL."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tsis.records.store import open_store

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.records.store import Store


@dataclass(frozen=True, slots=True)
class Place:
    """A folder, and the URL of an empty database of PostgreSQL or None for SQLite."""

    folder: Path
    database: str | None = None

    def open(self, **options: Any) -> Store:
        return open_store(self.folder, database=self.database, **options)

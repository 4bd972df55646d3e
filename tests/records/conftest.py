"""Both databases: SQLite in the test's folder, and one PostgreSQL server a test run with a new database a test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pytest
from tests.records import postgres_server

from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.records.store import Store


@pytest.fixture(scope="session")
def postgres() -> Iterator[postgres_server.Server]:
    """A running server of PostgreSQL."""
    if why := postgres_server.missing():
        pytest.skip(why)
    with postgres_server.server() as server:
        yield server


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.system)])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Place:
    """An empty place for a store in each database."""
    folder = tmp_path / "store"
    if request.param == "sqlite":
        return Place(folder)
    return Place(folder, request.getfixturevalue("postgres").new_database())


@pytest.fixture
def store(place: Place) -> Iterator[Store]:
    """A new store of phantoms in each database."""
    with place.open() as opened:
        yield opened


@dataclass(frozen=True, slots=True)
class Place:
    """A folder, and the URL of an empty database of PostgreSQL or None for SQLite."""

    folder: Path
    database: str | None = None

    def open(self, **options: Any) -> Store:
        return open_store(self.folder, database=self.database, **options)

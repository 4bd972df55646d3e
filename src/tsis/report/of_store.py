"""The report of a target by the names of its store and its own: what another process can be asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.model.errors import RecordsError
from tsis.records import open_store
from tsis.report.forms import page_bytes

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreAddress:
    """Where a store lies, and which one it is.

    Parameters
    ----------
    folder, kind, database
        As of `tsis.records.open_store`.
    identity
        Its own.
    """

    folder: Path
    kind: str
    database: str | None
    identity: str


def report_of_stored_target(place: StoreAddress, number: int, form: str) -> bytes:
    """The report of a target in a form of `tsis.report.forms.PAGES`, as the store holds it at this moment.

    Raises
    ------
    RecordsError
        When the store cannot be read, or another one lies there now.
    InputError
        When there is no target of that number.
    """
    with open_store(place.folder, kind=place.kind, database=place.database, create=False) as store:
        if store.identity != place.identity:
            raise RecordsError(f"the store must be {place.identity[:12]}, which was opened; got {store.identity[:12]}")
        return page_bytes(form, store.dossier(store.target(number)))

"""The anchor: the audit's last entry, kept in a file outside the database.

Who cuts the audit short in the database, or writes all of it anew, has to change this file as well. The file may lag
behind by the last commits of a machine that lost power, never be ahead of the database.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.instrument import shown
from tsis.instrument.file_bytes import read_object
from tsis.model import check
from tsis.model.durable import DISK, Disk, write_durably
from tsis.model.errors import RecordsError, TsisError
from tsis.records.audit import Head

if TYPE_CHECKING:
    from pathlib import Path

FILE = "audit-anchor.json"


def write_anchor(folder: Path, store: str, head: Head, *, disk: Disk = DISK) -> None:
    """Write the anchor of the store of that identity; OSError when it cannot be written."""
    document = {"notice": RESEARCH_USE_ONLY, "store": store, **asdict(head)}
    write_durably(folder / FILE, (json.dumps(document, indent=1) + "\n").encode(), disk=disk)


def read_anchor(folder: Path) -> tuple[str, Head]:
    """Identity of the store, and the audit's last entry as it was written last.

    Raises
    ------
    RecordsError
        When there is none, or it is damaged.
    """
    path = folder / FILE
    try:
        document = read_object(path)
        store, number, found = document.get("store"), document.get("number"), document.get("hash")
        for name, value in (("store", store), ("hash", found)):
            check.kind(name, value, str)
        return str(store), Head(number=check.whole("number", number, 0, 2**62), hash=str(found))
    except TsisError as error:
        raise RecordsError(f"the anchor of the audit, {shown(path)}, must be there and whole; {error}") from error

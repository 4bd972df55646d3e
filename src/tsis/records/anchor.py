"""The anchor: the audit's last entry, kept in a file outside the database.

Who cuts the audit short in the database, or writes all of it anew, has to change this file as well. It is written
after the commit, so it may lag behind by what was cut short in between or found the disk full, never be ahead; the
next that is stored brings it up to date. `tsis.records.verify_store` tells by how much it lags.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.instrument import printable_path
from tsis.instrument.file_bytes import read_object
from tsis.model.check import require_integer, require_type
from tsis.model.durable import DISK, Disk, write_durably
from tsis.model.errors import RecordsError, TsisError
from tsis.records.audit import FIRST, AuditChange, AuditHead, has_entry

if TYPE_CHECKING:
    from pathlib import Path

    from sqlalchemy import Connection

ANCHOR_FILE = "audit-anchor.json"
BEFORE = AuditHead(number=0, hash=FIRST)  # of a store that is about to be begun
LOST, KIND = "anchor missing", "anchor"  # action and kind of the entry that tells of a lost anchor


def write_anchor(folder: Path, store: str, head: AuditHead, *, disk: Disk = DISK) -> None:
    """Write the anchor of the store of that identity; OSError when it cannot be written."""
    document = {"notice": RESEARCH_USE_ONLY, "store": store, **asdict(head)}
    write_durably(folder / ANCHOR_FILE, (json.dumps(document, indent=1) + "\n").encode(), disk=disk, private=True)


def read_anchor(folder: Path) -> tuple[str, AuditHead]:
    """Identity of the store, and the audit's last entry as it was written last.

    Raises
    ------
    RecordsError
        When there is none, or it is damaged.
    """
    path = folder / ANCHOR_FILE
    try:
        document = read_object(path)
        store, number, found = document.get("store"), document.get("number"), document.get("hash")
        for name, value in (("store", store), ("hash", found)):
            require_type(name, value, str)
        return str(store), AuditHead(number=require_integer("number", number, 0, 2**62), hash=str(found))
    except TsisError as error:
        raise RecordsError(
            f"the anchor of the audit, {printable_path(path)}, must be there and whole; {error}"
        ) from error


def require_anchored(connection: Connection, folder: Path) -> bool:
    """Refuse to add to an audit that the anchor contradicts: the next anchor would cover up what was done to it.

    Returns
    -------
    bool
        Whether there is an anchor at all; somebody may have moved it away to go on without it.

    Raises
    ------
    RecordsError
        When the audit does not hold the entry that the anchor tells, or the anchor is damaged.
    """
    if not (folder / ANCHOR_FILE).exists():
        return False
    try:
        head = read_anchor(folder)[1]
    except RecordsError as error:
        raise RecordsError(f"{error} (to go on without it, of which the audit will tell, move it away)") from error
    if head != BEFORE and not has_entry(connection, head):
        raise RecordsError(
            f"the audit must hold entry {head.number} as {printable_path(folder / ANCHOR_FILE)} tells; it was cut off or "
            "rewritten, or the database is an older copy (tsis records verify tells more; to go on with what there "
            "is, move that file away)"
        )
    return True


def lost_after(head: AuditHead) -> AuditChange:
    """What the audit is told where there is no anchor although there are entries: nobody knows what was done to them.

    Without it the next anchor would vouch for all of them as if nothing had been.
    """
    return AuditChange(action=LOST, kind=KIND, row=ANCHOR_FILE, values={"number": head.number, "hash": head.hash})

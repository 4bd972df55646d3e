"""The secret of a store, from which pseudonyms are derived; no export contains it."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from typing import TYPE_CHECKING

from sqlalchemy import insert, select

from tsis.errors import RecordsError
from tsis.records.store._audit import AuditChange
from tsis.records.store._tables import audit_table, store_table

if TYPE_CHECKING:
    from sqlalchemy import Connection


TERM = "secret"  # its name in the store table
BYTES = 32


def new_secret() -> str:
    """A random secret as hexadecimal digits."""
    return secrets.token_hex(BYTES)


def derived(secret: str, what: str, identity: str) -> str:
    """HMAC-SHA-256 of an identity under the secret, as 64 hexadecimal digits."""
    return hmac.new(bytes.fromhex(secret), f"tsis {what}\0{identity}".encode(), hashlib.sha256).hexdigest()


def read_secret(connection: Connection) -> str | None:
    """The secret of a store; None in a store of an older release, `RecordsError` when it was changed or removed."""
    result = connection.execute(select(store_table.c.value).where(store_table.c.name == TERM)).scalar()
    if result is None:
        entered = (
            select(audit_table.c.number)
            .where((audit_table.c.kind == store_table.name) & (audit_table.c.row == TERM))
            .limit(1)
        )
        if connection.execute(entered).first() is None:
            return None
    elif isinstance(result, str) and len(result) == 2 * BYTES and set(result) <= set("0123456789abcdef"):
        return result
    raise RecordsError(
        "the secret of the store, from which pseudonyms follow, must be as it was made; it was changed or taken out "
        "(tsis records verify; take the database from a backup)"
    )


def entered_secret(connection: Connection) -> tuple[str, list[AuditChange]]:
    """The secret of a store, created where it has none, with the audit entries."""
    secret = read_secret(connection)
    if secret is not None:  # another program created it meanwhile
        return secret, []
    row = {"name": TERM, "value": new_secret()}
    connection.execute(insert(store_table).values(row))
    return row["value"], [AuditChange(action="add", kind=store_table.name, row=TERM, values=row)]

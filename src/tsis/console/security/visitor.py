"""Who was let in, as pages and calls learn it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from starlette.requests import HTTPConnection

VISITOR = "visitor"


@dataclass(frozen=True, slots=True, kw_only=True)
class Visitor:
    """Somebody whom the gate let in.

    Attributes
    ----------
    name
        Of the login; empty for who came with the console's key.
    """

    name: str = ""


def visitor_of(connection: HTTPConnection) -> Visitor:
    """Who sent this request or opened this WebSocket.

    Examples
    --------
    In a page: ``visitor_of(ui.context.client.request).name``.
    """
    found = connection.scope.get("state", {}).get(VISITOR)
    return found if isinstance(found, Visitor) else Visitor()

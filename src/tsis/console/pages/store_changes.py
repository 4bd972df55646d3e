"""When a store has changed, whoever changed it: this page, another one, the command line."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from tsis.model.errors import TsisError

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from tsis.console.pages.viewer import Viewer

CHANGES_EVERY_S = 1.0
_changes_log = logging.getLogger(__name__)


def follow_store(viewer: Viewer, changed: Callable[[], Awaitable[None]]) -> None:
    """Call ``changed`` now and after every change of the store, while the present part of the page is seen."""
    seen: list[int | None] = []

    async def look() -> None:
        try:
            entries = await viewer.entries()
        except TsisError as error:  # a page that is shown needs no sentence every second
            _changes_log.debug("the store was not read: %s", error)
            entries = -1
        if seen != [entries]:
            seen[:] = [entries]
            await changed()

    viewer.every(CHANGES_EVERY_S, look)

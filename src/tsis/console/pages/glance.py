"""The bench's state of a moment ago, and how often its store was changed, looked at once for all open pages."""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING, Generic, TypeVar

from nicegui import run

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.console.bench import Bench, BenchState

FRESH_S = 0.2  # for which a look at the state serves every page
ENTRIES_FRESH_S = 0.4  # for which one at the store does
Seen = TypeVar("Seen")


class Glance:
    """Looks at a bench in a thread, for a camera may take its time to tell its settings; used in one event loop.

    Parameters
    ----------
    bench
        What is looked at.
    """

    def __init__(self, bench: Bench) -> None:
        self._state = _Shared(lambda: bench.state(), FRESH_S)
        self._entries = _Shared(lambda: bench.store.entries(), ENTRIES_FRESH_S)

    async def state(self) -> BenchState | None:
        """The state as it was at most 0.2 s ago, the same object for all who ask meanwhile; None at the very end."""
        return await self._state.seen()

    async def entries(self) -> int | None:
        """How many entries the store's audit had at most 0.4 s ago, which grow with every change of whatever program.

        None at the very end; errors as of the store.
        """
        return await self._entries.seen()


class _Shared(Generic[Seen]):
    """One look for all who ask at the same time, and for a moment longer."""

    def __init__(self, look: Callable[[], Seen], fresh_s: float) -> None:
        self._look, self._fresh_s = look, fresh_s
        self._latest: Seen | None = None
        self._looked_s = 0.0
        self._looking: asyncio.Task[None] | None = None

    async def seen(self) -> Seen | None:
        if self._latest is None or time.monotonic() - self._looked_s > self._fresh_s:
            if self._looking is None or self._looking.done():
                self._looking = asyncio.ensure_future(self._take())
            await asyncio.shield(self._looking)
        return self._latest

    async def _take(self) -> None:
        self._latest = await run.io_bound(self._look)
        self._looked_s = time.monotonic()

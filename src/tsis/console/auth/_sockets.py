"""Open WebSockets: limited in number, and closed when their session ends."""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable


MOST = 64  # eight open pages of four tablets
CHECK_EVERY_S = 2.0
POLICY_VIOLATION = 1008  # code by which a WebSocket is closed
_log = logging.getLogger(__name__)


class OpenSockets:
    """Counts WebSockets, at most ``most`` at once, and cancels those of sessions that are over."""

    def __init__(self, *, most: int = MOST) -> None:
        self._most = most
        self._open: dict[asyncio.Task[object], Callable[[], bool]] = {}
        self._cut: set[asyncio.Task[object]] = set()

    @property
    def full(self) -> bool:
        """Whether no more may be opened."""
        return len(self._open) >= self._most

    async def serve(self, served: Awaitable[None], *, stays: Callable[[], bool]) -> bool:
        """Serve a WebSocket in the present task until it ends or is cancelled; whether it was cancelled.

        ``stays`` says whether its client is still authenticated.
        """
        task = asyncio.current_task()
        assert task is not None
        self._open[task] = stays
        try:
            await served
        except asyncio.CancelledError:
            if task not in self._cut:
                raise
            task.uncancel()
            return True
        finally:
            self._open.pop(task, None)
            self._cut.discard(task)
        return False

    def check(self) -> None:
        """Cancel those whose client is not authenticated any more, or cannot be checked."""
        for task, stays in list(self._open.items()):
            if task in self._cut:
                continue
            try:
                over = not stays()
            except Exception:  # the check of the other sockets goes on
                _log.exception("a WebSocket is closed, for it cannot be found out whether it may stay open")
                over = True
            if over:
                self._cut.add(task)
                task.cancel()

    async def watch(self) -> None:
        """Check at intervals, until cancelled."""
        with suppress(asyncio.CancelledError):
            while True:
                await asyncio.sleep(CHECK_EVERY_S)
                self.check()

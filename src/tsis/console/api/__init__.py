"""Calls for scripts: HTTP and JSON, described by OpenAPI. The models of pydantic end here."""

from __future__ import annotations

import asyncio
import threading
from contextlib import contextmanager
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fastapi import FastAPI
    from starlette.types import Receive, Scope, Send

    from tsis.console.files import Reports
    from tsis.console.services.instrument import Instrument

PLACE = "/api"
SOON_S = 5.0  # the first page is shown by then


class Calls:
    """The calls of an instrument, to be mounted at `PLACE`; pages do not wait for them to be built.

    The first call builds them, or a thread a while after the start. ``reports`` builds the reports of its store.
    """

    def __init__(self, instrument: Instrument, reports: Reports) -> None:
        self._instrument, self._reports = instrument, reports
        self._application: FastAPI | None = None
        self._building = threading.Lock()  # the first call and the thread may come together

    @property
    def application(self) -> FastAPI:
        """The application, which is built now if it was not yet."""
        with self._building:
            if self._application is None:
                build = import_module(f"{__name__}.application").api_app
                self._application = build(self._instrument, self._reports)
            built: FastAPI = self._application
        return built

    @contextmanager
    def built_soon(self) -> Iterator[None]:
        """Build the application some seconds after the start of the block."""
        building = threading.Timer(SOON_S, lambda: self.application)
        building.daemon = True
        building.start()
        try:
            yield
        finally:
            building.cancel()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a call."""
        if self._application is None:
            await asyncio.to_thread(lambda: self.application)
        await self.application(scope, receive, send)

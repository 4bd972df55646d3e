"""The addresses of files asked without a server between."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import httpx
from fastapi import FastAPI

from tsis.console.files import files_router

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from tsis.records.store import Store


class FilesOf:
    """Asks for files of a store."""

    def __init__(self, store: Store, *, workspace: Path | None = None) -> None:
        application = FastAPI()
        application.include_router(files_router(store, workspace=workspace))
        self._transport = httpx.ASGITransport(application)

    def get(self, address: str, headers: Mapping[str, str] | None = None) -> httpx.Response:
        """The answer to an address below the host."""

        async def requested() -> httpx.Response:
            async with httpx.AsyncClient(transport=self._transport, base_url="http://console") as client:
                return await client.get(address, headers=headers)

        return asyncio.run(requested())

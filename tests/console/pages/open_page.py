"""A page without a browser: its elements exist, and their actions can be called."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any, cast

from nicegui import Client
from nicegui.page import page

from tsis.console.viewer import StatePoller, Tabs, Viewer

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from nicegui.element import Element
    from nicegui.elements.mixins.text_element import TextElement

    from tsis.console.services.instrument import Instrument


class RecordingViewer(Viewer):
    """A viewer with a fixed name, which records the messages to it."""

    def __init__(self, client: Client, instrument: Instrument) -> None:
        super().__init__(client, instrument, StatePoller(instrument), Tabs())
        client.tab_id = "1"  # as if a browser had connected
        self.complaints: list[str] = []

    @property
    def name(self) -> str:
        return "Ann"

    def complain(self, message: str) -> None:
        self.complaints.append(message)


def on_a_page(instrument: Any, command: Callable[[RecordingViewer], Awaitable[None]]) -> None:
    """Open a page of an instrument, or of a substitute, and run a call on it."""

    async def done() -> None:
        client = Client(page("/"))
        try:
            with client:
                await command(RecordingViewer(client, cast("Instrument", instrument)))
        finally:
            client.delete()

    asyncio.run(done())


def texts(viewer: RecordingViewer) -> list[str]:
    """All texts of the page that are shown."""
    elements: list[Element] = list(viewer._client.elements.values())
    return [cast("TextElement", item).text for item in elements if getattr(item, "text", "") and item.visible]

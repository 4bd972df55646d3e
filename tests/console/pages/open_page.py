"""A page that is open in no browser: its elements are there, and what they would do can be done."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any, cast

from nicegui import Client
from nicegui.page import page

from tsis.console.pages.components import StatePoller, Tabs, Viewer

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from nicegui.element import Element
    from nicegui.elements.mixins.text_element import TextElement

    from tsis.console.services import Instrument


class Told(Viewer):
    """A viewer whose name is known without a request, and who keeps what he is told."""

    def __init__(self, client: Client, bench: Instrument) -> None:
        super().__init__(client, bench, StatePoller(bench), Tabs())
        client.tab_id = "1"  # as if a browser had connected
        self.complaints: list[str] = []

    @property
    def name(self) -> str:
        return "Ann"

    def complain(self, sentence: str) -> None:
        self.complaints.append(sentence)


def on_a_page(bench: Any, act: Callable[[Told], Awaitable[None]]) -> None:
    """Open a page on a bench, or on what stands for one, and do something on it."""

    async def done() -> None:
        client = Client(page("/"))
        try:
            with client:
                await act(Told(client, cast("Instrument", bench)))
        finally:
            client.delete()

    asyncio.run(done())


def texts(viewer: Told) -> list[str]:
    """All texts of the page that are shown."""
    elements: list[Element] = list(viewer._client.elements.values())
    return [cast("TextElement", each).text for each in elements if getattr(each, "text", "") and each.visible]

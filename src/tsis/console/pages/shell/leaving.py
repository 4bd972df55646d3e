"""The way out, for who came in by a login."""

from __future__ import annotations

from nicegui import ui

from tsis.console.security.door import LOGOUT
from tsis.console.security.visitor import visitor_of


class Leaving:
    """Says as whom one is in, and logs out; whoever came with the console's key sees nothing of it."""

    def __init__(self) -> None:
        name = visitor_of(ui.context.client.request).name
        if not name:
            return
        with ui.element("form").props(f'method="post" action="{LOGOUT}"').classes("leaving"):
            ui.label(f"You are in as {name}.")
            with ui.element("button").props('type="submit"'):
                ui.label("Log out")

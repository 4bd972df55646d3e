"""A question before something is taken away."""

from __future__ import annotations

from nicegui import ui


async def asked(question: str, *, yes: str, why: str = "") -> bool:
    """Ask, and say whether the answer was yes; no answer is no."""
    with ui.dialog() as dialog, ui.card(), ui.element("div").classes("question"):
        ui.label(question).classes("strong")
        if why:
            ui.label(why).classes("muted")
        with ui.element("div").classes("row"):
            ui.element("div").classes("spring")
            ui.button("Cancel", on_click=lambda: dialog.submit(False)).props("flat no-caps")
            ui.button(yes, on_click=lambda: dialog.submit(True)).props("unelevated no-caps")
    answer = bool(await dialog)
    dialog.delete()
    return answer

"""Which calibration: one that goes on, or a new one on terms that are stated here."""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import quote

from nicegui import run, ui

from tsis.console.pages.calibrate.terms_form import TermsForm
from tsis.console.pages.headings import panel_title
from tsis.console.pages.operated import Operated

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.console.bench import Bench, BenchState
    from tsis.console.bench.calibrating import SessionSummary
    from tsis.console.pages.viewer import Viewer

LOOK_S = 2.0  # between two looks at the folder


def page(bench: Bench, viewer: Viewer) -> None:
    """Build the page."""
    operated = Operated(viewer)
    with ui.element("div").classes("split calibrate-choosing"):
        with ui.element("section").classes("panel"):
            panel_title("Sessions")
            listed = ui.element("div").classes("stack")
        with ui.element("section").classes("panel"):
            panel_title("Begin a calibration")
            form = TermsForm(bench, viewer, operated)
            operated.why()
    shown: list[Sequence[SessionSummary]] = []

    async def look() -> None:
        found = await run.io_bound(bench.calibrating.listed)
        if found is None or shown == [found]:
            return
        shown[:] = [found]
        listed.clear()
        with listed:
            session_list(found)

    def show(state: BenchState) -> None:
        form.show(state)
        operated.show(state)

    viewer.every(LOOK_S, look)
    viewer.follow(show)


def session_list(found: Sequence[SessionSummary]) -> None:
    """Every session with how far it is, each a link."""
    if not found:
        ui.label(
            "None yet. A calibration tells what a grey level is in newtons and a pixel in millimetres; begin one, and "
            "it leads through its steps. It can be interrupted at any time and goes on where it was left."
        ).classes("muted")
        return
    with ui.element("ul").classes("calibrate-sessions"):
        for each in found:
            with ui.element("li"), ui.element("div").classes("row"):
                if each.trouble:
                    ui.label(each.name).classes("strong")
                    ui.label(each.trouble).classes("doubtful")
                    continue
                ui.link(each.title or each.name, f"/calibrate/{quote(each.name)}").classes("strong").mark(
                    f"session {each.name}"
                )
                ui.label(f"{each.probe}, {each.camera}").classes("muted")
                ui.element("div").classes("spring")
                ui.label(progress_words(each)).classes("good" if each.made else "muted")


def progress_words(each: SessionSummary) -> str:
    """How far a session is."""
    if each.made:
        return "calibration made"
    return f"{each.done} of {each.total} steps"

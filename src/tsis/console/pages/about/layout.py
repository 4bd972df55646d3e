"""The page About."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.console.pages.about.citation import LICENCE, citation, licence
from tsis.console.pages.about.facts import calibration_facts, camera_facts, place_facts, version_facts
from tsis.console.pages.calibration_seen import CalibrationSeen
from tsis.console.pages.examine.keys import KEYS
from tsis.console.pages.fact_list import FactList
from tsis.console.pages.headings import panel_title

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.console.bench import Bench, BenchState
    from tsis.console.pages.viewer import Viewer

DESCRIPTION = "/api/openapi.json"
MOUSELESS = ("Tab, Enter", "reach and use every control without a mouse")
FINDINGS = (
    "Numbers and pictures here describe objects that were pressed, and how well they are known. They are no findings "
    "about anybody's health, and no advice."
)


async def page(bench: Bench, viewer: Viewer) -> None:
    """Build the page."""
    with ui.element("div").classes("about"):
        with _panel("Research use only"):
            ui.label(RESEARCH_USE_ONLY).classes("strong")
            ui.label(FINDINGS)
        with _panel("Calibration"):
            calibration = FactList()
        with _panel("Camera"):
            camera = FactList()
        with _panel("Where things are kept"):
            places = FactList()
        with _panel("Versions"):
            versions = FactList()
        with _panel("Keys on the page Examine"):
            FactList().show((*KEYS.items(), MOUSELESS))
        with _panel("For scripts"):
            _for_scripts()
        with _panel("To cite it"):
            for sentence in citation():
                ui.label(sentence)
        with _panel(f"Licence: {LICENCE}"), ui.expansion("Read it").props("dense").classes("licence"):
            ui.label(licence()).classes("whole-text")

    in_force = CalibrationSeen(bench)

    def show(state: BenchState) -> None:
        calibration.show(calibration_facts(state, in_force.of(state)))
        camera.show(camera_facts(state))

    viewer.follow(show)
    versions.show(await viewer.attempt(version_facts) or ())
    places.show(await viewer.attempt(place_facts, bench) or ())


@contextmanager
def _panel(title: str) -> Iterator[None]:
    with ui.element("section").classes("panel"):
        panel_title(title)
        yield


def _for_scripts() -> None:
    ui.label("What pages do, scripts can do by HTTP and JSON, with the same rights and behind the same key.")
    with ui.element("p"):
        ui.label("The calls and their values: ")
        ui.link(DESCRIPTION, DESCRIPTION, new_tab=True)

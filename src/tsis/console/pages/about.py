"""About: calibration, storage, versions, citation, licence."""

from __future__ import annotations

from contextlib import contextmanager
from importlib import metadata
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.console import widgets
from tsis.records.provenance import environment

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.calibration.frames import UsableCalibration
    from tsis.console.services.instrument import Instrument
    from tsis.console.services.state import InstrumentState
    from tsis.console.viewer import Viewer


CITATION = (
    f"the TSIS founders, tsis: open software for optical tactile imaging, version {__version__}.",
    'J.-H. Lee, "Tactile Sensation Imaging System and Algorithms for Tumor Detection", Ph.D. dissertation, '
    "Temple University, 2011.",
)
LICENCE = "BSD-3-Clause"


def licence() -> str:
    """The licence's whole text; its name alone where the installation came without the file."""
    return metadata.distribution("tsis").read_text("licenses/LICENSE") or LICENCE


Facts = tuple[tuple[str, str], ...]
ALSO = ("matplotlib", "sqlalchemy", "nicegui", "fastapi", "uvicorn")  # beside those that change results
SHORT = 16  # digits of a SHA-256 that tell one calibration from another on a page


def version_facts() -> Facts:
    """Of this program, of what it runs on, and of the libraries that it rests on."""
    versions = environment()
    libraries = {**versions["libraries"], **{name: metadata.version(name) for name in ALSO}}
    return (
        ("tsis", versions["tsis"]),
        ("Code", f"SHA-256 {versions['code_sha256'][:SHORT]}…"),
        ("Python", f"{versions['python']} on {versions['machine']}"),
        *libraries.items(),
    )


def calibration_facts(state: InstrumentState, cited: UsableCalibration | None) -> Facts:
    """The active calibration."""
    if cited is None and state.camera.choice.is_virtual:
        return (("Active", "the virtual probe's own, once it runs"),)
    if cited is None:
        return (("Active", "none; lengths are in pixels, and nothing can be estimated"),)
    calibration = cited.calibration
    dates: Facts = (("Made", "with the virtual probe; it does not expire"),)
    if calibration.made is not None and calibration.expires is not None:
        dates = (
            ("Made", widgets.time_label(calibration.made)),
            ("Good until", widgets.time_label(calibration.expires)),
        )
    return (
        ("Active", calibration.name),
        ("Identity", f"SHA-256 {cited.identity[:SHORT]}…"),
        *dates,
        ("Probe", calibration.probe or "not stated"),
        ("Camera", calibration.camera or "any; not stated"),
    )


def camera_facts(state: InstrumentState) -> Facts:
    """The camera and the seed of the virtual one."""
    now = state.camera
    size = f"{now.columns} x {now.rows} pixels" if now.rows else "not known before it runs"
    choice = now.choice
    name = now.name or ("the virtual probe" if choice.is_virtual else choice.spec)
    results = [("Camera", name), ("Mode", now.mode or "not known before it runs"), ("Image size", size)]
    if choice.is_virtual:
        results += [
            ("Probe", choice.probe),
            ("Pressed object", choice.phantom),
            ("Seed of the errors", str(choice.seed)),
        ]
    return tuple(results)


def place_facts(instrument: Instrument) -> Facts:
    """Where data are stored, and how much."""
    store, targets = instrument.store, instrument.store.targets()
    return (
        ("Snapshots and sequences", str(instrument.terms.workspace.resolve())),
        ("Store of records", str(store.folder.resolve())),
        ("Database", "in SQLite, in that folder" if instrument.terms.database is None else "in PostgreSQL"),
        ("Kind of targets", f"{store.kind}s"),
        ("Targets", str(len(targets))),
        ("Presses", str(sum(item.presses for item in targets))),
        ("Estimates", str(sum(item.estimates for item in targets))),
    )


DESCRIPTION = "/api/openapi.json"
FINDINGS = "Numbers and images describe pressed objects and their uncertainty. They are not medical findings or advice."


async def about_page(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page."""
    with ui.element("div").classes("about"):
        with _panel("Research use only"):
            ui.label(RESEARCH_USE_ONLY).classes("strong")
            ui.label(FINDINGS)
        with _panel("Calibration"):
            calibration = widgets.FactList()
        with _panel("Camera"):
            camera = widgets.FactList()
        with _panel("Where data are stored"):
            positions = widgets.FactList()
        with _panel("Versions"):
            versions = widgets.FactList()
        with _panel("API for scripts"):
            ui.label("Scripts can do what the pages do, over HTTP and JSON, with the same key and permissions.")
            ui.link("API description (OpenAPI)", DESCRIPTION, new_tab=True)
        with _panel("Citation"):
            for message in CITATION:
                ui.label(message)
        title = f"Licence: {LICENCE}"
        with _panel(title), ui.expansion("Read the licence").props("dense").classes("licence"):
            ui.label(licence()).classes("whole-text")

    def show(state: InstrumentState) -> None:
        calibration.show(calibration_facts(state, state.active))
        camera.show(camera_facts(state))

    viewer.follow(show)
    versions.show(await viewer.attempt(version_facts) or ())
    positions.show(await viewer.attempt(place_facts, instrument) or ())


@contextmanager
def _panel(title: str) -> Iterator[None]:
    with widgets.panel(title, style="panel"):
        yield

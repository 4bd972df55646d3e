"""Map: several lumps in three dimensions."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from nicegui import ui

from tsis.__about__ import LARGEST_TARGET
from tsis.catalog.probes import list_probes
from tsis.console import widgets
from tsis.console.messages import field_messages, plain_message
from tsis.console.services.jobs import DONE
from tsis.console.services.maps import MapQuestion, MapRepository, OpenedScan, map_of
from tsis.mapping.prior import MapPrior
from tsis.mapping.scan import Indenter
from tsis.mapping.scan_folder import POSES_FILE
from tsis.model.image import require_pixel_scale
from tsis.present.lump_map import lump_balls, scan_picture, scan_summary
from tsis.present.page import address

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import Job, JobState
    from tsis.console.services.maps import MapResult
    from tsis.console.viewer import Viewer
    from tsis.mapping.lump_map import LumpMap
    from tsis.mapping.scan_folder import StoredScan
    from tsis.present.page import Picture


SAYS = (
    "Drop poses.csv (file, x_mm, y_mm) and the presses that it names, or one table of travel and force. They stay on "
    "the console's computer. The map of a target's scan is kept in the records."
)
ENDINGS = (".csv", ".txt", ".tsv", ".xlsx", ".json", ".png", ".bmp", ".tif", ".tiff", ".jpg", ".jpeg")
EVERY_S = 0.4  # between two readings of the job
DEFAULT_PROBE = "tsis-2011"
BACKGROUND, LUMP_COLOUR, PRESS_COLOUR, EDGE_COLOUR = "#f4f6f8", "#c62828", "#222222", "#607080"  # of the 3-D view
OF_SCAN = "as the scan states"
TARGET = "Or the scan of target"
SHAPES = {"": "a probe", "ball": "a ball", "punch": "a flat punch"}
LABELS = {  # of the fields, by the parameters that errors name
    "tissue_young_kpa": "Modulus of the tissue",
    "thickness_mm": "Thickness of the tissue",
    "radius_mm": "Radius of the indenter",
    "mm_per_pixel": "Scale, or x,y",
}


@dataclass(slots=True)
class MapDraft:
    """The opened scan, the contents of the fields, and the newest job."""

    opened: OpenedScan = field(default_factory=OpenedScan)
    probe: str = OF_SCAN
    texts: dict[str, str] = field(
        default_factory=lambda: {"tissue_young_kpa": "", "thickness_mm": "30", "radius_mm": "", "mm_per_pixel": ""}
    )
    shape: Literal["", "ball", "punch"] = ""
    job: Job | None = None
    newest: LumpMap | None = None  # by which the next press is guided
    mapped: int = 0  # version of the scan that it has

    def prior(self) -> MapPrior:
        """What is believed of tissue and lumps; `InputError` for an invalid field."""
        with field_messages(LABELS):
            prior = MapPrior(thickness_mm=widgets.typed_number(LABELS["thickness_mm"], self.texts["thickness_mm"]))
            typed = self.texts["tissue_young_kpa"].strip()
            return (
                replace(prior, tissue_young_kpa=widgets.typed_number(LABELS["tissue_young_kpa"], typed))
                if typed
                else prior
            )

    def read(self) -> StoredScan:
        """The opened scan; errors as of `tsis.mapping.scan_folder.read_scan`."""
        with field_messages(LABELS):
            scale = widgets.typed_numbers(LABELS["mm_per_pixel"], self.texts["mm_per_pixel"])
            radius = self.texts["radius_mm"]
            indenter = (
                Indenter(shape=self.shape, radius_mm=widgets.typed_number(LABELS["radius_mm"], radius))
                if self.shape
                else None
            )
            return self.opened.read(require_pixel_scale((scale[0], scale[-1])) if scale else None, indenter)


class MapPage:
    """The scan, what is known of tissue and probe, the map, and the maps before it."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._draft = viewer.saved(MapDraft)
        self._maps = MapRepository(instrument.terms.workspace)
        self._shown: Job | None = None
        with ui.element("div").classes("stack"):
            with widgets.panel("Scan"):
                self._files()
                self._summary = ui.element("section").classes("stack").props('role=status aria-label="Opened scan"')
            with widgets.panel("Tissue and probe"):
                self._fields()
            self._result = ui.element("section").classes("panel stack").props('aria-label="Map"')
            self._result.set_visibility(False)
            with widgets.panel("Earlier maps"):
                self._earlier = widgets.scrolling("Earlier maps")
        ui.timer(EVERY_S, self._refresh)
        ui.timer(0.0, self._first, once=True)

    async def _first(self) -> None:
        await self._list()
        if self._draft.opened.chosen:
            await self._read()

    def _files(self) -> None:
        widgets.muted(SAYS)
        self._upload = widgets.FilesField(
            self._viewer,
            "Choose the files of a scan",
            "Folder or table on the console's computer",
            accept=ENDINGS,
            folder=lambda: self._draft.opened.uploads,
            opened=self._opened,
        )
        with ui.element("div").classes("row"):
            self._number = widgets.unit_field(TARGET, keys="numeric").on("keydown.enter", self._open_target)
            widgets.button("Open the target", self._open_target, icon="folder_open")
        with self._upload.row:
            widgets.button("Use a simulated scan", self._simulate, icon="science")
            widgets.button("Close the scan", self._close, icon="close")

    def _fields(self) -> None:
        draft = self._draft
        with ui.element("div").classes("row"):
            widgets.select_field([OF_SCAN, *list_probes()], value=draft.probe, label="Probe of the scan").bind_value_to(
                draft, "probe"
            )
            self._typed("tissue_young_kpa", "kPa")
            self._typed("thickness_mm", "mm")
        widgets.muted("Modulus left empty: 5 kPa; of an indenter's presses, that of the median press.")
        with ui.element("div").classes("row"):
            self._typed("mm_per_pixel", "mm/pixel")
            shape = widgets.select_field(SHAPES, value=draft.shape, label="Pressed by").classes("kind-choice")
            shape.bind_value_to(draft, "shape")
            self._typed("radius_mm", "mm")
        active = self._instrument.calibration is not None
        widgets.muted(
            "Frames of a folder are read with the active calibration, those of a target with the one they cite."
            if active
            else "No calibration is active: a folder of frames needs one (page Camera)."
        )
        with ui.element("div").classes("row"):
            self._start = widgets.button("Map the lumps", self._started, icon="scatter_plot", look="unelevated")
            self._follow = ui.switch("Update the map as a press arrives", value=True)
        self._job = widgets.JobLine("Progress of the map", self._cancelled)

    def _typed(self, name: str, unit: str) -> None:
        texts = self._draft.texts
        shown = widgets.unit_field(LABELS[name], texts[name], unit=unit).classes("long-label")
        shown.on_value_change(lambda event: texts.update({name: event.value or ""}))

    async def _opened(self, path: Path, uploaded: bool) -> None:
        if uploaded:
            self._draft.opened.uploaded(path)
        else:
            self._draft.opened.open(path)
        await self._read(quiet=uploaded)  # the files of a scan arrive one by one

    async def _open_target(self) -> None:
        def opened() -> bool:
            number = widgets.typed_integer(TARGET, self._number.value, 1, LARGEST_TARGET)
            self._draft.opened.open_target(self._instrument.store, number)
            return True

        if await self._viewer.attempt(opened):
            await self._read()

    def _close(self) -> None:
        self._draft.opened.clear()
        self._upload.element.reset()
        self._summary.clear()
        with self._summary:
            widgets.muted("No scan is open.")

    async def _simulate(self) -> None:
        with self._summary:
            self._summary.clear()
            widgets.muted("The virtual probe presses at 25 places; the first time takes a minute.")
        await self._viewer.attempt(self._draft.opened.simulate, 0)
        await self._read()

    async def _read(self, *, quiet: bool = False) -> None:
        """Read the scan, and show its presses; ``quiet`` shows an error beside them, not as a message."""
        found: list[tuple[StoredScan, Picture, str]] = []

        def read() -> None:
            stored = self._draft.read()
            picture = scan_picture(stored.scan)
            found.append((stored, picture, address(picture)))

        refusal = await self._viewer.refusal(read)
        if refusal is not None and not quiet:
            self._viewer.complain(plain_message(refusal))
        if self._summary.is_deleted:
            return
        self._summary.clear()
        with self._summary:
            if not found:
                widgets.muted(
                    f"Not complete yet: {plain_message(refusal)}" if quiet and refusal else "No scan is open."
                )
                return
            stored, picture, source = found[0]
            ui.label(scan_summary(stored.scan, probe=stored.probe)).classes("strong")
            if self._draft.opened.simulated:
                widgets.muted("Simulated by the map's own model: it shows how the page works, not how well.")
            widgets.message_list(stored.scan.left_out)
            with ui.element("div").classes("map-places"):
                widgets.figure(picture, source)

    async def _started(self) -> None:
        await self._begin(None)

    async def _begin(self, start: LumpMap | None) -> None:
        """Map the scan, or update ``start`` by its newest presses."""
        draft = self._draft

        def asked() -> MapQuestion:
            version, of_target = draft.opened.version(), draft.opened.of_target()
            prior, stored = draft.prior(), draft.read() if of_target is None else of_target.stored
            calibration = None if of_target is None else of_target.calibration
            stated = stored.probe or DEFAULT_PROBE
            probe = "" if stored.scan.kind == "travel_force" else stated if draft.probe == OF_SCAN else draft.probe
            draft.mapped = version
            return MapQuestion(
                stored=stored,
                probe=probe,
                calibration=calibration or self._instrument.calibration,
                prior=prior,
                tissue_known=bool(draft.texts["tissue_young_kpa"].strip()),
                start=start,
                of_target=of_target,
            )

        question = await self._viewer.attempt(asked)
        if question is not None:
            title = f"{'map' if start is None else 'update'} of {question.stored.scan.name or 'a scan'}"
            draft.job = self._instrument.jobs.begin(title, map_of(question, self._maps, widgets.drawings))
            self._refresh()

    async def _press_next(self) -> None:
        """Press the virtual probe at the place that the newest map names."""
        newest = self._draft.newest
        if newest is None or not newest.trusted or not newest.next_places:
            self._viewer.complain("No map names a next place yet: map the lumps first.")
            return
        place = newest.next_places[0]
        await self._viewer.attempt(self._draft.opened.press_at, (place.x_mm, place.y_mm))
        await self._read()

    def _cancelled(self) -> None:
        if self._draft.job is not None:
            self._draft.job.end()

    def _refresh(self) -> None:
        job = self._draft.job
        state = None if job is None else job.state()
        running = self._job.show(state, running_text(state))
        self._start.set_enabled(not running)
        if job is None or state is None:
            return
        draft = self._draft
        if not running and self._follow.value and draft.newest is not None:
            version = draft.opened.version()
            if version not in {0, draft.mapped}:
                draft.mapped = version  # a press arrived, or was taken out
                ui.timer(0.0, lambda: self._begin(draft.newest), once=True)
                return
        if not running and job is not self._shown:
            self._shown = job
            if state.status == DONE and job.result is not None:
                draft.newest = job.result.found
                self._show(job.result)
                ui.timer(0.0, self._list, once=True)

    def _show(self, result: MapResult) -> None:
        self._result.clear()
        self._result.set_visibility(True)
        with self._result:
            with widgets.title_row(f"{result.page.title}: {result.page.subtitle}"):
                if result.target is not None:
                    ui.link(f"Target {result.target}", f"/records/{result.target}").classes("link")
                if result.name:
                    self._downloads(result.name)
            if result.found.trusted:
                self._guide(result.found)
            widgets.report_parts(result.page, result.pictures)

    def _guide(self, found: LumpMap) -> None:
        """The next place, and the lumps in a view that turns."""
        if found.next_places:
            place = found.next_places[0]
            ui.label(f"Next place: x {place.x_mm:.1f} mm, y {place.y_mm:.1f} mm").classes("strong")
            off = 100 * (1 - np.exp(-place.gain_nats))
            widgets.muted(f"A press there would take about {off:.0f} % off the joint uncertainty of the lumps.")
        with ui.element("div").classes("row"):
            if self._draft.opened.simulated:
                widgets.button("Press there with the virtual probe", self._press_next, icon="touch_app")
            else:
                widgets.muted(f"Press there, and add the press to {POSES_FILE}: the map follows.")
        turning_view(found)

    async def _list(self) -> None:
        names = await self._viewer.attempt(self._maps.names)
        if self._earlier.is_deleted:
            return
        self._earlier.clear()
        with self._earlier:
            if not names:
                widgets.muted("No map was made yet.")
                return
            with widgets.rows_under(("Map", "Files"), label="Earlier maps"):
                for name in names:
                    with ui.element("tr"):
                        widgets.cell(name)
                        with ui.element("td"):
                            self._downloads(name)

    def _downloads(self, name: str) -> None:
        with ui.element("div").classes("row"):
            for file in self._maps.files(name):
                label = f"Download {file} of map {name}"
                widgets.button(file, lambda file=file: self._download(name, file), look="flat dense", label=label)

    async def _download(self, name: str, file: str) -> None:
        content = await self._viewer.attempt(self._maps.content, name, file)
        if content is not None:
            ui.download.content(content, f"{name}-{file}")


def running_text(state: JobState | None) -> str:
    """What a map that is being made does just now."""
    if state is None or not state.total:
        return "Mapping: the first map of a probe takes a minute longer."
    return f"Mapping, then drawing: {100 * state.fraction:.0f} % done."


def turning_view(found: LumpMap) -> None:
    """Draw lumps, samples of their posterior and presses in three dimensions; the view turns, and needs no network."""
    numbers = found.numbers
    low, high = (np.array([end(numbers.x_mm), end(numbers.y_mm)]) for end in (np.min, np.max))
    middle, size = (low + high) / 2, high - low
    thickness = float(numbers.depth_mm[-1] + numbers.depth_mm[0])
    widgets.muted("Drag to turn, scroll to zoom. Solid: medians; faint: samples, whose spread is the uncertainty.")
    with ui.scene(width=640, height=400, grid=False, background_color=BACKGROUND) as scene:
        for x, y in found.places_mm.tolist():
            scene.cylinder(0.6, 0.6, 0.3).move(x, y, 0.0).rotate(np.pi / 2, 0.0, 0.0).material(PRESS_COLOUR)
        for depth in (0.0, thickness):  # skin and support
            corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
            for (x, y), (u, v) in zip(corners, corners[1:] + corners[:1], strict=True):
                scene.line([x, y, -depth], [u, v, -depth]).material(EDGE_COLOUR)
        for ball in lump_balls(numbers):
            sphere = scene.sphere(ball.diameter_mm / 2).move(ball.x_mm, ball.y_mm, ball.z_mm)
            sphere.material(LUMP_COLOUR, opacity=ball.opacity)
    scene.move_camera(
        x=middle[0],
        y=middle[1] - 1.3 * size[1],
        z=0.8 * size.max(),
        look_at_x=middle[0],
        look_at_y=middle[1],
        look_at_z=-thickness / 3,
        duration=0.0,
    )
    scene.classes("lumps").props('role=img aria-label="Lumps in three dimensions"')


async def map_page(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page with this tab's draft."""
    await ui.context.client.connected()
    MapPage(instrument, viewer)

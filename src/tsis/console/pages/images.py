"""My images: files of the user, measured and saved as presses."""

from __future__ import annotations

import base64
import shutil
import tempfile
import threading
import weakref
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.__about__ import LARGEST_TARGET
from tsis.calibration.frames import read_press_image
from tsis.console import widgets
from tsis.console.files import thumbnail_png
from tsis.console.live.panel import still_panel
from tsis.console.services.captures import (
    IMAGE_ROLES,
    MOST_OWN_FRAMES,
    OPENABLE,
    SIDECAR,
    OwnImage,
    measure_images,
    open_images,
    save_images,
)
from tsis.model.image import require_pixel_scale
from tsis.model.require import require_number
from tsis.present.images import finding_notes, finding_rows
from tsis.present.page import Table
from tsis.records.sources import ImportOptions
from tsis.records.values import ROLE_NAMES

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.calibration.file import ProbeCalibration
    from tsis.console.services.instrument import Instrument
    from tsis.console.viewer import Viewer
    from tsis.imaging.contact import ImageFinding


SAYS = (
    "Drop images (PNG, BMP, TIFF, JPEG), videos and sidecars of snapshots here: at most {frames} frames, "
    "{most} MiB a file. They stay on the console's computer; nothing is stored before you save them."
)


def images_page(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page."""
    with ui.element("div").classes("stack"):
        OwnImagesPage(instrument, viewer)


THUMBNAIL_PX = 120


@dataclass(slots=True, kw_only=True)
class OpenedFrame:
    """A frame of the user, with what was chosen and typed for it, and its picture as a data address."""

    image: OwnImage
    picture: str
    role: str
    force: str


class OpenedFrames:
    """The frames that a tab has opened: they stay while other pages are shown, in a folder that goes with them."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="tsis-images-"))
        weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)
        self.frames: dict[Path, OpenedFrame] = {}  # another one after each change, since files arrive at once
        self._changing = threading.Lock()
        self.scale = ""

    def open(self, paths: Sequence[Path]) -> tuple[str, ...]:
        """Open files and folders; gives a message for each that cannot be opened.

        A sidecar tells of the frames that lie beside it already.
        """
        beside = [file for file in self.frames if any(path.suffix == SIDECAR for path in paths)]
        opened = open_images([*paths, *beside], frames_in=self.folder)
        found: dict[Path, OpenedFrame] = {}
        for image in opened.images:
            before = self.frames.get(image.path)
            if before is not None and before.image == image:  # what was typed for it stays
                continue
            force = widgets.number_text_of_field(image.force_n)
            picture = _picture(image) if before is None else before.picture
            found[image.path] = OpenedFrame(image=image, picture=picture, role=image.role, force=force)
        with self._changing:
            room = MOST_OWN_FRAMES - len(self.frames.keys() - found.keys())
            frames = (self.frames | dict(list(found.items())[: max(room, 0)])).items()
            self.frames = dict(sorted(frames, key=lambda item: item[1].image.order))
        return opened.refused

    def remove(self, path: Path) -> None:
        """Take a frame out."""
        with self._changing:
            self.frames = {other: frame for other, frame in self.frames.items() if other != path}


def _picture(image: OwnImage) -> str:
    frame = read_press_image(image.path)
    content = thumbnail_png(frame.grey, full_scale=frame.full_scale, size=THUMBNAIL_PX, name="viridis")
    return f"data:image/png;base64,{base64.b64encode(content).decode()}"


class OwnImagesPage:
    """The opened frames with their roles and forces, what they measure, and the button that saves them."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._opened = viewer.saved(OpenedFrames)
        self.rows: list[FrameRow] = []
        with widgets.panel("My images"):
            widgets.muted(SAYS.format(frames=MOST_OWN_FRAMES, most=widgets.LARGEST_MIB))
            self.files = widgets.FilesField(
                viewer,
                "Choose images",
                "File or folder on the console's computer",
                accept=OPENABLE,
                folder=lambda: self._opened.folder,
                opened=self.open,
            )
            self._refused = widgets.message_list()
        with widgets.panel("Frames") as self._panel:
            with widgets.scrolling("Opened frames"):
                headings = ("Picture", "File", "Size", "Pressed on", "Force", "")
                self._rows = widgets.rows_under(headings, label="Frames")
            with ui.element("div").classes("row"):
                self.scale_field = widgets.unit_field("Scale, or x,y", self._opened.scale, unit="mm/pixel")
                self.scale_field.on_value_change(lambda event: setattr(self._opened, "scale", event.value or ""))
                self._invert = ui.switch("Light falls where pressed", value=False)
                active = instrument.calibration is not None
                self._calibrated = ui.switch("Taken with the active calibration", value=False)
                self._calibrated.set_enabled(active)
            widgets.muted("" if active else "No calibration is active: it can be named later, on the target's page.")
            with ui.element("div").classes("row"):
                self._measure = widgets.button("Measure contact", self.measure, icon="straighten")
                self.number_field = widgets.unit_field("Target (empty: a new one)", "").classes("long-label")
                self._save = widgets.button("Save as target", self.save, icon="save", look="unelevated")
        self._results = ui.element("section").classes("stack").props("role=status")
        self._show()

    async def open(self, path: Path, _: bool = False) -> None:
        """Open a file or folder, and say what of it cannot be opened."""
        refused = await self._viewer.attempt(self._opened.open, [path])
        with self._refused:
            for message in refused or ():
                widgets.list_message(message, "flag")
        self._show()

    def _show(self) -> None:
        self._rows.clear()
        with self._rows:
            self.rows = [FrameRow(frame, self._remove, self.view) for frame in self._opened.frames.values()]
        self._panel.set_visibility(bool(self.rows))

    async def view(self, row: FrameRow) -> None:
        """Show a frame with all tools; the scale as typed."""
        image = await widgets.submit(
            self._viewer,
            {"mm_per_pixel": self.scale_field},
            lambda: replace(read_press_image(row.frame().path), mm_per_pixel=self._known_scale()),
        )
        if image is not None:
            with widgets.open_dialog(self._results, row.name, style="dialog-card wide") as dialog:
                still_panel(image, f"Frame {row.name}")
                widgets.button("Close", dialog.close)

    def _remove(self, row: FrameRow) -> None:
        self._opened.remove(row.path)
        self._show()

    def scale(self) -> tuple[float, float] | None:
        """The typed scale (x, y) in millimetres per pixel; `InputError` when it is no scale."""
        parts = widgets.typed_numbers("mm_per_pixel", self.scale_field.value)
        return require_pixel_scale((parts[0], parts[-1])) if parts else None

    def _calibration(self) -> ProbeCalibration | None:
        """That of the frames, where the operator says that they were taken with the active one."""
        active = self._instrument.calibration if self._calibrated.value else None
        return None if active is None else active.calibration

    def _known_scale(self) -> tuple[float, float] | None:
        """The scale of the frames' calibration, else the typed one."""
        calibration = self._calibration()
        own = None if calibration is None else calibration.scale
        return self.scale() if own is None else own.mm_per_pixel

    def _fields(self) -> dict[str, ui.input]:
        forces = {f"force of {row.name}": row.force for row in self.rows}
        return {"mm_per_pixel": self.scale_field, "target": self.number_field, **forces}

    async def measure(self) -> None:
        """Measure the contact in each frame, and show the features, a row a frame, and their limits."""
        with widgets.loading(self._measure):
            findings = await widgets.submit(
                self._viewer,
                self._fields(),
                lambda: measure_images(
                    [row.frame() for row in self.rows],
                    mm_per_pixel=self._known_scale(),
                    invert=bool(self._invert.value),
                ),
            )
        if findings is None:
            return
        self._results.clear()
        with self._results, ui.element("div").classes("panel stack"):
            widgets.table(findings_table(findings[0]))
            for finding in findings[0]:
                widgets.message_list(finding_notes(finding))
            for message in findings[1]:
                ui.label(message).classes("flag")

    async def save(self) -> None:
        """Save the frames as presses of a target, and link to it: its page estimates and reports."""

        def saved() -> tuple[int, int]:
            calibration = self._calibration()
            own_scale = calibration is not None and calibration.scale is not None
            options = ImportOptions(mm_per_pixel=None if own_scale else self.scale(), calibration=calibration)
            typed = self.number_field.value
            number = widgets.typed_integer("target", typed, 1, LARGEST_TARGET) if typed else None
            images = [row.frame() for row in self.rows]
            return save_images(self._instrument.store, images, number=number, options=options)

        with widgets.loading(self._save):
            result = await widgets.submit(self._viewer, self._fields(), saved)
        if result is not None:
            number, added = result
            with self._results, ui.element("div").classes("panel row"):
                ui.label(f"Saved {widgets.count_text(added, 'press')} of target {number}.").classes("good")
                ui.link(f"Open target {number}: estimate and report", f"/records/{number}").classes("link")


def findings_table(findings: Sequence[ImageFinding]) -> Table:
    """What was measured, a row a frame."""
    rows = {finding.image.name: dict(finding_rows(finding)) for finding in findings}
    names = tuple(dict.fromkeys(name for row in rows.values() for name in row))
    values = tuple((file, *(row.get(name, "") for name in names)) for file, row in rows.items())
    return Table(title="Contact in each frame", columns=("file", *names), values=values)


class FrameRow:
    """One opened frame: its picture, what was pressed, and the force; shown by ``view``, removed by ``remove``."""

    def __init__(
        self, opened: OpenedFrame, remove: Callable[[FrameRow], None], view: Callable[[FrameRow], object]
    ) -> None:
        self._opened, self.path, self.name = opened, opened.image.path, opened.image.name
        image = opened.image
        with ui.element("tr") as self.element:
            with ui.element("td"):
                picture = ui.element("img").classes("thumbnail")
                widgets.show_drawing(picture, opened.picture, f"Frame {image.name}")
            widgets.cell(image.name)
            widgets.cell(f"{image.columns} x {image.rows}")
            with ui.element("td"):
                self.role = ui.select({role: ROLE_NAMES[role] for role in IMAGE_ROLES}, value=opened.role)
                self.role.props("dense outlined").props["aria-label"] = f"Pressed on, {image.name}"
                self.role.on_value_change(lambda event: setattr(opened, "role", event.value))
                widgets.explain(self.role, "Pressed on")
            with ui.element("td"):
                self.force = widgets.unit_field("", opened.force, unit="N")
                self.force.props["aria-label"] = f"Force in newtons, {image.name}"
                self.force.on_value_change(lambda event: setattr(opened, "force", event.value or ""))
                widgets.explain(self.force, "Force in newtons")
            with ui.element("td"):
                button = ui.button(icon="visibility", on_click=lambda: view(self)).props("flat dense round")
                button.props["aria-label"] = f"View {image.name}"
                button = ui.button(icon="close", on_click=lambda: remove(self)).props("flat dense round")
                button.props["aria-label"] = f"Remove {image.name}"

    def frame(self) -> OwnImage:
        """The frame as its fields say; `InputError` when the force is no number."""
        force, called = self._opened.force, f"force of {self.name}"
        typed = (
            require_number(called, widgets.typed_number(called, force), 0.0, 100.0, hint="newtons") if force else None
        )
        return replace(self._opened.image, role=self._opened.role, force_n=typed)

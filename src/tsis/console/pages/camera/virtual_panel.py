"""The virtual probe: which probe, what it presses, and the seed of its errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.bench import CameraChoice
from tsis.console.pages.camera.choosing import choose_and_start
from tsis.console.pages.field_words import field_words
from tsis.console.pages.headings import panel_title
from tsis.console.pages.loading import loading
from tsis.console.pages.number_field import shown_number, typed_number, unit_field
from tsis.model import list_phantoms, list_probes, list_spheres
from tsis.model.check import LARGEST_SEED, require_integer

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer

CHANGED = {"diameter_mm": ("Diameter", "mm"), "depth_mm": ("Depth", "mm"), "young_kpa": ("Modulus", "kPa")}


class VirtualPanel:
    """Choose what the virtual probe is and presses; it is used once the button says so.

    Parameters
    ----------
    bench, viewer, operated
        As of `ChosenPanel`.
    """

    def __init__(self, bench: Bench, viewer: Viewer, operated: Operated) -> None:
        self._bench, self._viewer = bench, viewer
        choice = bench.desk.choice
        with ui.element("section").classes("panel stack tight"):
            panel_title("Virtual probe")
            ui.label("No hardware: mechanics, light and camera are calculated.").classes("muted")
            with ui.element("div").classes("row"):
                self._probe = ui.select(list(list_probes()), value=choice.probe, label="Probe")
                self._phantom = ui.select(things(), value=choice.phantom, label="Pressed object")
                self._phantom.on_value_change(self._bare)
                self._seed = unit_field("Seed", str(choice.seed), keys="numeric").classes("seed")
            self._changes = ui.element("div").classes("row")
            with self._changes:
                ui.label("Inclusion other than the catalog's:").classes("muted whole-line")
                self._values = {
                    name: unit_field(label, shown_number(getattr(choice, name)), unit=unit).classes("number-field")
                    for name, (label, unit) in CHANGED.items()
                }
            for select in (self._probe, self._phantom):
                operated.add(select).props("dense outlined")
            for field in (self._seed, *self._values.values()):
                operated.add(field)
            self._use = ui.button("Use the virtual probe", on_click=self._chosen).props("no-caps unelevated")
            operated.add(self._use)
        self._bare()

    def show(self, state: BenchState) -> None:
        """Say whether it is the one in use."""
        self._use.text = "Use it so" if state.camera.choice.is_virtual else "Use the virtual probe"

    def _bare(self) -> None:
        """Spheres have no inclusion."""
        self._changes.set_visibility(self._phantom.value not in list_spheres())

    async def _chosen(self) -> None:
        with loading(self._use):
            await self._viewer.attempt(self._taken)

    def _taken(self) -> None:
        changed = dict.fromkeys(CHANGED) if self._phantom.value in list_spheres() else self._changed()
        with field_words({name: label.lower() for name, (label, _) in CHANGED.items()}):
            choice = CameraChoice(
                probe=self._probe.value,
                phantom=self._phantom.value,
                seed=require_integer("seed", typed_number("seed", str(self._seed.value or "")), 0, LARGEST_SEED),
                diameter_mm=changed["diameter_mm"],
                depth_mm=changed["depth_mm"],
                young_kpa=changed["young_kpa"],
            )
        choose_and_start(self._bench, choice, by=self._viewer.identity)

    def _changed(self) -> dict[str, float | None]:
        return {name: _optional(name, field) for name, field in self._values.items()}


def things() -> dict[str, str]:
    """What the virtual probe can press, in words."""
    return {name: name for name in list_phantoms()} | {
        name: f"{name} (sphere, for hardness)" for name in list_spheres()
    }


def _optional(name: str, field: ui.input) -> float | None:
    text = str(field.value or "").strip()
    return typed_number(CHANGED[name][0].lower(), text) if text else None

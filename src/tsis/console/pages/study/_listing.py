"""The list of studies, the form of a new one, and the table of a study's targets."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from nicegui import ui

from tsis.__about__ import LARGEST_SEED
from tsis.catalog import list_probes
from tsis.console.pages.components import (
    cell,
    field_messages,
    loading,
    panel_title,
    rows_under,
    typed_forces,
    typed_integer,
    typed_number,
    unit_field,
)
from tsis.console.pages.study._context import name_in, who_field
from tsis.console.studies import StudyRepository
from tsis.errors import InputError
from tsis.study import TARGETS, printed_targets, random_targets

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tsis.console.pages.components import Viewer
    from tsis.console.pages.study._context import StudyResult, StudyView
    from tsis.console.services import Instrument
    from tsis.console.studies import StudySummary
    from tsis.study import Study, TargetTruth


SHEETS = (20, 50, 200)


class CodeTable:
    """The table of targets."""

    def __init__(self) -> None:
        panel_title("Targets")
        self._table = ui.table(rows=[], columns=[], row_key="number", pagination=SHEETS[0]).classes("targets")
        self._table.props(
            f'flat dense wrap-cells :rows-per-page-options="{list(SHEETS)}" rows-per-page-label="Targets on a sheet"'
        )

    def show(self, view: StudyView, result: StudyResult | None) -> None:
        """Show codes with their readings, or with the truth of an unblinded study."""
        if result is None:
            headings, rows = _progress(view.study)
        else:
            headings, rows = result.targets.headings, list(result.targets.rows)
        self._table.columns = [
            {"name": f"c{at}", "label": text, "field": f"c{at}", "align": "left"}
            for at, text in enumerate(("order", *headings))
        ]
        self._table.rows = [
            {"number": number, **{f"c{at}": text for at, text in enumerate((str(number), *row))}}
            for number, row in enumerate(rows, start=1)
        ]
        self._table.update()


def _progress(study: Study) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Codes, and for each device whether it has read them; the virtual probe's first."""
    devices = tuple(dict.fromkeys((study.plan.device, *study.devices)))
    most: dict[tuple[str, str], dict[str, int]] = defaultdict(lambda: defaultdict(int))
    for reading in study.readings:
        most[reading.code, reading.device][reading.operator] += 1
    rows = [
        (code, *(_state(max(most[code, device].values(), default=0), study.plan.repeats) for device in devices))
        for code in study.plan.codes
    ]
    return ("code", *devices), rows


def _state(read: int, repeats: int) -> str:
    if read >= repeats:
        return "read"
    return f"read {read} of {repeats}" if read else "left"


LIKE = {"printed": "like the printed study", "random": "drawn by chance"}
LABELS = {"present": "targets with an inclusion", "blank": "blanks", "forces_n": "forces"}
MOST_FORCES = 16
MOST_REPEATS = 1000


@dataclass(slots=True)
class StudyDraft:
    """Contents of the fields of a new study."""

    name: str = ""
    like: str = "printed"
    present: str = "8"
    blank: str = "8"
    forces: str = ""
    probe: str = "tsis-domed"
    with_reference: bool = True
    repeats: str = "1"
    threshold: str = "0.5"
    seed: str = ""

    def make(self, repository: StudyRepository, *, actor: str) -> str:
        """Create the study, and return its name; `InputError` for an invalid field."""
        name = self.name.strip()
        with field_messages(LABELS):
            repository.make(
                name,
                self._targets(),
                seed=typed_integer("seed", self.seed, 0, LARGEST_SEED) if self.seed.strip() else None,
                probe=self.probe,
                forces_n=typed_forces(self.forces, most=MOST_FORCES) or None,
                with_reference=self.with_reference,
                repeats=typed_integer("repeats", self.repeats, 1, MOST_REPEATS),
                threshold=typed_number("threshold", self.threshold),
                actor=actor,
            )
        return name

    def _targets(self) -> Sequence[TargetTruth] | Callable[[int], Sequence[TargetTruth]]:
        present, blank = (typed_whole(LABELS[name], getattr(self, name)) for name in ("present", "blank"))
        if self.like == "random":
            return lambda seed: random_targets(present, blank, rng=np.random.default_rng([seed, TARGETS]))
        return printed_targets(present, blank)


def typed_whole(name: str, text: str) -> int:
    """The typed whole number; `InputError` for other text."""
    value = typed_number(name, text)
    if not value.is_integer():
        raise InputError(f"{name} must be a whole number; got {text.strip()!r:.40}")
    return int(value)


EVERY_S = 1.0
HEADINGS = ("Study", "Targets", "Readings", "State")
NONE_YET = (
    "There is no study yet. Make one here: its targets get codes, in an order by chance, and what they are is sealed."
)
MEANT = (
    "Codes and order follow from the seed. Whoever knows it can read the truth; left empty it is drawn, and sealed "
    "with the truth. Targets, probe, forces and threshold are fixed once the study is made."
)


def study_listing(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page."""
    repository = StudyRepository(instrument.terms.workspace)
    with ui.element("div").classes("split"):
        with ui.element("section").classes("panel stack"):
            panel_title("Studies")
            studies = ui.element("div").classes("scroll")
        with ui.element("section").classes("panel stack"):
            _NewStudy(repository, viewer)
    shown: object = None

    async def refresh() -> None:
        nonlocal shown
        stamps = await viewer.attempt(repository.stamps)
        if stamps is None or stamps == shown:
            return
        shown = stamps
        summaries = await viewer.attempt(repository.summaries)
        if summaries is not None:
            studies.clear()
            with studies:
                _show(summaries)

    viewer.every(EVERY_S, refresh)


def _show(summaries: tuple[StudySummary, ...]) -> None:
    if not summaries:
        ui.label(NONE_YET).classes("muted")
        return
    with rows_under(HEADINGS, label="Studies"):
        for item in summaries:
            if item.trouble:
                with ui.element("tr"):
                    cell(item.name)
                    with ui.element("td").props("colspan=3"):
                        ui.label(item.trouble).classes("flag wordy")
                continue
            with ui.element("tr"):
                with ui.element("td"):
                    ui.link(item.name, f"/study/{item.name}").classes("link")
                cell(str(item.targets))
                cell(str(item.readings))
                cell(f"unblinded {item.unblinded}" if item.unblinded else "blinded").classes("wordy")


class _NewStudy:
    """The form of a new study."""

    def __init__(self, repository: StudyRepository, viewer: Viewer) -> None:
        self._repository, self._viewer = repository, viewer
        start = StudyDraft()
        panel_title("New study")
        with ui.element("div").classes("study-fields"):
            name = unit_field("Name", keys="text").props("maxlength=200")
            self._who = who_field(viewer, "Made by")
            present = unit_field("With an inclusion", start.present, keys="numeric")
            blank = unit_field("Blanks", start.blank, keys="numeric")
            self._like = ui.select(LIKE, value=start.like, label="Targets")
            self._like.props("dense outlined options-dense").classes("study-wide")
            self._probe = ui.select(list(list_probes()), value=start.probe, label="Probe")
            self._probe.props("dense outlined options-dense")
            forces = unit_field("Forces", start.forces, unit="N", keys="text")
            forces.props("stack-label").props["placeholder"] = "usual of the probe"
            repeats = unit_field("Repeats", start.repeats, keys="numeric")
            threshold = unit_field("Threshold", start.threshold)
            seed = unit_field("Seed", start.seed, keys="numeric")
            seed.props("stack-label").props["placeholder"] = "drawn and sealed"
        self._texts = {
            "name": name,
            "present": present,
            "blank": blank,
            "forces": forces,
            "repeats": repeats,
            "threshold": threshold,
            "seed": seed,
        }
        self._reference = ui.checkbox("Reference presses on tissue nearby", value=start.with_reference)
        ui.label(MEANT).classes("muted")
        with ui.element("div").classes("row"):
            self._button = ui.button("Make the study", icon="add", on_click=self._make).props("no-caps")

    async def _make(self) -> None:
        draft = StudyDraft(
            like=str(self._like.value),
            probe=str(self._probe.value),
            with_reference=bool(self._reference.value),
            **{name: field.value or "" for name, field in self._texts.items()},
        )
        with loading(self._button):
            created = await self._viewer.attempt(draft.make, self._repository, actor=name_in(self._viewer, self._who))
        if created is not None:
            ui.navigate.to(f"/study/{created}")

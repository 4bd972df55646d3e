"""The list of studies, the form of a new one, and the table of a study's targets."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from nicegui import ui

from tsis.__about__ import LARGEST_SEED
from tsis.catalog.probes import list_probes
from tsis.console.pages import components as kit
from tsis.console.pages.study._context import name_in, who_field
from tsis.console.studies import StudyRepository
from tsis.errors import InputError
from tsis.model.require import require_number
from tsis.study.folder import MOST_TARGETS, printed_targets, random_targets
from tsis.study.plan import TARGETS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from nicegui.events import GenericEventArguments

    from tsis.console.pages.study._context import StudyResult, StudyView
    from tsis.console.services import Instrument
    from tsis.console.studies import StudySummary
    from tsis.study.plan import TargetTruth


SHEETS = (20, 50, 200)


class CodeTable:
    """The table of targets; a browser gets one sheet of it, so that a large study costs no more than a small one."""

    def __init__(self) -> None:
        self._view: StudyView | None = None
        self._result: StudyResult | None = None
        self._sheet, self._size, self._total = 1, SHEETS[0], 0
        kit.panel_title("Targets")
        with ui.element("div").classes("study-codes").props('tabindex=0 role=region aria-label="Targets"'):
            self._table = ui.table(rows=[], columns=[], row_key="number", pagination=self._pages())
        self._table.on("request", self._requested)
        kit.sheets_of_targets(self._table, SHEETS, self._pages)

    def show(self, view: StudyView, result: StudyResult | None) -> None:
        """Show codes with their readings, or with the truth of an unblinded study."""
        self._view, self._result = view, result
        self._draw()

    def _requested(self, event: GenericEventArguments) -> None:
        sent = event.args.get("pagination") if isinstance(event.args, dict) else None
        if isinstance(sent, dict):
            page, size = sent.get("page"), sent.get("rowsPerPage")
            self._sheet = page if isinstance(page, int) and page > 0 else 1
            self._size = next((sheet for sheet in SHEETS if sheet == size), SHEETS[0])
        self._draw()

    def _draw(self) -> None:
        if self._view is None:
            return
        self._total = len(self._view.study.plan.codes)
        self._sheet = min(self._sheet, max(1, -(-self._total // self._size)))
        begin = (self._sheet - 1) * self._size
        part = slice(begin, begin + self._size)
        if self._result is None:
            headings, rows = _progress(self._view, part)
        else:
            headings, rows = self._result.targets.headings, list(self._result.targets.rows[part])
        self._table.columns = [
            {"name": f"c{at}", "label": text, "field": f"c{at}", "align": "left"}
            for at, text in enumerate(("order", *headings))
        ]
        self._table.rows = [
            {"number": number, **{f"c{at}": text for at, text in enumerate((str(number), *row))}}
            for number, row in enumerate(rows, start=begin + 1)
        ]
        self._table.pagination = self._pages()
        self._table.update()

    def _pages(self) -> dict[str, int]:
        return {"page": self._sheet, "rowsPerPage": self._size, "rowsNumber": self._total}


def _progress(view: StudyView, part: slice) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Codes of a sheet, and for each device whether it has read them; the virtual probe's first."""
    plan, devices = view.study.plan, tuple(dict.fromkeys((view.study.plan.device, *view.study.devices)))
    rows = [
        (code, *(_state(view.most_read.get((code, device), 0), plan.repeats) for device in devices))
        for code in plan.codes[part]
    ]
    return ("code", *devices), rows


def _state(read: int, repeats: int) -> str:
    if read >= repeats:
        return "read"
    return f"read {read} of {repeats}" if read else "left"


USUAL_FORCES = (0.5, 1.0)  # at most; a flat probe has one
KINDS = ("present", "blank")
LARGE = 1000  # readings, beyond which the size is confirmed first
SECONDS_PER_READING = 0.55  # of one core, with four presses; measured on the domed probe


@dataclass(frozen=True, slots=True, kw_only=True)
class StudySize:
    """What one operator has to read.

    Examples
    --------
    >>> StudySize(readings=100_000, presses=400_000).text()
    'It has 100,000 readings, 400,000 presses: about 15 hours of computing on the virtual probe.'
    """

    readings: int
    presses: int

    def text(self) -> str:
        """Its size and what it costs."""
        seconds = SECONDS_PER_READING * self.presses / 4
        unit, length = next(item for item in DURATIONS if seconds >= 2 * item[1] or item[1] == 1.0)
        return (
            f"It has {self.readings:,} readings, {self.presses:,} presses: about {seconds / length:.0f} {unit} of "
            "computing on the virtual probe."
        )


DURATIONS = (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0), ("s", 1.0))
LIKE = {"printed": "like the printed study", "random": "random"}
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

    def make(self, repository: StudyRepository, *, actor: str, progress: Callable[[int, int], None]) -> str:
        """Create the study, and return its name; `InputError` for an invalid field."""
        name = self.name.strip()
        with kit.field_messages(LABELS):
            repository.make(
                name,
                self._targets(),
                seed=kit.typed_integer("seed", self.seed, 0, LARGEST_SEED) if self.seed.strip() else None,
                probe=self.probe,
                forces_n=kit.typed_forces(self.forces, most=MOST_FORCES) or None,
                with_reference=self.with_reference,
                repeats=kit.typed_integer("repeats", self.repeats, 1, MOST_REPEATS),
                threshold=self._threshold(),
                actor=actor,
                progress=progress,
            )
        return name

    def _threshold(self) -> float:
        return require_number("threshold", kit.typed_number("threshold", self.threshold), 0.0, 1.0)

    def size(self) -> StudySize:
        """Readings and presses of the virtual probe; `InputError` for an invalid field."""
        with kit.field_messages(LABELS):
            present, blank = self._counts()
            repeats = kit.typed_integer("repeats", self.repeats, 1, MOST_REPEATS)
            forces = kit.typed_forces(self.forces, most=MOST_FORCES) or USUAL_FORCES
            readings = (present + blank) * repeats
            return StudySize(readings=readings, presses=readings * len(forces) * (1 + self.with_reference))

    def _counts(self) -> tuple[int, int]:
        """Targets with and without an inclusion."""
        present, blank = (kit.typed_integer(LABELS[name], getattr(self, name), 0, MOST_TARGETS) for name in KINDS)
        return present, blank

    def _targets(self) -> Sequence[TargetTruth] | Callable[[int], Sequence[TargetTruth]]:
        present, blank = self._counts()
        if self.like == "random":
            return lambda seed: random_targets(present, blank, rng=np.random.default_rng([seed, TARGETS]))
        return printed_targets(present, blank)


EVERY_S, PROGRESS_EVERY_S = 1.0, 0.5
HEADINGS = ("Study", "Targets", "Readings", "State")
NONE_YET = "No study yet. Create one here: its targets get codes in random order, and the truth is sealed."
MEANT = (
    "The seed determines the codes and their order; whoever knows it can compute the truth. Leave it empty for a "
    "random seed, which is sealed with the truth. Targets, probe, forces and threshold are fixed once the study is "
    "created."
)


def study_listing(instrument: Instrument, viewer: kit.Viewer) -> None:
    """Build the page."""
    repository = StudyRepository(instrument.terms.workspace)
    with ui.element("div").classes("split"):
        with kit.panel("Studies"):
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
        kit.muted(NONE_YET)
        return
    with kit.rows_under(HEADINGS, label="Studies"):
        for item in summaries:
            if item.trouble:
                with ui.element("tr"):
                    kit.cell(item.name)
                    with ui.element("td").props("colspan=3"):
                        ui.label(item.trouble).classes("flag wordy")
                continue
            with ui.element("tr"):
                with ui.element("td"):
                    ui.link(item.name, f"/study/{item.name}").classes("link")
                kit.cell(str(item.targets))
                kit.cell(str(item.readings))
                kit.cell(f"unblinded {item.unblinded}" if item.unblinded else "blinded").classes("wordy")


class _NewStudy:
    """The form of a new study."""

    def __init__(self, repository: StudyRepository, viewer: kit.Viewer) -> None:
        self._repository, self._viewer = repository, viewer
        start = StudyDraft()
        kit.panel_title("New study")
        with ui.element("div").classes("study-fields"):
            name = kit.unit_field("Name", keys="text").props("maxlength=200")
            self._who = who_field(viewer, "Made by")
            present = kit.unit_field("With an inclusion", start.present, keys="numeric")
            blank = kit.unit_field("Blanks", start.blank, keys="numeric")
            self._like = kit.select_field(LIKE, value=start.like, label="Targets")
            self._like.props("dense outlined options-dense").classes("study-wide")
            self._probe = kit.select_field(list(list_probes()), value=start.probe, label="Probe")
            self._probe.props("dense outlined options-dense")
            forces = kit.unit_field("Forces", start.forces, unit="N", keys="text")
            forces.props("stack-label").props["placeholder"] = "usual of the probe"
            repeats = kit.unit_field("Repeats", start.repeats, keys="numeric")
            threshold = kit.unit_field("Threshold", start.threshold)
            seed = kit.unit_field("Seed", start.seed, keys="numeric")
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
        named = {
            "targets with an inclusion": present,
            "blanks": blank,
            "force": forces,
            "operator": self._who,
            "actor": self._who,
        }
        self._fields = {**named, **self._texts}
        for field in (present, blank, forces, repeats):
            field.on_value_change(self._count)
        threshold.props["hint"] = "probability, 0 to 1"
        self._reference = ui.checkbox("Reference presses on tissue nearby", value=start.with_reference)
        self._reference.on_value_change(self._count)
        kit.muted(MEANT)
        self._size = kit.muted()
        with ui.element("div").classes("row"):
            self._button = kit.button("Create the study", self._make, icon="add", look="unelevated")
            self._bar = ui.linear_progress(0.0, show_value=False, size="6px").props(
                'aria-label="Progress of the study"'
            )
        self._sealed = 0.0  # fraction of the targets
        self._dialogs = ui.element("div")
        self._count()
        viewer.every(PROGRESS_EVERY_S, self._show_progress)

    def _draft(self) -> StudyDraft:
        return StudyDraft(
            like=str(self._like.value),
            probe=str(self._probe.value),
            with_reference=bool(self._reference.value),
            **{name: field.value or "" for name, field in self._texts.items()},
        )

    def _count(self) -> None:
        """Show what the study costs, while its numbers are typed."""
        try:
            self._size.text = self._draft().size().text()
        except InputError as error:
            self._size.text = kit.plain_message(error)

    async def _make(self) -> None:
        draft = self._draft()
        size = await kit.submit(self._viewer, self._fields, draft.size)
        if size is None:
            return
        if size.readings <= LARGE:
            await self._made(draft)
            return
        with kit.open_dialog(self._dialogs, "A large study") as dialog:
            ui.label(f"{size.text()} The targets are fixed once the study is created.")

            async def confirmed() -> None:
                dialog.close()
                await self._made(draft)

            kit.dialog_buttons(dialog, f"Make {size.readings:,} readings", confirmed)

    async def _made(self, draft: StudyDraft) -> None:
        def sealed(done: int, total: int) -> None:
            self._sealed = done / total

        with kit.loading(self._button):
            who = name_in(self._viewer, self._who)
            make = partial(draft.make, self._repository, actor=who, progress=sealed)
            created = await kit.submit(self._viewer, self._fields, make)
        self._sealed = 0.0
        if created is not None:
            ui.navigate.to(f"/study/{created}")

    async def _show_progress(self) -> None:
        self._bar.set_visibility(self._sealed > 0.0)
        self._bar.value = self._sealed

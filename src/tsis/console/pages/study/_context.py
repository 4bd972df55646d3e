"""Contents of a study's page, read at once, without the truth of a blind study."""

from __future__ import annotations

from collections import Counter, OrderedDict
from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING, Protocol

from tsis.console.pages.components import unit_field
from tsis.console.studies import has_report
from tsis.report import address
from tsis.report.study import study_page, targets_table
from tsis.study.analysis import analyse

if TYPE_CHECKING:
    from pathlib import Path

    from nicegui import ui

    from tsis.console.pages.components import Viewer
    from tsis.console.services import Jobs
    from tsis.console.studies import StudyRepository
    from tsis.report import Page, Table
    from tsis.study import Study


KEPT = 4  # studies whose numbers are kept
_kept: OrderedDict[tuple[Path, str], StudyResult] = OrderedDict()
_one = Lock()


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceProgress:
    """Progress of a device: an operator's readings, and all expected ones."""

    device: str
    operator: str
    read: int
    expected: int
    undecided: int
    threshold: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyResult:
    """Results of an unblinded study: report, drawn curves, every target with its truth."""

    page: Page
    curves: str
    targets: Table


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyView:
    """A study at one moment."""

    study: Study
    devices: tuple[DeviceProgress, ...]
    reported: bool


def view_study(shelf: StudyRepository, name: str) -> StudyView:
    """Read a study; errors as `StudyRepository.study`."""
    study = shelf.study(name)
    counter = Counter((reading.device, reading.operator) for reading in study.readings)
    undecided = Counter((reading.device, reading.operator) for reading in study.readings if reading.undecided)
    requested = len(study.plan.codes) * study.plan.repeats
    devices = [
        DeviceProgress(
            device=device,
            operator=operator,
            read=count,
            expected=requested,
            undecided=undecided[device, operator],
            threshold=study.threshold_of(device),
        )
        for (device, operator), count in counter.items()
    ]
    return StudyView(study=study, devices=tuple(devices), reported=has_report(study))


def study_result(study: Study) -> StudyResult:
    """Results of an unblinded study, cached until the log grows."""
    key = (study.folder.resolve(), study.chain.head)
    with _one:
        if key not in _kept:
            _kept[key] = _told(study)
            while len(_kept) > KEPT:
                _kept.popitem(last=False)
        return _kept[key]


def _told(study: Study) -> StudyResult:
    analysis = analyse(study)
    page = study_page(analysis)
    drawn = any(device.curve is not None for device in analysis.devices)
    return StudyResult(page=page, curves=address(page.pictures[0]) if drawn else "", targets=targets_table(analysis))


class StudyContext(Protocol):
    """The open page of a study, as its parts use it."""

    jobs: Jobs
    viewer: Viewer
    repository: StudyRepository
    name: str


def who_field(viewer: Viewer, label: str, before: str = "") -> ui.input:
    """Place a field for a person's name: the login's, else ``before``, who did it last, or the browser's."""
    field = unit_field(label, viewer.name if viewer.logged_in else before or viewer.name, keys="text")
    return field.props("readonly") if viewer.logged_in else field


def name_in(viewer: Viewer, field: ui.input) -> str:
    """The name to enter; a browser may send what it likes, so a login's is taken from the login."""
    return viewer.name if viewer.logged_in else (field.value or "").strip()

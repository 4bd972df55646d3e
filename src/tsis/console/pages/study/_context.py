"""Contents of a study's page, read at once, without the truth of a blind study."""

from __future__ import annotations

from collections import Counter, OrderedDict
from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING, Protocol

from tsis.console.pages import components as kit
from tsis.console.studies import has_report
from tsis.present.page import address
from tsis.present.study import study_page, targets_table
from tsis.study.analysis import analyse

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from nicegui import ui

    from tsis.console.services import Jobs
    from tsis.console.studies import StudyRepository
    from tsis.present.page import Page, Table
    from tsis.study.folder import Study


MOST_RESULTS = 4
_results: OrderedDict[tuple[Path, str], StudyResult] = OrderedDict()
_lock = Lock()


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
    most_read: Mapping[tuple[str, str], int]  # most readings of a (code, device) by one operator


def view_study(repository: StudyRepository, name: str) -> StudyView:
    """Read a study; errors as `StudyRepository.study`."""
    study = repository.study(name)
    counter = Counter((reading.device, reading.operator) for reading in study.readings)
    undecided = Counter((reading.device, reading.operator) for reading in study.readings if reading.undecided)
    devices = [
        DeviceProgress(
            device=device,
            operator=operator,
            read=count,
            expected=len(study.plan.codes) * study.plan.repeats,
            undecided=undecided[device, operator],
            threshold=study.threshold_of(device),
        )
        for (device, operator), count in counter.items()
    ]
    most: Counter[tuple[str, str]] = Counter()
    for (code, device, _), count in Counter(
        (reading.code, reading.device, reading.operator) for reading in study.readings
    ).items():
        most[code, device] = max(most[code, device], count)
    return StudyView(study=study, devices=tuple(devices), reported=has_report(study), most_read=most)


def study_result(study: Study) -> StudyResult:
    """Results of an unblinded study, cached until the log grows."""
    key = (study.folder.resolve(), study.chain.head)
    with _lock:
        if key not in _results:
            analysis = analyse(study)
            page, drawn = study_page(analysis), any(device.curve is not None for device in analysis.devices)
            curves = address(page.pictures[0]) if drawn else ""
            _results[key] = StudyResult(page=page, curves=curves, targets=targets_table(analysis))
            if len(_results) > MOST_RESULTS:
                _results.popitem(last=False)
        return _results[key]


class StudyContext(Protocol):
    """The open page of a study, as its parts use it."""

    jobs: Jobs
    viewer: kit.Viewer
    repository: StudyRepository
    name: str


def who_field(viewer: kit.Viewer, label: str) -> ui.input:
    """Place a field for a person's name: the operator's, where it is known."""
    field = kit.unit_field(label, keys="text").bind_value_from(viewer, "operator")
    field.props["readonly"], field.props["maxlength"] = viewer.logged_in, kit.LONGEST_OPERATOR
    return field


def name_in(viewer: kit.Viewer, field: ui.input) -> str:
    """The name to enter; a browser may send what it likes, so a login's is taken from the login.

    A typed name is kept as the operator's.
    """
    name = viewer.operator if viewer.logged_in else (field.value or "").strip()
    if name:
        viewer.remember_operator(name)
    return name

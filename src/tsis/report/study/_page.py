"""The report of a blinded study: a page, a JSON document, and the readings as a table."""

from __future__ import annotations

import hashlib
import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tsis.files import json_bytes, table_bytes
from tsis.report._folder import free_folder, require_room, write_folder
from tsis.report._page import Card, Page, Table, html
from tsis.report.study._document import study_document
from tsis.report.study._pictures import study_pictures
from tsis.report.study._tables import comparison_table, device_tables, targets_table
from tsis.report.study._text import ends, few_notes, interval_text, method_of, record_notes, small, undecided_notes
from tsis.study import ANALYSED, ANALYSED_READING, QUANTITIES, enter_analysis, unblind
from tsis.study.analysis import analyse

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tsis.study import Study
    from tsis.study.analysis import DeviceAnalysis, StudyAnalysis


ANALYSIS, READINGS, PAGE, PAPER = "analysis.json", "readings.csv", "report.html", "report.pdf"
NOT_REPORTED = (
    (
        "The virtual probe",
        "Its presses, its light and its camera follow the same laws as the estimator, on a finer mesh and with errors "
        "of the sizes that the calibration states. What real gel, skin, hands and cameras add is not in these numbers.",
    ),
    (
        "The prior",
        "Before it saw a frame the estimator believed the ranges of size, depth and modulus that the provenance tells, "
        "and an inclusion in one target of two. Where inclusions are rarer, the same press gives a lower probability.",
    ),
    (
        "These targets",
        "Rates hold for targets like these, found where the probe was put. Nobody searched for them.",
    ),
    (
        "Chosen thresholds",
        "A threshold that was chosen on these targets looks better here than it will on others.",
    ),
    ("Blindness", "The seal keeps people from reading the truth by accident. It does not keep out who opens its file."),
)


def study_page(analysis: StudyAnalysis) -> Page:
    """The page of the results with intervals and limitations."""
    plan, devices = analysis.study.plan, analysis.devices
    present = sum(truth.has_inclusion for truth in analysis.truths.values())
    forces = " and ".join(f"{force:g}" for force in plan.forces_n)
    pressed = f"{plan.probe}, {forces} N, " + ("each with a press on plain tissue" if plan.with_reference else "alone")
    return Page(
        title=f"Study {plan.name}",
        subtitle=f"{present} targets with an inclusion and {len(plan.codes) - present} without, read blind, in "
        f"an order by chance; {', '.join(device.results.device for device in devices)}",
        cards=(
            _record_card(analysis),
            *(card for device in devices for card in _cards(device, several=len(devices) > 1)),
        ),
        notes=(
            *record_notes(analysis),
            *(note for device in devices for note in (*few_notes(device), *undecided_notes(device))),
            f"What counts is {ANALYSED_READING}; repeats serve to tell how well readings agree. Intervals "
            f"hold 95 %, unless "
            "said otherwise, for each number by itself.",
        ),
        pictures=tuple(study_pictures(analysis)),
        tables=(
            *(table for device in devices for table in device_tables(device)),
            *(comparison_table(comparison) for comparison in analysis.comparisons),
            targets_table(analysis),
            Table(title="What this study does not tell", headings=("of", "why"), rows=NOT_REPORTED),
        ),
        provenance=_provenance(analysis, pressed),
    )


def study_files(analysis: StudyAnalysis) -> dict[str, bytes]:
    """The files of the report by name: HTML, PDF, JSON, and a table of all readings."""
    from tsis.report.paper import pdf

    page = study_page(analysis)
    return {
        PAGE: html(page),
        PAPER: pdf(page),
        ANALYSIS: json_bytes(study_document(analysis)),
        READINGS: table_bytes(_reading_rows(analysis)),
    }


def _record_card(analysis: StudyAnalysis) -> Card:
    result = analysis.verification
    if result.sound:
        return Card(title="The record", value="as written", detail=f"head {result.head[:16]}, {result.lines} lines")
    count = len(result.faults)
    return Card(
        title="The record",
        value="CHANGED",
        detail=f"{count} {'place differs' if count == 1 else 'places differ'} from what was written; see below",
        doubtful=True,
    )


def _cards(device_analysis: DeviceAnalysis, *, several: bool) -> tuple[Card, ...]:
    of = f", {device_analysis.results.device}" if several else ""
    counts, few, cards = device_analysis.counts, device_analysis.few, []
    rates = {}
    if counts is not None and counts.present:
        rates["Sensitivity"] = counts.sensitivity
    if counts is not None and counts.absent:
        rates["Specificity"] = counts.specificity
    for name, rate in rates.items():
        reported = f"{rate.successes} of {rate.trials}; {interval_text(rate)}, Wilson"
        cards.append(Card(title=f"{name}{of}", value=f"{100 * rate.value:.3g} %", detail=reported, doubtful=few))
    if device_analysis.curve is not None:
        reported = f"{ends(device_analysis.auc_interval)}, {method_of(device_analysis.auc_interval)}"
        area = f"{device_analysis.curve.auc:.3f}"
        cards.append(Card(title=f"Area under the curve{of}", value=area, detail=reported, doubtful=few))
    if device_analysis.reliability is not None:
        interval = device_analysis.brier_interval
        reported = "no interval" if interval is None else f"{ends(interval)}, {method_of(interval)}"
        score = small(device_analysis.reliability.brier.score)
        cards.append(Card(title=f"Brier score{of}", value=score, detail=reported))
    return tuple(cards)


def _provenance(analysis: StudyAnalysis, pressed: str) -> dict[str, Any]:
    plan, study = analysis.study.plan, analysis.study
    prior = next((reading.evidence["prior"] for reading in study.readings if "prior" in reading.evidence), None)
    return {
        "study": {"name": plan.name, "made": plan.made.isoformat(), "tsis": plan.tsis},
        "virtual probe": pressed,
        "seed": "in the seal" if plan.seed is None else plan.seed,
        "threshold fixed beforehand": plan.threshold,
        "sealed truth (SHA-256)": plan.commitment,
        **({} if prior is None else {"prior of the virtual probe": prior}),
        "head of the log": analysis.verification.head,
        "unblinded": analysis.verification.unblinded,
    }


def _reading_rows(analysis: StudyAnalysis) -> list[list[Any]]:
    headings = ["code", "label", "present", *(f"true_{name}" for name in QUANTITIES), "device", "operator", "repeat"]
    rows: list[list[Any]] = [
        [*headings, "score", *QUANTITIES, *(f"sd_{name}" for name in QUANTITIES), "flags", "reason"]
    ]
    for reading in analysis.study.readings:
        truth = analysis.truths[reading.code]
        existing = [truth.values.get(name) for name in QUANTITIES]
        messages = [
            reading.score,
            *(reading.values.get(name) for name in QUANTITIES),
            *(reading.sd.get(name) for name in QUANTITIES),
        ]
        by = [reading.device, reading.operator, reading.repeat]
        of = [reading.code, truth.label, truth.has_inclusion]
        rows.append([*of, *existing, *by, *messages, " ".join(reading.flags), reading.reason])
    return rows


FOLDER = "analysis"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PublishedStudy:
    """A written report: the analysis, the study with the entry of this analysis, and the folder of the files."""

    analysis: StudyAnalysis
    study: Study
    folder: Path


def publish_study(
    study: Study, *, by: str, out: Path | None = None, progress: Callable[[int, int], None] | None = None
) -> PublishedStudy:
    """Unblind a study with readings that is still blind, analyse it and write the report.

    The folder, by default ``analysis`` in the study, gets a number where it exists. ``progress`` is called with (done,
    total) devices.

    Raises
    ------
    FileInputError
        When the folder cannot be written.
    RecordsError
        When there is no reading, or the truth cannot be read.
    """
    position = _study_path(study) if out is None else free_folder(out)
    require_room(position)  # before the irreversible unblinding
    for device in study.devices:
        study.threshold_of(device)
    analysis = analyse(unblind(study, by=by), progress=progress)
    files = study_files(analysis)
    folder = write_folder(position, files)
    inside = folder.name if folder.parent == study.folder.resolve() else ""
    entries = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    return PublishedStudy(
        analysis=analysis, study=enter_analysis(analysis.study, by=by, folder=inside, files=entries), folder=folder
    )


def _study_path(study: Study) -> Path:
    """A new folder in the study whose name is not in the log, even of a deleted report."""
    existing = [entry.content.get("folder") for entry in study.chain.entries if entry.action == ANALYSED]
    names = itertools.chain([FOLDER], (f"{FOLDER}-{number}" for number in itertools.count(2)))
    return next(study.folder / name for name in names if name not in existing and not (study.folder / name).exists())

"""The report of a blinded study: its pictures and page, a JSON document, and the readings as a table."""

from __future__ import annotations

import hashlib
import itertools
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.files import json_bytes, table_bytes
from tsis.plots import (
    TRIAL_COLOURS,
    agreement_limits,
    detected_by_size_and_depth,
    read_over_true,
    reliability_diagram,
    roc_curve,
    scores_by_truth,
)
from tsis.report._folder import free_folder, require_room, write_folder
from tsis.report._page import Card, Page, Picture, Table, html, on_axes
from tsis.report.study._document import (
    counted,
    ends,
    few_notes,
    interval_text,
    labelled,
    method_of,
    record_notes,
    small,
    study_document,
    undecided_notes,
)
from tsis.report.study._tables import comparison_table, device_tables, targets_table
from tsis.study.analysis import analyse
from tsis.study.folder import ANALYSED, enter_analysis, unblind
from tsis.study.plan import ANALYSED_READING, QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from matplotlib.figure import Figure

    from tsis.study.analysis import DeviceAnalysis, DeviceComparison, SizeErrors, StudyAnalysis
    from tsis.study.folder import Study


SQUARE = (4.6, 4.2)


def study_pictures(analysis: StudyAnalysis) -> Iterator[Picture]:
    """Curves of all devices, the results of each, then comparisons."""
    if any(device.curve is not None for device in analysis.devices):
        yield _curves(analysis)
    for device in analysis.devices:
        yield from _of_device(device)
    for comparison in analysis.comparisons:
        if comparison.limits:
            yield _limits(comparison)


def _curves(analysis: StudyAnalysis) -> Picture:
    shown = [device for device in analysis.devices if device.curve is not None]
    text = "; ".join(
        f"{item.results.device}: area {item.curve.auc:.3f}, 95 % interval {ends(item.auc_interval)} "
        f"({method_of(item.auc_interval)})"
        for item in shown
        if item.curve is not None
    )

    def draw(figure: Figure) -> None:
        ax = figure.subplots()
        for item, colour in zip(shown, TRIAL_COLOURS * len(shown), strict=False):
            if item.curve is not None:
                whole = item.counts is not None and item.counts.present and item.counts.absent
                counts = item.counts if whole else None
                roc_curve(item.curve, ax, label=item.results.device, counts=counts, colour=colour)
        ax.legend(frameon=False, fontsize=8, loc="lower right")

    return Picture(
        title="Sensitivity over 1 - specificity",
        draw=draw,
        size=SQUARE,
        alt=f"Curve of each of {counted(len(shown), 'device')}",
        caption=f"{text}. The point is the threshold that was fixed, with both Wilson intervals; grey is chance.",
    )


def _of_device(device_analysis: DeviceAnalysis) -> Iterator[Picture]:
    device, results = device_analysis.results.device, device_analysis.results
    scores, present = results.scores()
    if len(scores):
        yield Picture(
            title=f"{device}: scores",
            draw=on_axes(scores_by_truth, scores, present, threshold=results.threshold),
            size=SQUARE,
            alt=f"Scores of {int(present.sum())} targets with an inclusion and {int((~present).sum())} blanks",
            caption="Each dot is a target, by its first reading.",
        )
    if device_analysis.reliability is not None:
        yield Picture(
            title=f"{device}: are its probabilities right?",
            draw=on_axes(reliability_diagram, device_analysis.reliability),
            size=SQUARE,
            alt="Fractions that came true over probabilities; Brier score "
            f"{small(device_analysis.reliability.brier.score)}, 95 % interval {ends(device_analysis.brier_interval)}",
            caption="On the grey line they are. Bars are Wilson intervals, numbers count targets.",
        )
    if any(target.truth.has_inclusion for target in results.targets):
        yield Picture(
            title=f"{device}: found and missed",
            draw=partial(_draw_detected, device_analysis),
            size=SQUARE,
            alt=f"Inclusions over size and depth; {len(results.detected)} were found. See the table of targets.",
            caption="Each mark is an inclusion, deep ones below.",
        )
    if device_analysis.errors:
        yield Picture(
            title=f"{device}: what it read, beside what is true",
            draw=partial(_draw_errors, device_analysis.errors, device_analysis),
            size=(10.5, 3.6),
            alt="; ".join(
                f"{labelled(error.quantity)}: rms error {error.rmse:.2f}" for error in device_analysis.errors
            ),
            caption="Inclusions that were found. On the grey line reading and truth agree"
            + ("; bars are 90 % intervals." if any(error.covered for error in device_analysis.errors) else "."),
            wide=True,
        )


def _draw_detected(device_analysis: DeviceAnalysis, figure: Figure) -> None:
    inside = [
        target
        for target in device_analysis.results.targets
        if target.truth.has_inclusion and target.reading is not None
    ]
    detected_by_size_and_depth(
        [target.truth.values["diameter_mm"] for target in inside],
        [target.truth.values["depth_mm"] for target in inside],
        [None if target.score is None else device_analysis.results.calls(target) for target in inside],
        figure.subplots(),
    )


def _draw_errors(errors: tuple[SizeErrors, ...], device_analysis: DeviceAnalysis, figure: Figure) -> None:
    readings = {target.code: target.reading for target in device_analysis.results.detected}
    for error, ax in zip(errors, figure.subplots(1, len(errors), squeeze=False)[0], strict=True):
        both = [readings[code] for code in error.codes]
        intervals = [None if reading is None else reading.interval_90.get(error.quantity) for reading in both]
        bars = None
        if all(interval is not None for interval in intervals):
            outer = np.array([interval for interval in intervals if interval is not None])
            bars = np.maximum([error.read - outer[:, 0], outer[:, 1] - error.read], 0.0)
        read_over_true(error.true, error.read, ax, label=labelled(error.quantity), errors=bars)


def _limits(comparison: DeviceComparison) -> Picture:
    def draw(figure: Figure) -> None:
        axes = figure.subplots(1, len(comparison.limits), squeeze=False)[0]
        for (name, limit), ax in zip(comparison.limits.items(), axes, strict=True):
            agreement_limits(limit, ax, label=labelled(name))

    text = "; ".join(f"{labelled(name)}: bias {limit.bias:+.2f}" for name, limit in comparison.limits.items())
    return Picture(
        title=f"{comparison.first} less {comparison.second}",
        draw=draw,
        size=(10.5, 3.6),
        alt=text,
        caption="After Bland and Altman: bias, and dashed the limits between which 95 % of differences lie.",
        wide=True,
    )


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

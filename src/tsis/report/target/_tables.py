"""Tables of a target: active estimates beside the truth, presses, calibrations, earlier estimates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.model import INTERVAL_LEVEL, NO_UNIT, label_of, unit_of
from tsis.report._calibration import content_rows
from tsis.report._document import sd_text
from tsis.report._hardness import hardness_rows
from tsis.report._inclusion import TITLES
from tsis.report._page import Table
from tsis.report.target._text import SHORT, heading, newest_first, time_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from tsis.model import Estimate
    from tsis.records import StoredEstimate, StoredPress, TargetRecord


def target_tables(record: TargetRecord) -> tuple[Table, ...]:
    """All tables with content."""
    return (
        *_result(record),
        *_presses(record),
        *(
            Table(
                title=f"Calibration {calibration.name} ({identity[:SHORT]})",
                headings=("quantity", "value", "95 % interval"),
                rows=content_rows(calibration, cited=identity),
            )
            for identity, calibration in sorted(record.calibrations.items())
        ),
        *history_tables(record),
    )


def parameter_label(name: str) -> tuple[str, str]:
    """Name and unit of a parameter."""
    if name in TITLES:
        return TITLES[name]
    return label_of(name), "" if unit_of(name) == NO_UNIT else unit_of(name)


def measure(value: float, unit: str) -> str:
    """A number with its unit."""
    return f"{value:.4g} {unit}".strip()


def _result(record: TargetRecord) -> tuple[Table, ...]:
    truth = record.target.truth
    if not record.estimates:
        rows = tuple(_truth_rows(truth))
        return (Table(title="What is true of the phantom", headings=("quantity", "truth"), rows=rows),) if rows else ()
    return tuple(_active_estimate(record, stored) for stored in newest_first(record))


def _truth_rows(truth: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    for name, value in truth.items():
        label, unit = parameter_label(name)
        yield label, measure(value, unit)


def _active_estimate(record: TargetRecord, stored: StoredEstimate) -> Table:
    title, truth = heading(record, stored, "Current estimate"), record.target.truth
    if stored.kind == "hardness":
        true = [(f"truth of {name}", value) for name, value in _truth_rows(truth)]
        values = (*hardness_rows(stored.estimate), *true)
        return Table(title=title, headings=("quantity", "value"), rows=values)
    headings = ("quantity", "mean", "90 % interval", "sd", "prior sd", "least sd (Cramér-Rao)")
    names = dict.fromkeys((*stored.estimate.names, *truth))
    rows, last = tuple(_parameter_row(stored.estimate, name, truth) for name in names), ("truth",) if truth else ()
    return Table(title=title, headings=headings + last, rows=rows)


def _parameter_row(estimate: Estimate, name: str, truth: Mapping[str, float]) -> tuple[str, ...]:
    text, unit = parameter_label(name)
    given = () if not truth else (measure(truth[name], unit) if name in truth else "not known",)
    if name not in estimate.names:
        return (text, "not estimated", "", "", "", "", *given)
    uncertainty = estimate.withheld_reason(name)
    if not estimate.trusted:
        return (text, uncertainty, "", "", "", "", *given)
    low, high = estimate.interval(INTERVAL_LEVEL)[name]
    bound = estimate.cramer_rao_sd.get(name, np.inf)
    return (
        text,
        uncertainty or f"{estimate.mean[name]:.3g} {unit}",
        f"{low:.3g} to {high:.3g} {unit}",
        sd_text(estimate.sd[name]) if estimate.identified(name) else "",
        sd_text(estimate.prior_sd[name]),
        sd_text(bound) if np.isfinite(bound) else "none known",
        *given,
    )


def _presses(record: TargetRecord) -> tuple[Table, ...]:
    if not record.presses:
        return ()
    noted = any(press.name or press.note for press in record.presses)
    headings = ("no.", "taken (UTC)", "role", "force", "mm per pixel", "flags", "frame, SHA-256")
    rows = tuple(
        _press_row(number, press) + ((": ".join(filter(None, (press.name, press.note))),) if noted else ())
        for number, press in enumerate(record.presses, 1)
    )
    return (Table(title="Presses", headings=(*headings, "name and note") if noted else headings, rows=rows),)


def _press_row(number: int, press: StoredPress) -> tuple[str, ...]:
    return (
        str(number),
        time_text(press.taken),
        press.role,
        "not measured" if press.force_n is None else f"{press.force_n:.3g} N",
        "not known" if press.mm_per_pixel is None else "{:.4g} × {:.4g}".format(*press.mm_per_pixel),
        ", ".join(press.flags) or "none",
        press.frame[:SHORT],
    )


def history_tables(record: TargetRecord) -> tuple[Table, ...]:
    """All estimates; no table where there is none."""
    if not record.estimates:
        return ()
    headings = ("made (UTC)", "estimate", "kind", "tsis", "mean and 90 % interval", "presses", "replaces")
    rows = tuple(_history_row(stored) for stored in record.estimates)
    return (Table(title="All estimates; the last of each kind is current", headings=headings, rows=rows),)


def _history_row(stored: StoredEstimate) -> tuple[str, ...]:
    estimate = stored.estimate
    return (
        time_text(stored.made),
        stored.id[:SHORT],
        stored.kind,
        str(stored.environment.get("tsis", "not known")),
        "; ".join(_value_text(estimate, name) for name in estimate.names) if estimate.trusted else "not to be trusted",
        str(len(stored.presses)),
        stored.supersedes[:SHORT] if stored.supersedes else "none",
    )


def _value_text(estimate: Estimate, name: str) -> str:
    text, unit = parameter_label(name)
    low, high = estimate.interval(INTERVAL_LEVEL)[name]
    mean = estimate.withheld_reason(name) or f"{estimate.mean[name]:.3g} {unit}".strip()
    return f"{text} {mean} ({low:.3g} to {high:.3g})"

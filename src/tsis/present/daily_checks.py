"""The control charts of a probe's daily checks."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.present.document import envelope
from tsis.present.figures import drift_chart
from tsis.present.labels import counted
from tsis.present.page import Card, Page, Picture, Table, on_axes
from tsis.study.drift import CHARTED, ewma_run_length, shewhart_run_length

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.study.drift import CheckLog, DriftChart


def drift_page(log: CheckLog, charts: Sequence[DriftChart]) -> Page:
    """Charts of all values of the daily checks, the warnings first."""
    plan, last = log.plan, log.checks[-1]
    return Page(
        title=f"Daily checks of {plan.probe}",
        subtitle=f"{plan.phantom} at {plan.force_n:g} N; {counted(len(log.checks), 'check')} until {last.at:%Y-%m-%d}",
        cards=tuple(
            Card(title=CHARTED[item.name][0], value=_state(item), detail=_change(item), doubtful=item.warns)
            for item in charts
        ),
        notes=drift_notes(log, charts),
        pictures=tuple(
            Picture(
                title=CHARTED[item.name][0],
                draw=on_axes(drift_chart, item.chart, label=CHARTED[item.name][1], tolerance=item.tolerance),
                size=(4.6, 3.2),
                alt=f"Control chart of {counted(len(log.checks), 'check')}",
                caption="" if item.per_kelvin is None else f"{item.per_kelvin:+.3g} per kelvin were removed.",
            )
            for item in charts
        ),
        tables=drift_tables(charts),
        provenance={"head of the log": log.chain.head, "tsis of the last check": last.tsis},
    )


def _state(item: DriftChart) -> str:
    out = item.first_out is not None and abs(item.chart.ewma[-1] - item.chart.centre) > item.tolerance
    return "out of tolerance" if out else "warning" if item.warns else "in control"


def _change(item: DriftChart) -> str:
    return f"{(item.chart.ewma[-1] - item.chart.centre) / abs(item.chart.centre):+.2%} since the baseline (EWMA)"


def drift_notes(log: CheckLog, charts: Sequence[DriftChart]) -> tuple[str, ...]:
    """What warns, and what the limits mean."""
    warnings = [
        f"{CHARTED[item.name][0]}: {_state(item)} since check {item.chart.first_warning + 1}, {_change(item)}."
        for item in charts
        if item.warns and item.chart.first_warning is not None
    ]
    cure = "Repeat the check. If it warns again, look at lamps, temperature and face; then calibrate anew."
    return (
        *warnings,
        *([cure] if warnings else ["No rule warns at the last check."]),
        f"Limits are those of the first {log.plan.baseline} checks, by Student's t: Shewhart at three standard "
        "deviations, and EWMA of weight 0.2. On average a chart of a steady probe warns falsely every "
        f"{ewma_run_length(0.0):.0f} checks by the EWMA and every {shewhart_run_length(0.0):.0f} by Shewhart. A shift "
        f"of one standard deviation is seen after {ewma_run_length(1.0):.0f}.",
        f"The probe counts as out when the EWMA is {log.plan.tolerance:.1%} from the baseline.",
    )


HEADINGS = ("value", "baseline", "sd", "last", "EWMA", "first warning", "first out")


def drift_tables(charts: Sequence[DriftChart]) -> tuple[Table, ...]:
    """Numbers of each chart."""
    rows = tuple(
        (
            CHARTED[item.name][0],
            f"{item.chart.centre:.4g}",
            f"{item.chart.sd / abs(item.chart.centre):.2%}",
            f"{item.chart.values[-1]:.4g}",
            f"{item.chart.ewma[-1]:.4g}",
            "-" if item.chart.first_warning is None else str(item.chart.first_warning + 1),
            "-" if item.first_out is None else str(item.first_out + 1),
        )
        for item in charts
    )
    return (Table(title="Charts", columns=HEADINGS, values=rows),)


def drift_document(log: CheckLog, charts: Sequence[DriftChart]) -> dict[str, Any]:
    """Plan, checks and charts as JSON values; charts are empty until the baseline is whole."""
    return envelope(
        "study check",
        plan=asdict(log.plan),
        checks=len(log.checks),
        last=log.checks[-1].at.isoformat() if log.checks else None,
        warns=any(item.warns for item in charts),
        charts=[
            {
                "name": item.name,
                "unit": CHARTED[item.name][1],
                "centre": item.chart.centre,
                "sd": item.chart.sd,
                "shewhart": item.chart.shewhart,
                "values": item.chart.values.tolist(),
                "ewma": item.chart.ewma.tolist(),
                "ewma_half": [None if np.isnan(half) else float(half) for half in item.chart.ewma_half],
                "per_kelvin": item.per_kelvin,
                "tolerance": item.tolerance,
                "state": _state(item),
                "first_warning": None if item.chart.first_warning is None else item.chart.first_warning + 1,
                "first_out": None if item.first_out is None else item.first_out + 1,
            }
            for item in charts
        ],
        head=log.chain.head,
    )

"""Tables and figures of ``tsis match bench``."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any, Literal

from matplotlib.figure import Figure
from rich import box
from rich.table import Table

from tsis.instrument.file_bytes import printable_path
from tsis.matching.trials import LEVEL_LABELS
from tsis.model.durable import write_durably
from tsis.model.errors import FileInputError
from tsis.plots.matching import curves_over_levels
from tsis.report.document import json_bytes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from tsis.matching.trial_summary import ErrorRatio, TrialSummary

HOTEL, HIDDEN_KIND = "hotel", "hidden"
QUANTITIES: tuple[Literal["error", "failures", "seconds"], ...] = ("error", "failures", "seconds")
COLUMNS = (
    *("group", "level", "method", "trials", "median", "mean", "failures", "unannounced", "withheld", "refused"),
    "seconds",
    *("ratio", "ratio_low", "ratio_high", "rival"),
)


def pooled_tables(pooled: Sequence[TrialSummary]) -> list[Table]:
    """One table a kind of trials, a line a method, narrow enough for any terminal."""
    return [
        _table(title, [each for each in pooled if each.group == title])
        for title in dict.fromkeys(each.group for each in pooled)
    ]


def _table(kind: str, summaries: Sequence[TrialSummary]) -> Table:
    unit = " / px" if kind.startswith(HIDDEN_KIND) else ""
    title = f"{HOTEL}, {kind}" if unit else kind
    table = Table(title=f"{title}: {summaries[0].trials} trials", box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    table.add_column("method", no_wrap=True)
    for head in (f"median{unit}", f"mean{unit}", "failed", "silent", "mean / best CPD", "time"):
        table.add_column(head, justify="right", no_wrap=True)
    for each in summaries:
        table.add_row(
            each.method,
            f"{each.median:.4f}",
            f"{each.mean:.4f}",
            f"{each.failures:.0%}",
            "-" if each.unannounced is None else f"{each.unannounced:.0%}",
            ratio_text(each.ratio),
            f"{1000 * each.seconds:.0f} ms",
        )
    return table


def ratio_text(ratio: ErrorRatio | None) -> str:
    """A ratio and its interval of 95 %.

    Examples
    --------
    >>> ratio_text(None)
    '-'
    """
    return "-" if ratio is None else f"{ratio.value:.2f} [{ratio.low:.2f}, {ratio.high:.2f}]"


def bench_figures(levels: Sequence[TrialSummary]) -> dict[str, Figure]:
    """One figure a kind of distortion: error, failures and time over the levels, a column a shape."""
    groups = dict.fromkeys(each.group for each in levels)
    kinds: dict[str, list[str]] = {}
    for group in groups:
        kinds.setdefault(HOTEL if group.startswith(HOTEL) else group.rsplit("/", 1)[-1], []).append(group)
    return {kind: _figure(kind, members, levels) for kind, members in kinds.items()}


def _figure(kind: str, groups: Sequence[str], levels: Sequence[TrialSummary]) -> Figure:
    figure = Figure(figsize=(6.0 * len(groups), 11.0), layout="constrained")
    axes = figure.subplots(len(QUANTITIES), len(groups), squeeze=False)
    label, positions = _axis(kind, levels)
    for column, group in enumerate(groups):
        own = [each for each in levels if each.group == group]
        for row, quantity in enumerate(QUANTITIES):
            curves_over_levels(
                own,
                axes[row, column],
                quantity=quantity,
                positions=positions,
                level_label=label,
                unit="px" if kind == HOTEL else "",
            )
        axes[0, column].set_title(group)
    axes[0, 0].legend(fontsize="x-small", ncols=2)
    return figure


def _axis(kind: str, levels: Sequence[TrialSummary]) -> tuple[str, dict[str, float]]:
    """Name of the axis, and where each level lies on it."""
    for family, (label, values) in LEVEL_LABELS.items():
        if family == kind:
            return label, {str(number): value for number, value in enumerate(values, start=1)}
    return "separation / frames", {each.level: float(each.level) for each in levels}


def write_results(
    out: Path, document: Mapping[str, Any], levels: Sequence[TrialSummary], figures: Mapping[str, Figure]
) -> None:
    """Write result.json, summary.csv and the figures beside the rows.

    Raises
    ------
    FileInputError
        When the folder cannot be written.
    """
    files = {"result.json": json_bytes(document), "summary.csv": _csv(levels)}
    for kind, figure in figures.items():
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=120)
        files[f"{kind}.png"] = buffer.getvalue()
    try:
        for name, content in files.items():
            write_durably(out / name, content)
    except OSError as error:
        raise FileInputError(
            f"{printable_path(out)} must be a folder that can be written; got: {error.strerror}"
        ) from error


def _csv(levels: Sequence[TrialSummary]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for each in levels:
        ratio = ["", "", ""] if each.ratio is None else [each.ratio.value, each.ratio.low, each.ratio.high]
        shares = [each.failures, each.unannounced, each.withheld, each.refused]
        numbers = [each.trials, each.median, each.mean, *shares, each.seconds]
        writer.writerow([each.group, each.level, each.method, *numbers, *ratio, each.rival])
    return text.getvalue().encode()

"""Tables and figures of ``tsis match bench``."""

from __future__ import annotations

import csv
import io
import shlex
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich import box
from rich.table import Table

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import RESULT, print_json, result_bytes
from tsis.cli._progress import progress_bar, stop_interrupted
from tsis.errors import FileInputError, InputError
from tsis.present.terminal import people, print_notice

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure

    from tsis.matching.trials import ErrorRatio, Family, Trial, TrialRow, TrialSummary


HOTEL, HIDDEN_KIND = "hotel", "hidden"
QUANTITIES: tuple[Literal["error", "failures", "seconds"], ...] = ("error", "failures", "seconds")
COLUMNS = (
    *("group", "level", "method", "trials", "median", "mean", "failures", "unannounced", "withheld", "refused"),
    "seconds",
    *("ratio", "ratio_low", "ratio_high", "rival"),
)


def pooled_tables(pooled: Sequence[TrialSummary]) -> list[Table]:
    """A table for each kind of trials, with a row for each method."""
    return [
        _table(title, [item for item in pooled if item.group == title])
        for title in dict.fromkeys(item.group for item in pooled)
    ]


def _table(kind: str, summaries: Sequence[TrialSummary]) -> Table:
    unit = " / px" if kind.startswith(HIDDEN_KIND) else ""
    title = f"{HOTEL}, {kind}" if unit else kind
    table = Table(title=f"{title}: {summaries[0].trials} trials", box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False)
    table.add_column("method", no_wrap=True)
    for head in (f"median{unit}", f"mean{unit}", "failed", "silent", "mean / best CPD", "time"):
        table.add_column(head, justify="right", no_wrap=True)
    for summary in summaries:
        table.add_row(
            summary.method,
            f"{summary.median:.4f}",
            f"{summary.mean:.4f}",
            f"{summary.failures:.0%}",
            "-" if summary.unannounced is None else f"{summary.unannounced:.0%}",
            ratio_text(summary.ratio),
            f"{1000 * summary.seconds:.0f} ms",
        )
    return table


def ratio_text(ratio: ErrorRatio | None) -> str:
    """A ratio with its 95 % interval.

    Examples
    --------
    >>> ratio_text(None)
    '-'
    """
    return "-" if ratio is None else f"{ratio.value:.2f} [{ratio.low:.2f}, {ratio.high:.2f}]"


def benchmark_figures(levels: Sequence[TrialSummary]) -> dict[str, Figure]:
    """A figure for each kind of distortion: error, failures and time over the levels, a column for each shape."""
    groups = dict.fromkeys(level.group for level in levels)
    kinds: dict[str, list[str]] = {}
    for group in groups:
        kinds.setdefault(HOTEL if group.startswith(HOTEL) else group.rsplit("/", 1)[-1], []).append(group)
    return {kind: _figure(kind, members, levels) for kind, members in kinds.items()}


def _figure(kind: str, groups: Sequence[str], levels: Sequence[TrialSummary]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0 * len(groups), 11.0), layout="constrained")
    axes = figure.subplots(len(QUANTITIES), len(groups), squeeze=False)
    label, positions = _axis(kind, levels)
    for column, group in enumerate(groups):
        own = [level for level in levels if level.group == group]
        for row, quantity in enumerate(QUANTITIES):
            tsis.present.figures.curves_over_levels(
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
    """Name of the axis, and the position of each level."""
    for family, (label, values) in tsis.matching.trials.LEVEL_LABELS.items():
        if family == kind:
            return label, {str(number): value for number, value in enumerate(values, start=1)}
    return "separation / frames", {level.level: float(level.level) for level in levels}


def write_results(
    out: Path, document: Mapping[str, Any], levels: Sequence[TrialSummary], figures: Mapping[str, Figure]
) -> None:
    """Write result.json, summary.csv and the figures beside the rows.

    Raises
    ------
    FileInputError
        When the folder cannot be written.
    """
    files = {RESULT: result_bytes(document), "summary.csv": _csv(levels)}
    for kind, figure in figures.items():
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=120)
        files[f"{kind}.png"] = buffer.getvalue()
    try:
        for name, content in files.items():
            tsis.files.write_durably(out / name, content)
    except OSError as error:
        raise FileInputError(
            f"{tsis.files.printable_path(out)} must be a folder that can be written; got: {error.strerror}"
        ) from error


def _csv(levels: Sequence[TrialSummary]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for level in levels:
        ratio = ["", "", ""] if level.ratio is None else [level.ratio.value, level.ratio.low, level.ratio.high]
        fractions = [level.failures, level.unannounced, level.withheld, level.refused]
        numbers = [level.trials, level.median, level.mean, *fractions, level.seconds]
        writer.writerow([level.group, level.level, level.method, *numbers, *ratio, level.rival])
    return text.getvalue().encode()


ROWS = "rows.csv"
HOTEL_FAILURE_PX = 5.0


def benchmark(
    *,
    data: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder of the public trials and the hotel sequence."),
    ] = None,
    methods: Annotated[
        str | None,
        typer.Option(
            help="With commas: tprl, cpd, bcpd, tps-rpm, rpm-lns, shape-context, pycpd, pycpd-common, pycpd-outliers, "
            "pycpd-raw, biocpd, biocpd-common, biocpd-outliers, probreg, probreg-common.",
            show_default="all that are installed",
        ),
    ] = None,
    families: Annotated[
        str | None,
        typer.Option(
            help="With commas: deformation, noise, outliers, rotation, occlusion, hotel.", show_default="all at hand"
        ),
    ] = None,
    levels: Annotated[str | None, typer.Option(help="Levels from 1, with commas.", show_default="all")] = None,
    shapes: Annotated[
        str | None, typer.Option(help="Shapes, with commas; generated ones may be curve, strokes, spiral, surface, ...")
    ] = None,
    trials: Annotated[int, typer.Option(min=1, max=10_000, help="Trials a shape and level.")] = 10,
    workers: Annotated[int, typer.Option(min=1, max=256, help="Processes; times are comparable only with one.")] = 1,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of trials, shuffling and methods.")] = 0,
    out: Annotated[Path | None, typer.Option(help="New folder for rows, tables and figures.", metavar="FOLDER")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Resume with the rows in --out.")] = False,
    as_json: AsJson = False,
) -> None:
    """Compare the methods on trials with known matches: error, failures and time, beside the best coherent point drift.

    Without --data shapes are generated and distorted as the public trials are. Files in --out stay when the run is
    interrupted; the same command with --resume continues.
    """
    if resume and out is None:
        raise InputError("--resume needs --out, the folder of the interrupted run")
    contenders = [
        tsis.matching.trials.BenchmarkMethod(name=name)
        for name in (
            methods.split(",") if methods else (*tsis.matching.trials.OWN_METHODS, *tsis.matching.trials.PEERS)
        )
    ]
    absent = {contender.name: contender.absent() for contender in contenders}
    present = {contender.name: contender for contender in contenders if not absent[contender.name]}
    if not present:
        raise InputError(f"--methods must name one that can run here; {'; '.join(absent.values())}")
    requested = _trials(data, families, levels, shapes, trials, seed)
    file = None if out is None else out / ROWS
    try:
        with progress_bar("Matching") as advance:
            rows = tsis.matching.trials.run_trials(
                requested, present, seed=seed, file=file, resume=resume, workers=workers, progress=advance
            )
    except KeyboardInterrupt:
        _stop_interrupted(out, resume=resume)
    notes = [
        f"{why}; left out: {', '.join(name for name in absent if absent[name] == why)}."
        for why in dict.fromkeys(absent.values())
        if why
    ]
    _publish(rows, out, notes, as_json=as_json)


def _trials(
    data: Path | None, families: str | None, levels: str | None, shapes: str | None, count: int, seed: int
) -> list[Trial]:
    chosen = (
        families.split(",") if families else [*tsis.matching.trials.FAMILIES, *([HOTEL] if data is not None else [])]
    )
    for name in chosen:
        tsis.model.require_one_of("family of trials", name, (*tsis.matching.trials.FAMILIES, HOTEL))
    if HOTEL in chosen and data is None:
        raise InputError("--families hotel needs --data, the folder of the sequence")
    distorted: list[Family] = [family for family in tsis.matching.trials.FAMILIES if family in chosen]
    trials: list[Trial] = []
    if distorted:
        trials += tsis.matching.trials.distorted_set(
            data,
            families=distorted,
            shapes=shapes.split(",") if shapes else None,
            levels=_whole_numbers(levels) if levels else None,
            count=count,
            seed=seed,
        )
    if HOTEL in chosen and data is not None:
        trials += tsis.matching.trials.hotel_set(data, count=count, seed=seed)
    return trials


def _whole_numbers(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"--levels must be whole numbers with commas between, as 1,3; got {text!r:.60}") from error


def _stop_interrupted(out: Path | None, *, resume: bool) -> None:
    again = " ".join(["tsis", *map(shlex.quote, sys.argv[1:]), *([] if resume else ["--resume"])])
    message = "nothing was written." if out is None else f"finished trials are saved. Resume with: {again}"
    stop_interrupted(f"; {message}")


def _publish(rows: list[TrialRow], out: Path | None, notes: list[str], *, as_json: bool) -> None:
    hotel = [row for row in rows if row.trial.startswith(HOTEL)]
    reference = [row for row in rows if not row.trial.startswith(HOTEL)]
    parts = [
        (part, limit)
        for part, limit in ((reference, tsis.matching.trials.FAILURE_RMS), (hotel, HOTEL_FAILURE_PX))
        if part
    ]
    levels = [
        item
        for part, limit in parts
        for item in tsis.matching.trials.summarise(part, rivals=tsis.matching.trials.RIVAL_METHODS, failure=limit)
    ]
    pooled = [
        item
        for part, limit in parts
        for item in tsis.matching.trials.summarise_pooled(
            part, rivals=tsis.matching.trials.RIVAL_METHODS, failure=limit
        )
    ]
    refused = sum(bool(row.refused) for row in rows)
    if refused:
        notes.append(f"{refused} of {len(rows)} results were refused or broke off and count as no movement.")
    document = tsis.present.document.envelope(
        "match bench",
        failure={"distorted": tsis.matching.trials.FAILURE_RMS, HOTEL: HOTEL_FAILURE_PX},
        pooled=[asdict(item) for item in pooled],
        levels=[asdict(level) for level in levels],
        notes=notes,
    )
    if out is not None:
        write_results(out, document, levels, benchmark_figures(levels))
    if as_json:
        print_json(document if out is None else {**document, "folder": str(out.resolve())})
        return
    console = people()
    for table in pooled_tables(pooled):
        console.print(table)
    console.print(
        f"RMS errors over all shapes and levels. Failed: above {tsis.matching.trials.FAILURE_RMS:g}, hotel above "
        f"{HOTEL_FAILURE_PX:g} px; silent: "
        "failed, and the method trusted its result. Results that it does not trust count, too, though tsis match "
        "withholds them. Ratio of means to the best coherent point drift of each level, with "
        "the bootstrap interval of 95 %."
    )
    for note in notes:
        console.print(f"- {note}", markup=False)
    if out is not None:
        console.print(f"Figures: {out.resolve()}", soft_wrap=True, markup=False)
    print_notice(console)

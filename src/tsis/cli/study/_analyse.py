"""``tsis study analyse``: unblind a study and analyse its readings."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from tsis.cli._options import AsJson
from tsis.cli._output import people, print_json, print_notice
from tsis.cli._progress import FAILED, progress_bar, stop_interrupted
from tsis.cli.study._new import StudyFolder
from tsis.errors import InputError

if TYPE_CHECKING:
    from tsis.study.analysis import DeviceAnalysis
    from tsis.study.folder import Study


def analyse(
    folder: StudyFolder,
    *,
    by: Annotated[str, typer.Option(help="Who unblinds and analyses it.")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder to write; a number is added when it exists.", show_default="analysis in the study's folder"
        ),
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Unblind without asking.")] = False,
    incomplete: Annotated[
        bool, typer.Option("--incomplete", help="Unblind though a device has not read every target.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Unblind a study for good and write its analysis: report.html, report.pdf, analysis.json, readings.csv.

    After that no reading is accepted. An unblinded study is analysed again.
    """
    from tsis.report.study import PAGE, few_notes, publish_study, record_notes, study_document, undecided_notes
    from tsis.study.folder import open_study

    study = open_study(folder)
    if study.unblinded is None:
        _require_whole(study, incomplete=incomplete)
        if not yes:
            _confirm(study, as_json=as_json)
    try:
        with progress_bar("analysing devices") as advance:
            done = publish_study(study, by=by, out=out, progress=advance)
    except KeyboardInterrupt:
        if open_study(folder).unblinded is None:
            raise
        stop_interrupted("; the study is unblinded. Repeat the command to write its analysis.")
    result = done.analysis
    if as_json:
        print_json({**study_document(result), "folder": str(done.folder), "head": done.study.chain.head})
        return
    console = people()
    for device in result.devices:
        console.print(_table(device))
    for note in (
        *record_notes(result),
        *(note for device in result.devices for note in (*few_notes(device), *undecided_notes(device))),
    ):
        console.print(f"- {note}", markup=False, soft_wrap=True)
    console.print(f"Head with this analysis: {done.study.chain.head}", soft_wrap=True)
    console.print(f"Page: {done.folder / PAGE}", markup=False, soft_wrap=True)
    print_notice(console)


def _require_whole(study: Study, *, incomplete: bool) -> None:
    for device in study.devices:
        read = {reading.code for reading in study.readings if reading.device == device}
        left = len(study.plan.codes) - len(read)
        if left and not incomplete:
            raise InputError(
                f"every target must be read before a study is unblinded; {device!r:.60} lacks {left} of "
                f"{len(study.plan.codes)} (read on, or give --incomplete)"
            )


def _confirm(study: Study, *, as_json: bool) -> None:
    if as_json or not sys.stdin.isatty():
        raise InputError("--yes must be given to unblind a study without a terminal")
    from tsis.study.folder import verify_study

    for fault in verify_study(study.folder).faults:
        typer.echo(f"Not as it was written: {fault}", err=True)
    question = (
        f"Unblind study {study.plan.name} with {len(study.readings)} readings? The log records it; no reading is "
        "accepted after it."
    )
    if not typer.confirm(question, err=True):
        typer.echo("Nothing was unblinded.", err=True)
        raise typer.Exit(FAILED)


def _table(device: DeviceAnalysis) -> Table:
    from tsis.report.study import ends, fraction_text, interval_text, method_of

    table = Table("", "value", "95 % interval", "method", box=SIMPLE_HEAD, show_edge=False, title_justify="left")
    table.title = escape(device.results.device)
    counts = device.counts
    if counts is not None and counts.present:
        table.add_row("sensitivity", fraction_text(counts.sensitivity), interval_text(counts.sensitivity), "Wilson")
    if counts is not None and counts.absent:
        table.add_row("specificity", fraction_text(counts.specificity), interval_text(counts.specificity), "Wilson")
    if device.curve is not None:
        interval = device.auc_interval
        table.add_row("area under the curve", f"{device.curve.auc:.3f}", ends(interval), method_of(interval))
    return table

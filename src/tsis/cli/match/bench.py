"""``tsis match bench``: how well and how fast the methods match trials whose answer is known."""

from __future__ import annotations

import shlex
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.exit_codes import INTERRUPTED
from tsis.cli.match.bench_output import HOTEL, bench_figures, pooled_tables, write_results
from tsis.cli.progress import progress_bar
from tsis.cli.targets import AsJson
from tsis.matching.contenders import OWN_METHODS, RIVAL_METHODS, BenchmarkMethod
from tsis.matching.peers import PEERS
from tsis.matching.trial_runs import run_trials
from tsis.matching.trial_sets import distorted_set, hotel_set
from tsis.matching.trial_summary import FAILURE_RMS, summarise, summarise_pooled
from tsis.matching.trials import FAMILIES
from tsis.model.check import require_one_of
from tsis.model.errors import InputError
from tsis.report.document import envelope

if TYPE_CHECKING:
    from tsis.matching.distort import Family, Trial
    from tsis.matching.trial_rows import TrialRow

ROWS = "rows.csv"
HOTEL_FAILURE_PX = 5.0
MEANING = (
    f"RMS errors over all shapes and levels. Failed: above {FAILURE_RMS:g}, hotel above {HOTEL_FAILURE_PX:g} px; silent: "
    "failed, and the method trusted its answer. Answers that it does not trust are judged, too, though tsis match "
    "withholds them. Ratio of means to the best coherent point drift of each level, with "
    "the bootstrap interval of 95 %."
)


def bench(
    *,
    data: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder of the public trials and the hotel sequence."),
    ] = None,
    methods: Annotated[
        str | None,
        typer.Option(help=f"With commas: {', '.join((*OWN_METHODS, *PEERS))}.", show_default="all that are installed"),
    ] = None,
    families: Annotated[
        str | None, typer.Option(help=f"With commas: {', '.join((*FAMILIES, HOTEL))}.", show_default="all at hand")
    ] = None,
    levels: Annotated[str | None, typer.Option(help="Levels from 1, with commas.", show_default="all")] = None,
    shapes: Annotated[
        str | None, typer.Option(help="Shapes, with commas; generated ones may be curve, strokes, spiral, surface, ...")
    ] = None,
    trials: Annotated[int, typer.Option(min=1, max=10_000, help="Trials a shape and level.")] = 10,
    workers: Annotated[int, typer.Option(min=1, max=256, help="Processes; times are comparable with one alone.")] = 1,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Of trials, shuffling and methods.")] = 0,
    out: Annotated[Path | None, typer.Option(help="New folder for rows, tables and figures.", metavar="FOLDER")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the rows in --out.")] = False,
    as_json: AsJson = False,
) -> None:
    """Judge the methods on trials with known matches: error, failures and time, beside the best coherent point drift.

    Without --data shapes are generated and distorted as the public trials are. Files in --out are kept when the run is
    interrupted; the same command with --resume goes on.
    """
    if resume and out is None:
        raise InputError("--resume needs --out, the folder that it goes on in")
    contenders = [BenchmarkMethod(name=name) for name in (methods.split(",") if methods else (*OWN_METHODS, *PEERS))]
    absent = {each.name: each.absent() for each in contenders}
    present = {each.name: each for each in contenders if not absent[each.name]}
    if not present:
        raise InputError(f"--methods must name one that can run here; {'; '.join(absent.values())}")
    wanted = _trials(data, families, levels, shapes, trials, seed)
    file = None if out is None else out / ROWS
    try:
        with progress_bar("Matching") as advance:
            rows = run_trials(wanted, present, seed=seed, file=file, resume=resume, workers=workers, progress=advance)
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
    chosen = families.split(",") if families else [*FAMILIES, *([HOTEL] if data is not None else [])]
    for name in chosen:
        require_one_of("family of trials", name, (*FAMILIES, HOTEL))
    if HOTEL in chosen and data is None:
        raise InputError("--families hotel needs --data, the folder of the sequence")
    distorted: list[Family] = [family for family in FAMILIES if family in chosen]
    found: list[Trial] = []
    if distorted:
        found += distorted_set(
            data,
            families=distorted,
            shapes=shapes.split(",") if shapes else None,
            levels=_whole_numbers(levels) if levels else None,
            count=count,
            seed=seed,
        )
    if HOTEL in chosen and data is not None:
        found += hotel_set(data, count=count, seed=seed)
    return found


def _whole_numbers(text: str) -> list[int]:
    try:
        return [int(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"--levels must be whole numbers with commas between, as 1,3; got {text!r:.60}") from error


def _stop_interrupted(out: Path | None, *, resume: bool) -> None:
    again = " ".join(["tsis", *map(shlex.quote, sys.argv[1:]), *([] if resume else ["--resume"])])
    said = "nothing was written" if out is None else f"finished trials are kept. Go on with: {again}"
    typer.echo(f"Interrupted; {said}.", err=True)
    sys.exit(INTERRUPTED)


def _publish(rows: list[TrialRow], out: Path | None, notes: list[str], *, as_json: bool) -> None:
    hotel = [row for row in rows if row.trial.startswith(HOTEL)]
    plain = [row for row in rows if not row.trial.startswith(HOTEL)]
    parts = [(part, limit) for part, limit in ((plain, FAILURE_RMS), (hotel, HOTEL_FAILURE_PX)) if part]
    levels = [each for part, limit in parts for each in summarise(part, rivals=RIVAL_METHODS, failure=limit)]
    pooled = [each for part, limit in parts for each in summarise_pooled(part, rivals=RIVAL_METHODS, failure=limit)]
    refused = sum(bool(row.refused) for row in rows)
    if refused:
        notes.append(f"{refused} of {len(rows)} answers were refused or broke off and count as no movement at all.")
    document = envelope(
        "match bench",
        failure={"distorted": FAILURE_RMS, HOTEL: HOTEL_FAILURE_PX},
        pooled=[asdict(each) for each in pooled],
        levels=[asdict(each) for each in levels],
        notes=notes,
    )
    if out is not None:
        write_results(out, document, levels, bench_figures(levels))
    if as_json:
        print_json(document if out is None else {**document, "folder": str(out.resolve())})
        return
    console = people()
    for table in pooled_tables(pooled):
        console.print(table)
    console.print(MEANING)
    for note in notes:
        console.print(f"- {note}", markup=False)
    if out is not None:
        console.print(f"Figures: {out.resolve()}", soft_wrap=True, markup=False)
    print_notice(console)

"""``tsis study show``: progress of a study, without its truth."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import people, print_json, print_notice
from tsis.cli._progress import FAILED
from tsis.cli.study._new import StudyFolder

if TYPE_CHECKING:
    from tsis.study.folder import Study


def show(
    folder: StudyFolder,
    *,
    device: Annotated[
        str | None, typer.Option(help="Device of the next code.", show_default="the virtual probe")
    ] = None,
    operator: Annotated[
        str | None, typer.Option(help="Operator of the next code.", show_default="who read most")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show the progress of a study and the next code to read, never the target of a code."""
    from tsis.study.folder import open_study

    study = open_study(folder)
    plan, by = study.plan, study.unblinded
    left = () if by is not None else study.missing(device or plan.device, operator)
    if as_json:
        print_json(
            tsis.report.envelope(
                "study show",
                folder=str(folder.resolve()),
                name=plan.name,
                made=plan.made.isoformat(),
                targets=len(plan.codes),
                repeats=plan.repeats,
                probe=plan.probe,
                forces_n=list(plan.forces_n),
                threshold=plan.threshold,
                readings=[_row(*item) for item in _tally(study)],
                next_code=left[0][0] if left else None,
                left=len(left),
                unblinded=None if by is None else {"moment": by.moment, "by": by.actor},
                head=study.chain.head,
            )
        )
        return
    console = people()
    times = "once" if plan.repeats == 1 else f"{plan.repeats} times"
    console.print(
        f"Study {plan.name}: {len(plan.codes)} targets, each to be read {times} by an operator; "
        f"threshold {plan.threshold:g}.",
        markup=False,
    )
    table = Table("device", "operator", "readings", "undecided")
    for item, who, count, undecided in _tally(study):
        table.add_row(escape(item), escape(who), str(count), str(undecided))
    console.print(table)
    if by is not None:
        console.print(
            f"Unblinded {tsis.files.one_line(f'{by.moment} by {by.actor}')}: no more readings are accepted.",
            markup=False,
        )
    elif left:
        code, repeat = left[0]
        console.print(f"Next code: {code}, repeat {repeat}; {len(left)} left of {device or plan.device}.", markup=False)
    else:
        console.print("Every target is read. Next: tsis study analyse", markup=False)
    print_notice(console)


def _tally(study: Study) -> list[tuple[str, str, int, int]]:
    counter = Counter((reading.device, reading.operator) for reading in study.readings)
    undecided = Counter((reading.device, reading.operator) for reading in study.readings if reading.undecided)
    return [(device, operator, count, undecided[device, operator]) for (device, operator), count in counter.items()]


def _row(device: str, operator: str, count: int, undecided: int) -> dict[str, Any]:
    return {"device": device, "operator": operator, "readings": count, "undecided": undecided}


def verify(
    folder: StudyFolder,
    *,
    head: Annotated[
        str | None,
        typer.Option(help="Hash that a report or this command printed: the log must contain that line."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Compare plan, sealed truth, reports and every line of the log; exit code 1 and a list where they differ.

    Only --head detects a truncated or rewritten log.
    """
    from tsis.report.study import study_verification_document
    from tsis.study.folder import open_study
    from tsis.study.folder import verify_study as verification

    result = verification(folder, head=head)
    if as_json:
        print_json(
            tsis.report.envelope("study verify", folder=str(folder.resolve()), **study_verification_document(result))
        )
    else:
        console = people()
        for fault in result.faults:
            console.print(f"- {fault}", markup=False, soft_wrap=True)
        if result.sound:
            console.print(
                f"Study {open_study(folder).plan.name} is as it was written, all {result.lines} lines.", markup=False
            )
        else:
            console.print(f"{len(result.faults)} places differ from their hashes.")
        if result.unblinded:
            console.print(f"Unblinded {result.unblinded}.", markup=False)
        console.print(f"Head: {result.head}", soft_wrap=True)
        print_notice(console)
    if not result.sound:
        raise typer.Exit(FAILED)

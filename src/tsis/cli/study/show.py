"""``tsis study show``: how far a study is; nothing of its truth."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.study.chosen import StudyFolder
from tsis.cli.targets import AsJson
from tsis.instrument.file_bytes import one_line
from tsis.report.document import envelope

if TYPE_CHECKING:
    from tsis.study import Study


def show(
    folder: StudyFolder,
    *,
    device: Annotated[
        str | None, typer.Option(help="Device whose next code is wanted.", show_default="the virtual probe")
    ] = None,
    operator: Annotated[
        str | None, typer.Option(help="Operator whose next code is wanted.", show_default="who read most")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show how far a study is and which code is to be read next; never what a code stands for."""
    from tsis.study import open_study

    study = open_study(folder)
    plan, by = study.plan, study.unblinded
    left = () if by is not None else study.missing(device or plan.device, operator)
    if as_json:
        print_json(
            envelope(
                "study show",
                folder=str(folder.resolve()),
                name=plan.name,
                made=plan.made.isoformat(),
                targets=len(plan.codes),
                repeats=plan.repeats,
                probe=plan.probe,
                forces_n=list(plan.forces_n),
                threshold=plan.threshold,
                readings=[_row(*each) for each in _tally(study)],
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
    for one, who, count, undecided in _tally(study):
        table.add_row(escape(one), escape(who), str(count), str(undecided))
    console.print(table)
    if by is not None:
        console.print(f"Unblinded {one_line(f'{by.moment} by {by.actor}')}: no more readings are taken.", markup=False)
    elif left:
        code, repeat = left[0]
        console.print(f"Next code: {code}, repeat {repeat}; {len(left)} left of {device or plan.device}.", markup=False)
    else:
        console.print("Every target is read. Next: tsis study analyse", markup=False)
    print_notice(console)


def _tally(study: Study) -> list[tuple[str, str, int, int]]:
    made = Counter((each.device, each.operator) for each in study.readings)
    undecided = Counter((each.device, each.operator) for each in study.readings if each.undecided)
    return [(device, operator, count, undecided[device, operator]) for (device, operator), count in made.items()]


def _row(device: str, operator: str, count: int, undecided: int) -> dict[str, Any]:
    return {"device": device, "operator": operator, "readings": count, "undecided": undecided}

"""``tsis study verify``: whether a study is as it was written."""

from __future__ import annotations

from typing import Annotated

import typer

from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.study.chosen import StudyFolder
from tsis.cli.targets import AsJson
from tsis.report.document import envelope

UNSOUND = 1  # exit code of a study that is not as it was written


def verify(
    folder: StudyFolder,
    *,
    head: Annotated[
        str | None,
        typer.Option(help="Hash that a report or this command printed: the log must hold that line still."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Compare plan, sealed truth, reports and every line of the log; exit code 1 and a list where they differ.

    Lines that were cut off the end, and a log that was written anew, show with --head alone.
    """
    from tsis.report.study_document import study_verification_document
    from tsis.study import open_study
    from tsis.study import verify_study as verification

    found = verification(folder, head=head)
    if as_json:
        print_json(envelope("study verify", folder=str(folder.resolve()), **study_verification_document(found)))
    else:
        console = people()
        for fault in found.faults:
            console.print(f"- {fault}", markup=False, soft_wrap=True)
        if found.sound:
            console.print(
                f"Study {open_study(folder).plan.name} is as it was written, all {found.lines} lines.", markup=False
            )
        else:
            console.print(f"{len(found.faults)} places differ from what was written.")
        if found.unblinded:
            console.print(f"Unblinded {found.unblinded}.", markup=False)
        console.print(f"Head: {found.head}", soft_wrap=True)
        print_notice(console)
    if not found.sound:
        raise typer.Exit(UNSOUND)

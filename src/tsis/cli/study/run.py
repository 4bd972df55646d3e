"""``tsis study run``: the virtual probe reads what is left."""

from __future__ import annotations

import os
import signal
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from tsis.cli.console_output import people, print_json, print_notice
from tsis.cli.exit_codes import INTERRUPTED
from tsis.cli.interrupt import ended_by
from tsis.cli.progress import progress_bar
from tsis.cli.records.chosen_store import DATABASE, PHANTOM, opened
from tsis.cli.study.chosen import ByName, StudyFolder
from tsis.cli.targets import AsJson
from tsis.model.check import LARGEST_SEED
from tsis.report.document import envelope


def run(
    folder: StudyFolder,
    *,
    operator: ByName = "",
    keep: Annotated[
        Path | None,
        typer.Option(help="Folder of a store of phantoms that gets frames and estimates, under the codes."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the probe's errors.", min=0, max=LARGEST_SEED)] = 0,
    as_json: AsJson = False,
) -> None:
    """Press what is left to read with the virtual probe, and enter each estimate at once.

    The score is the probability of an inclusion. Stop it at any time with Ctrl-C and start it again: what was read is
    kept. Another operator reads every target anew.
    """
    from tsis.study import open_study, press_study

    study = open_study(folder)
    with ExitStack() as until:
        store = None
        if keep is not None:
            store = until.enter_context(opened(keep, PHANTOM, os.environ.get(DATABASE), create=True))
        preparing = until.enter_context(progress_bar("preparing the probe (kept for next time)"))
        advance = until.enter_context(progress_bar("reading targets"))
        ended = until.enter_context(ended_by(signal.SIGINT, signal.SIGTERM))
        done = press_study(
            study,
            operator=operator,
            seed=seed,
            keep=store,
            preparing=preparing,
            progress=advance,
            ended=ended.is_set,
        )
    if as_json:
        print_json(
            envelope(
                "study run",
                folder=str(folder.resolve()),
                device=study.plan.device,
                entered=done.entered,
                undecided=done.undecided,
                left=done.left,
                head=done.study.chain.head,
            )
        )
    else:
        console = people()
        console.print(f"{done.entered} readings entered, {done.undecided} of them undecided; {done.left} left.")
        if not done.left:
            console.print(f"Next: tsis study analyse {folder} --by NAME", markup=False, soft_wrap=True)
        print_notice(console)
    if done.left:
        typer.echo("Interrupted; what was read is kept. Start the same command again to go on.", err=True)
        raise typer.Exit(INTERRUPTED)

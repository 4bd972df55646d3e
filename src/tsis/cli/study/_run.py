"""``tsis study run``: the virtual probe reads the remaining targets."""

from __future__ import annotations

import os
import signal
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

import tsis
from tsis.__about__ import LARGEST_SEED
from tsis.cli._groups import ended_by
from tsis.cli._options import AsJson
from tsis.cli._output import people, print_json, print_notice
from tsis.cli._progress import progress_bar, stop_interrupted
from tsis.cli._store import DATABASE, PHANTOM, opened
from tsis.cli.study._new import ByName, StudyFolder


def run(
    folder: StudyFolder,
    *,
    operator: ByName = "",
    save: Annotated[
        Path | None,
        typer.Option(help="Store of phantoms in which frames and estimates are saved, under the codes."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the probe's errors.", min=0, max=LARGEST_SEED)] = 0,
    strain: Annotated[
        str, typer.Option(help="Mechanics of presses and estimates: finite, seconds a press; small, tenths.")
    ] = "finite",
    as_json: AsJson = False,
) -> None:
    """Read the remaining targets with the virtual probe, and enter each estimate at once.

    The score is the probability of an inclusion. Stop it at any time with Ctrl-C and start it again: finished readings
    stay. Another operator reads every target anew.
    """
    from tsis.study.folder import open_study
    from tsis.study.readings import press_study

    study = open_study(folder)
    with ExitStack() as until:
        store = None
        if save is not None:
            store = until.enter_context(opened(save, PHANTOM, os.environ.get(DATABASE), create=True))
        preparing = until.enter_context(progress_bar("preparing the probe (cached for next time)"))
        advance = until.enter_context(progress_bar("reading targets"))
        ended = until.enter_context(ended_by(signal.SIGINT, signal.SIGTERM))
        done = press_study(
            study,
            operator=operator,
            seed=seed,
            strain=strain,
            save=store,
            preparing=preparing,
            progress=advance,
            ended=ended.is_set,
        )
    if as_json:
        print_json(
            tsis.report.envelope(
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
        stop_interrupted("; finished readings stay. Repeat the command to continue.")


TableFile = Annotated[Path, typer.Argument(metavar="READINGS.csv", help="Comma-separated values in UTF-8.")]


def import_(
    folder: StudyFolder,
    readings: TableFile,
    *,
    device: Annotated[str, typer.Option(help="Name of the device that read them.")],
    threshold: Annotated[
        float | None,
        typer.Option(help="Lowest score that counts as an inclusion; fixed from now on.", show_default="the study's"),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Enter readings of another device: code, score, operator, repeat, diameter_mm, depth_mm, young_kpa.

    All of them or none. An empty score is an undecided reading; the last three may be empty.
    """
    from tsis.study.folder import open_study
    from tsis.study.readings import import_readings

    study = open_study(folder)
    after = import_readings(study, readings, device=device, threshold=threshold)
    entered = len(after.readings) - len(study.readings)
    if as_json:
        entries = {"folder": str(folder.resolve()), "device": device, "threshold": after.threshold_of(device)}
        print_json(tsis.report.envelope("study import", **entries, entered=entered, head=after.chain.head))
        return
    console = people()
    console.print(
        f"{entered} readings of {device} entered; threshold {after.threshold_of(device):g}, fixed from now on.",
        markup=False,
    )
    print_notice(console)


def export(
    folder: StudyFolder,
    readings: TableFile,
    *,
    device: Annotated[str | None, typer.Option(help="Whose readings.", show_default="the only device's")] = None,
    as_json: AsJson = False,
) -> None:
    """Write the readings of a device as a table, without the truth."""
    from tsis.records.export import export_file
    from tsis.study.folder import open_study
    from tsis.study.readings import export_readings

    content = export_readings(open_study(folder), device)
    with export_file(readings) as draft:
        draft.write_bytes(content)
    if as_json:
        print_json(tsis.report.envelope("study export", file=str(readings.resolve())))
        return
    console = people()
    console.print(f"Readings: {readings.resolve()}", markup=False, soft_wrap=True)
    print_notice(console)

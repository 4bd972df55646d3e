"""``tsis study new``: create a blinded study."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.__about__ import LARGEST_SEED
from tsis.cli._options import AsJson, ProbeName
from tsis.cli._output import people, print_json, print_notice
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.study.plan import TargetTruth


StudyFolder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the study.")]
ByName = Annotated[str, typer.Option("--operator", help="Person at the probe.", show_default="this user")]


USUAL = 8


class Like(StrEnum):
    """How the targets are generated."""

    PRINTED = "printed"
    RANDOM = "random"


def new(
    folder: StudyFolder,
    *,
    present: Annotated[int | None, typer.Option(help="Targets with an inclusion.", show_default="8", min=0)] = None,
    blank: Annotated[int | None, typer.Option(help="Targets without one.", show_default="8", min=0)] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            help="Seed of codes and order, written into the plan: it allows the study to be repeated.",
            show_default="random, and sealed with the truth",
            min=0,
            max=LARGEST_SEED,
        ),
    ] = None,
    like: Annotated[
        Like | None,
        typer.Option(
            help="printed: phantoms detection-1 to detection-8 and detection-blank; random: 2 to 15 mm, 4 to 12 mm "
            "deep, 40 to 120 kPa, in tissue that varies.",
            show_default="printed",
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(
            help="Targets of your own instead: a CSV file with label, diameter_mm, depth_mm, young_kpa, which are "
            "empty for a blank."
        ),
    ] = None,
    repeats: Annotated[int, typer.Option(help="How often an operator reads every target.", min=1, max=1000)] = 1,
    probe: ProbeName = "tsis-domed",
    forces: Annotated[
        str | None,
        typer.Option(
            help="Forces of the virtual probe in newtons, with commas.", show_default="0.5,1 under a dome, else 1"
        ),
    ] = None,
    no_reference: Annotated[bool, typer.Option("--no-reference", help="No reference presses.")] = False,
    threshold: Annotated[
        float, typer.Option(help="Lowest score that counts as an inclusion; fixed from now on.")
    ] = 0.5,
    name: Annotated[str, typer.Option(help="Name of the study.", show_default="that of the folder")] = "",
    as_json: AsJson = False,
) -> None:
    """Create a blinded study: a plan, the sealed truth and a log, in a new folder.

    The seal, sealed.json, is no lock. It prevents reading the truth by accident, and its hash in the plan
    shows every later change.
    """
    from tsis.study.folder import new_study

    if truth is not None and any(given is not None for given in (present, blank, like)):
        raise InputError("--truth gives all targets; leave out --present, --blank and --like")
    study = new_study(
        folder,
        _targets(truth, like, USUAL if present is None else present, USUAL if blank is None else blank),
        name=name,
        seed=seed,
        probe=probe,
        forces_n=None if forces is None else _forces(forces),
        with_reference=not no_reference,
        repeats=repeats,
        threshold=threshold,
    )
    plan = study.plan
    if as_json:
        print_json(
            tsis.report.envelope(
                "study new",
                folder=str(folder.resolve()),
                name=plan.name,
                targets=len(plan.codes),
                codes=list(plan.codes),
                truth_sha256=plan.commitment,
                head=study.chain.head,
            )
        )
        return
    console = people()
    times = "once" if plan.repeats == 1 else f"{plan.repeats} times"
    console.print(f"Study {plan.name}: {len(plan.codes)} targets, each to be read {times}.", markup=False)
    console.print(f"- first code: {plan.codes[0]}; threshold {plan.threshold:g}, fixed from now on", markup=False)
    console.print(f"- SHA-256 of the sealed truth: {plan.commitment}", soft_wrap=True)
    console.print(f"Next: tsis study run {folder}, or tsis study import", markup=False, soft_wrap=True)
    print_notice(console)


def _targets(
    truth: Path | None, like: Like | None, present: int, blank: int
) -> tuple[TargetTruth, ...] | Callable[[int], tuple[TargetTruth, ...]]:
    import numpy as np

    from tsis.study.folder import printed_targets, random_targets
    from tsis.study.plan import TARGETS
    from tsis.study.readings import read_truth_table

    if truth is not None:
        return read_truth_table(truth)
    if like is Like.RANDOM:
        return lambda seed: random_targets(present, blank, rng=np.random.default_rng([seed, TARGETS]))
    return printed_targets(present, blank)


def _forces(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"--forces must be numbers with commas between, such as 0.5,1; got {text!r:.60}") from error

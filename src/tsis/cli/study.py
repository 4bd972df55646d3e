"""``tsis study``: blinded studies, cards, checks, the kit.

The package of studies is imported when a command runs, so that the program starts quickly.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import ExitStack
from datetime import UTC, datetime
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tsis
from tsis.__about__ import LARGEST_SEED, RESEARCH_USE_ONLY
from tsis.cli.options import AsJson, PhantomName, ProbeName, read_frames, scale_of, typed_options
from tsis.cli.output import CommandOutcome, CommandResult, Out, print_json, publish, result_bytes, show_result
from tsis.cli.progress import FAILED, ended_by, progress_bar, stop_interrupted
from tsis.cli.saving import DATABASE, PHANTOM, opened
from tsis.errors import InputError
from tsis.present.page import Column, Table
from tsis.present.terminal import people, print_notice, print_tables, rich_table

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from tsis.present.page import Page
    from tsis.study.folder import Study
    from tsis.study.plan import TargetTruth
    from tsis.study.search import DetectionRangeTable, ScanPlan

app = typer.Typer(
    name="study",
    epilog="Start with: tsis study new trial, tsis study run trial, tsis study analyse trial --by NAME",
    no_args_is_help=True,
)

StudyFolder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the study.")]
ByName = Annotated[str, typer.Option("--operator", help="Person at the probe.", show_default="this user")]
TableFile = Annotated[Path, typer.Argument(metavar="READINGS.csv", help="Comma-separated values in UTF-8.")]
OutFolder = Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")]
DeviceName = Annotated[str | None, typer.Option(help="Whose readings.", show_default="the first device's")]
USUAL = 8  # targets of either kind
REPEATS = (2, 3, 5)  # of the designs that size compares
OPERATORS = (2, 3, 5, 10, 20)
DESIGN = ("operators", "repeats", "phantoms", "presses", "upper_repeatability", "upper_reproducibility")
PLANNED = ("strips", "presses_a_strip", "presses", "strip_spacing_mm", "press_spacing_mm")
KIT_PAPER, KIT_FILE, MODULI = "kit.pdf", "kit.json", "modulus.csv"


class Like(StrEnum):
    """How the targets are generated."""

    PRINTED = "printed"
    RANDOM = "random"


@app.command(epilog="Example: tsis study new trial --present 3 --blank 1 --repeats 2 --seed 1 --like random")
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
            tsis.present.document.envelope(
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


@app.command(epilog="Example: tsis study show trial")
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
            tsis.present.document.envelope(
                "study show",
                folder=str(folder.resolve()),
                name=plan.name,
                made=plan.made.isoformat(),
                targets=len(plan.codes),
                repeats=plan.repeats,
                probe=plan.probe,
                forces_n=list(plan.forces_n),
                threshold=plan.threshold,
                readings=[_row(*item) for item in study.tally],
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
    columns = ("device", "operator", Column(label="readings"), Column(label="undecided"))
    console.print(rich_table(Table(title="", columns=columns, values=study.tally)))
    if by is not None:
        console.print(
            f"Unblinded {tsis.files.reading.one_line(f'{by.moment} by {by.actor}')}: no more readings are accepted.",
            markup=False,
        )
    elif left:
        code, repeat = left[0]
        console.print(f"Next code: {code}, repeat {repeat}; {len(left)} left of {device or plan.device}.", markup=False)
    else:
        console.print("Every target is read. Next: tsis study analyse", markup=False)
    print_notice(console)


def _row(device: str, operator: str, count: int, undecided: int) -> dict[str, Any]:
    return {"device": device, "operator": operator, "readings": count, "undecided": undecided}


@app.command(epilog="Example: tsis study run trial --operator Ada")
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
            tsis.present.document.envelope(
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


@app.command("import", epilog="Example: tsis study import trial readings.csv --device palpation")
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

    All of them or none. An empty score is an undecided reading; the last three may be empty. Scores that are no
    probabilities need --threshold.
    """
    from tsis.study.folder import open_study
    from tsis.study.readings import import_readings, threshold_note

    study = open_study(folder)
    after = import_readings(study, readings, device=device, threshold=threshold)
    entered = len(after.readings) - len(study.readings)
    if note := threshold_note(after, device):
        typer.echo(note, err=True)
    if as_json:
        entries = {"folder": str(folder.resolve()), "device": device, "threshold": after.threshold_of(device)}
        print_json(tsis.present.document.envelope("study import", **entries, entered=entered, head=after.chain.head))
        return
    console = people()
    console.print(
        f"{entered} readings of {device} entered; threshold {after.threshold_of(device):g}, fixed from now on.",
        markup=False,
    )
    print_notice(console)


@app.command(epilog="Example: tsis study export trial readings.csv")
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
        print_json(tsis.present.document.envelope("study export", file=str(readings.resolve())))
        return
    console = people()
    console.print(f"Readings: {readings.resolve()}", markup=False, soft_wrap=True)
    print_notice(console)


@app.command(epilog="Example: tsis study analyse trial --by Ada --yes")
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
    from tsis.present.study import (
        PAGE,
        device_tables,
        few_notes,
        publish_study,
        record_notes,
        study_document,
        undecided_notes,
    )
    from tsis.study.folder import open_study

    study = open_study(folder)
    if study.unblinded is None:
        if not incomplete:
            study.require_read("read on, or give --incomplete")
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
        console.print(rich_table(next(device_tables(device))))
    for note in (
        *record_notes(result),
        *(note for device in result.devices for note in (*few_notes(device), *undecided_notes(device))),
    ):
        console.print(f"- {note}", markup=False, soft_wrap=True)
    console.print(f"Head with this analysis: {done.study.chain.head}", soft_wrap=True)
    console.print(f"Page: {done.folder / PAGE}", markup=False, soft_wrap=True)
    print_notice(console)


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


@app.command(epilog="Example: tsis study verify trial")
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
    from tsis.present.study import study_verification_document
    from tsis.study.folder import open_study, verify_study

    result = verify_study(folder, head=head)
    if as_json:
        print_json(
            tsis.present.document.envelope(
                "study verify", folder=str(folder.resolve()), **study_verification_document(result)
            )
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


def _publish(document: dict[str, Any], page: Page, out: Path, *, as_json: bool, trusted: bool = True) -> None:
    """Publish a page, also on paper."""
    from tsis.present.pdf import pdf_bytes
    from tsis.present.study import PAPER

    outcome = CommandOutcome(document=document, page=page, files={PAPER: pdf_bytes(page)}, trusted=trusted)
    publish(outcome, out, as_json=as_json)


@app.command(epilog="Example: tsis study repeatability trial --out trial-repeatability")
def repeatability(
    folder: StudyFolder,
    *,
    out: OutFolder = Path("tsis-repeatability"),
    as_json: AsJson = False,
) -> None:
    """Repeatability, reproducibility, limits of agreement, bias and linearity of an unblinded study with repeats.

    Writes index.html, report.pdf and result.json. ISO 5725 and QIBA name the quantities.
    """
    from tsis.present.precision import precision_document, precision_page
    from tsis.study.card import analyse_precision
    from tsis.study.folder import open_study

    analysis = analyse_precision(open_study(folder))
    page = precision_page(analysis)
    _publish(precision_document(analysis), page, out, as_json=as_json)


@app.command(epilog="Example: tsis study size --width 0.2")
def size(
    *,
    width: Annotated[
        float, typer.Option(help="Wanted excess of the upper 95 % limit over the coefficient, a fraction.")
    ] = 0.2,
    operator_sd: Annotated[
        float, typer.Option(help="Expected standard deviation of operators or probes over that of repeats.", min=0.0)
    ] = 0.0,
    interaction_sd: Annotated[
        float, typer.Option(help="Expected standard deviation of their interaction with targets, likewise.", min=0.0)
    ] = 0.0,
    reproducibility: Annotated[
        bool, typer.Option("--reproducibility", help="Reach the width between operators too.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Phantoms, operators and repeats that a study of repeatability needs for a wanted width of its intervals."""
    from tsis.study.precision import study_size

    sizes = [
        study_size(
            width,
            operators=operators,
            repeats=repeats,
            operator_sd=operator_sd,
            interaction_sd=interaction_sd,
            reproducibility_too=reproducibility,
        )
        for operators in OPERATORS
        for repeats in REPEATS
    ]
    table = Table(
        title=f"Upper limit at most {width:.0%} above the coefficient",
        columns=(
            *(Column(label=label) for label in ("operators", "repeats", "phantoms", "presses")),
            *(Column(label=label, form="+.0%") for label in ("repeatability", "reproducibility")),
        ),
        values=tuple(
            (
                *(item.operators, item.repeats),
                *(("none", "") if item.phantoms is None else (item.phantoms, item.presses)),
                *(item.upper_repeatability, item.upper_reproducibility),
            )
            for item in sizes
        ),
    )
    fewest = min((item for item in sizes if item.presses is not None), key=lambda item: item.presses or 0, default=None)
    if fewest is None:
        raise InputError(
            f"--width must be one that {OPERATORS[-1]} operators and 500 phantoms can reach; got {width:g}: widen it, "
            "or leave out --reproducibility"
        )
    show_result(
        CommandResult(
            document=tsis.present.document.envelope(
                "study size",
                width=width,
                operator_sd=operator_sd,
                interaction_sd=interaction_sd,
                reproducibility_too=reproducibility,
                designs=[{name: getattr(item, name) for name in DESIGN} for item in sizes],
            ),
            tables=(table,),
            notes=(
                f"Fewest presses: {fewest.presses}, with {fewest.phantoms} phantoms, {fewest.operators} operators and "
                f"{fewest.repeats} repeats.",
                "Count only phantoms that will be read completely; make more where some will not.",
            ),
        ),
        None,
        as_json=as_json,
    )


OF_REFERENCE_RUN = ("probe", "operator", "repeats", "seed", "strain")  # by which a card makes its own study


@app.command(epilog="Example: tsis study card trial --out trial-card")
def card(
    context: typer.Context,
    folder: StudyFolder,
    *,
    calibration: Annotated[
        Path | None, typer.Option(help="Calibration file of the probe, whose dates the card checks.")
    ] = None,
    device: DeviceName = None,
    probe: ProbeName = "tsis-domed",
    operator: Annotated[
        list[str] | None, typer.Option("--operator", help="Who reads, in turn; repeatable.", show_default="A and B")
    ] = None,
    repeats: Annotated[int, typer.Option(help="Readings of a phantom by an operator.", min=2, max=100)] = 3,
    seed: Annotated[int, typer.Option(help="Seed of the virtual probe.", min=0, max=LARGEST_SEED)] = 1,
    strain: Annotated[str, typer.Option(help="Mechanics of presses and estimates: finite or small.")] = "finite",
    out: OutFolder = Path("tsis-card"),
    as_json: AsJson = False,
) -> None:
    """Write the two-page performance card of a probe: numbers on reference phantoms, checks, dates, versions.

    FOLDER is an unblinded study with repeats (tsis study new --truth, tsis study import). Where there is none, the
    guided run makes it with a virtual probe: seven reference phantoms and two blanks. The exit code is 3 when a check
    fails.
    """
    from tsis.present.precision import card_document, card_page
    from tsis.study.card import performance_card, rehearse_reference_run
    from tsis.study.folder import open_study

    known = None if calibration is None else tsis.calibration.frames.load_calibration(calibration)
    if folder.exists():
        study = open_study(folder)
        if ignored := typed_options(context, OF_REFERENCE_RUN):
            raise InputError(
                f"{' and '.join(ignored)} must be left out for a study that exists, whose readings the card takes as "
                f"they are; got {tsis.files.reading.printable_path(folder)} (name a new folder for another run)"
            )
    else:
        with (
            progress_bar("preparing the probe (cached for next time)") as preparing,
            progress_bar("reading reference phantoms") as advance,
        ):
            study = rehearse_reference_run(
                folder,
                probe=probe,
                operators=operator or ("A", "B"),
                repeats=repeats,
                seed=seed,
                strain=strain,
                preparing=preparing,
                progress=advance,
            )
    now = datetime.now(UTC)
    result = performance_card(study, now=now, device=device, calibration=known)
    page = card_page(result, now=now)
    _publish(card_document(result, now=now), page, out, as_json=as_json, trusted=result.passed)


OF_REHEARSAL, OF_FRAMES = ("ageing", "seed"), ("scale_mm", "temperature_c", "operator")  # of a daily check
PLAN_OF_CHECKS = ("probe", "phantom", "force_n", "baseline", "tolerance")


@app.command(epilog="Example: tsis study check checks --rehearse 10 --baseline 8 --seed 2 --out checks-chart")
def check(
    context: typer.Context,
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the checks; begun where there is none.")],
    *,
    press: Annotated[Path | None, typer.Option(help="Frame of the press on the check phantom.")] = None,
    untouched: Annotated[Path | None, typer.Option(help="Frame of the untouched face, of the same day.")] = None,
    rehearse: Annotated[int, typer.Option(help="Daily checks of the virtual probe to add instead.", min=0)] = 0,
    ageing: Annotated[
        float, typer.Option(help="Fraction of the light that its lamps lose a day after the baseline.")
    ] = 0.002,
    seed: Annotated[int, typer.Option(help="Seed of the rehearsal.", min=0, max=LARGEST_SEED)] = 1,
    temperature_c: Annotated[float | None, typer.Option(help="Temperature of probe and phantom, Celsius.")] = None,
    operator: ByName = "",
    probe: ProbeName = "tsis-2011",
    phantom: PhantomName = "size-8",
    force_n: Annotated[float | None, typer.Option("--force-n", help="Newtons at every check; 1 by default.")] = None,
    scale_mm: Annotated[str | None, typer.Option(help="Millimetres per pixel, one number or x,y.")] = None,
    baseline: Annotated[int, typer.Option(help="First checks, which set the limits.", min=8, max=300)] = 20,
    tolerance: Annotated[float, typer.Option(help="Relative drift at which the probe is out.")] = 0.05,
    out: OutFolder = Path("tsis-checks"),
    as_json: AsJson = False,
) -> None:
    """Add a daily check of the probe on one phantom, and draw the control charts: Shewhart and EWMA limits.

    The exit code is 3 when a rule warns at the last check. Probe, phantom, force, scale, baseline and tolerance are
    those of the first check.
    """
    from tsis.present.daily_checks import drift_document, drift_page
    from tsis.study.drift import (
        CheckPlan,
        add_checks,
        begin_checks,
        daily_check,
        drift_charts,
        read_checks,
        rehearsed_checks,
    )

    if (press is None) != (untouched is None) or (press is not None) == (rehearse > 0):
        raise InputError("a check needs --press and --untouched, the frames of the day, or --rehearse with a number")
    of_others, what = (OF_REHEARSAL, "frames") if press is not None else (OF_FRAMES, "--rehearse")
    if ignored := typed_options(context, of_others):
        raise InputError(f"{' and '.join(ignored)} must be left out with {what}, for which it means nothing")
    log = read_checks(folder) if folder.exists() else None
    force = force_n if force_n is not None else 1.0 if log is None else log.plan.force_n
    plan = CheckPlan(probe=probe, phantom=phantom, force_n=force, baseline=baseline, tolerance=tolerance)
    if log is not None:
        for name in PLAN_OF_CHECKS:
            first, given = getattr(log.plan, name), getattr(plan, name)
            for option in typed_options(context, (name,)) if given != first else ():
                raise InputError(
                    f"{option} must be {first}, as at the first check; got {given} (begin another folder of checks)"
                )
        plan = log.plan
    if press is not None and untouched is not None:
        scale = None if scale_mm is None else scale_of(scale_mm)
        frames = read_frames([press, untouched], [plan.force_n, 0.0], scale)
        done = daily_check(
            *frames,
            force_n=plan.force_n,
            at=datetime.now(UTC),
            operator=operator,
            temperature_c=temperature_c,
        )
        log = add_checks(log or begin_checks(folder, plan), done)
    else:
        log = log or begin_checks(folder, plan)
        with progress_bar("pressing the check phantom") as advance:
            log = add_checks(log, *rehearsed_checks(log, rehearse, seed=seed, ageing=ageing, progress=advance))
    left = log.plan.baseline - len(log.checks)
    if left > 0:
        note = f"Check {len(log.checks)} of the baseline is entered; limits follow after {left} more."
        show_result(CommandResult(document=drift_document(log, ()), notes=(note,)), None, as_json=as_json)
        return
    charts = drift_charts(log)
    page = drift_page(log, charts)
    _publish(drift_document(log, charts), page, out, as_json=as_json, trusted=not any(item.warns for item in charts))


@app.command(epilog="Example: tsis study kit kit")
def kit(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="New folder of the kit.")],
    *,
    as_json: AsJson = False,
) -> None:
    """Write the kit for a first physical validation: moulds, instructions and data sheets, tables to fill in.

    Moulds are STL files in mm. kit.pdf has recipe, phantoms, protocol and sheets; phantoms.csv the phantoms of the
    recipe, to be replaced by measured sizes; modulus.csv takes the bench tests; kit.json the hashes of all.
    """
    from tsis.present.kit import kit_document, kit_page
    from tsis.present.pdf import pdf_bytes
    from tsis.study.kit import kit_files

    files = {**kit_files(), KIT_PAPER: pdf_bytes(kit_page())}
    document = kit_document(files)
    written = tsis.files.result_folder.write_folder(folder, {**files, KIT_FILE: result_bytes(document)})
    if as_json:
        print_json({**document, "folder": str(written)})
        return
    notes = (f"{len(files)} files and their hashes in {KIT_FILE}.", f"Begin with {KIT_PAPER}.")
    print_tables((), notes, where=f"Kit: {written}")


@app.command(epilog="Example: tsis study score bench --study trial --out trial-score")
def score(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the kit, with modulus.csv filled in.")],
    *,
    study: Annotated[Path, typer.Option(help="Folder of the unblinded study.")],
    device: DeviceName = None,
    poisson: Annotated[float, typer.Option(help="Poisson's ratio of the tested materials.")] = 0.49,
    diameter_sd: Annotated[float, typer.Option(help="Standard uncertainty of the sealed diameters, mm.")] = 0.0,
    depth_sd: Annotated[float, typer.Option(help="Standard uncertainty of the sealed depths, mm.")] = 0.0,
    out: OutFolder = Path("tsis-score"),
    as_json: AsJson = False,
) -> None:
    """Score a validation: readings against measured moduli, with intervals that held, bias and detection.

    The bench tests in modulus.csv replace the moduli that were sealed. Writes index.html, report.pdf and result.json.
    """
    from tsis.present.kit import score_document, score_page
    from tsis.study.folder import open_study
    from tsis.study.kit import bench_moduli, score_validation

    of_study = open_study(study)
    moduli = bench_moduli(folder / MODULI, poisson=poisson)
    result = score_validation(of_study, moduli, device=device, diameter_sd_mm=diameter_sd, depth_sd_mm=depth_sd)
    page = score_page(result)
    _publish(score_document(result), page, out, as_json=as_json)


@app.command(epilog="Example: tsis study plan --width-mm 90 --height-mm 60 --overlap 0.5 --out plan")
def plan(
    *,
    width_mm: Annotated[float, typer.Option(help="Width of the area, across the strips, mm.")],
    height_mm: Annotated[float, typer.Option(help="Height of the area, along the strips, mm.")],
    probe: ProbeName = "tsis-domed",
    spacing_mm: Annotated[float | None, typer.Option(help="Largest distance of neighbouring presses, mm.")] = None,
    overlap: Annotated[
        float | None, typer.Option(help="Or by how much of the face's diameter neighbours overlap, 0 to 0.95.")
    ] = None,
    detection_range_mm: Annotated[
        float | None, typer.Option(help="Or the largest distance from the axis at which the inclusion is detected, mm.")
    ] = None,
    detection_range: Annotated[
        Path | None,
        typer.Option(
            help="CSV of diameter_mm, depth_mm, reach_mm: detection range of inclusions. By default the range "
            "measured for this probe on the virtual rig."
        ),
    ] = None,
    diameter_mm: Annotated[
        float | None, typer.Option(help="Or the diameter of the inclusion that must not be missed, mm.")
    ] = None,
    depth_mm: Annotated[float | None, typer.Option(help="With --diameter-mm: its depth, mm.")] = None,
    press_s: Annotated[float, typer.Option(help="Time of one press, settling included, s.")] = 5.0,
    speed_mm_s: Annotated[float, typer.Option(help="Speed of the probe between presses, mm/s.")] = 20.0,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Plan presses over a rectangle, in strips as in palpation, and the smallest inclusion that they do not miss."""
    from tsis.study.search import (
        measured_detection_range,
        read_detection_range,
        scan_plan,
        smallest_found_mm,
        widest_plan,
    )

    sized = diameter_mm is not None or depth_mm is not None
    if sum((spacing_mm is not None, overlap is not None, detection_range_mm is not None, sized)) != 1:
        raise InputError(
            "exactly one of --spacing-mm, --overlap, --detection-range-mm, and --diameter-mm with --depth-mm must be "
            "given"
        )
    table = measured_detection_range(probe) if detection_range is None else read_detection_range(detection_range)
    if sized and (table is None or diameter_mm is None or depth_mm is None):
        raise InputError(
            f"--diameter-mm and --depth-mm must be given together, and with --detection-range where none is known for "
            f"the probe; got the probe {probe!r:.60}"
        )
    if table is not None and diameter_mm is not None and depth_mm is not None:
        detection_range_mm = _range_mm(table, diameter_mm, depth_mm)
    radius = tsis.catalog.load_probe(probe).radius_mm
    if detection_range_mm is not None:
        result = widest_plan(width_mm, height_mm, radius_mm=radius, extent_mm=detection_range_mm)
    else:
        result = scan_plan(width_mm, height_mm, radius_mm=radius, spacing_mm=spacing_mm, overlap=overlap)
    seconds = result.duration_s(press_s=press_s, speed_mm_s=speed_mm_s)
    smallest = {} if table is None else {float(h): smallest_found_mm(result, table, float(h)) for h in table.depth_mm}
    show_result(
        CommandResult(
            document=_plan_document(result, seconds, smallest, table),
            tables=(_plan_table(result, seconds), *_smallest_table(smallest)),
            notes=_plan_notes(table, measured=detection_range is None),
            figures={"plan": partial(_draw_plan, result, detection_range_mm)},
        ),
        out,
        as_json=as_json,
    )


def _range_mm(table: DetectionRangeTable, diameter_mm: float, depth_mm: float) -> float:
    extent = table(diameter_mm, depth_mm)
    if extent == 0:
        raise InputError(
            f"--detection-range must exceed 0 for an inclusion of {diameter_mm:g} mm, {depth_mm:g} mm deep; got 0: "
            "choose a larger or a shallower one"
        )
    return extent


def _plan_document(
    plan: ScanPlan, seconds: float, smallest: dict[float, float | None], table: DetectionRangeTable | None
) -> dict[str, object]:
    return tsis.present.document.envelope(
        "study plan",
        **{name: getattr(plan, name) for name in PLANNED},
        overlap=list(plan.overlap),
        overhang_mm=list(plan.overhang_mm),
        travel_mm=plan.travel_mm,
        duration_s=seconds,
        worst_distance_mm=plan.worst_distance_mm,
        probability=None if table is None else table.probability,
        smallest_found=[{"depth_mm": depth, "diameter_mm": size} for depth, size in smallest.items()],
        positions_mm=plan.positions_mm.tolist(),
    )


def _plan_table(plan: ScanPlan, seconds: float) -> Table:
    span, along = plan.overlap
    rows = (
        ("strips; presses a strip", str(plan.strips), str(plan.presses_a_strip)),
        ("spacing / mm", f"{plan.strip_spacing_mm:.2f}", f"{plan.press_spacing_mm:.2f}"),
        ("overlap of neighbours", f"{span:.0%}", f"{along:.0%}"),
        ("face beyond the area / mm", *(f"{item:.1f}" for item in plan.overhang_mm)),
        ("presses", str(plan.presses), ""),
        ("time", f"{seconds / 60:.1f} min", ""),
        ("farthest from any press / mm", f"{plan.worst_distance_mm:.2f}", ""),
    )
    title = f"{plan.width_mm:g} mm x {plan.height_mm:g} mm, face of {2 * plan.radius_mm:g} mm"
    return Table(title=title, columns=("", "across", "along"), values=rows)


def _smallest_table(smallest: dict[float, float | None]) -> tuple[Table, ...]:
    if not smallest:
        return ()
    columns = (Column(label="depth", unit="mm"), Column(label="diameter", unit="mm", form=".1f"))
    rows = tuple((depth, "none up to 15" if size is None else size) for depth, size in smallest.items())
    return (Table(title="Smallest diameter that is not missed", columns=columns, values=rows),)


def _plan_notes(table: DetectionRangeTable | None, *, measured: bool) -> tuple[str, ...]:
    if table is None:
        return ("The detection between presses is unknown: give --detection-range, a table of detection ranges.",)
    whose = "of this probe on the virtual rig, in uneven tissue, with one false call in ten blanks," if measured else ""
    return (
        f"Not missed means: detected with a probability of at least {table.probability:g} by the nearest press, if "
        f"the table of detection ranges {whose + ' ' if whose else ''}is valid for this tissue.",
    )


def _draw_plan(plan: ScanPlan, detection_range_mm: float | None) -> Figure:
    from matplotlib.figure import Figure

    from tsis.present.figures import draw_scan_plan

    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    ax = draw_scan_plan(plan, figure.subplots(), extent_mm=detection_range_mm)
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8)
    figure.suptitle(f"{plan.presses} presses in {plan.strips} strips. {RESEARCH_USE_ONLY}", fontsize=8)
    return figure

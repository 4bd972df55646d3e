"""``tsis study card`` and ``tsis study check``: what a probe can do on reference phantoms, and whether it drifts."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

import tsis
from tsis.__about__ import LARGEST_SEED
from tsis.cli._options import AsJson, PhantomName, ProbeName, read_frames, scale_of
from tsis.cli._output import CommandOutcome, CommandResult, publish, rich_tables, show_result
from tsis.cli._progress import progress_bar
from tsis.cli.study._new import ByName, StudyFolder
from tsis.errors import InputError

Calibration = Annotated[Path | None, typer.Option(help="Calibration file of the probe, whose dates the card checks.")]


def card(
    folder: StudyFolder,
    *,
    calibration: Calibration = None,
    device: Annotated[str | None, typer.Option(help="Whose readings.", show_default="the first device's")] = None,
    probe: ProbeName = "tsis-domed",
    operator: Annotated[
        list[str] | None, typer.Option("--operator", help="Who reads, in turn; repeatable.", show_default="A and B")
    ] = None,
    repeats: Annotated[int, typer.Option(help="Readings of a phantom by an operator.", min=2, max=100)] = 3,
    seed: Annotated[int, typer.Option(help="Seed of the virtual probe.", min=0, max=LARGEST_SEED)] = 1,
    strain: Annotated[str, typer.Option(help="Mechanics of presses and estimates: finite or small.")] = "finite",
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path("tsis-card"),
    as_json: AsJson = False,
) -> None:
    """Write the two-page performance card of a probe: numbers on reference phantoms, checks, dates, versions.

    FOLDER is an unblinded study with repeats (tsis study new --truth, tsis study import). Where there is none, the
    guided run makes it with a virtual probe: seven reference phantoms and two blanks. The exit code is 3 when a check
    fails.
    """
    from tsis.report.paper import pdf
    from tsis.report.study import PAPER, card_document, card_page
    from tsis.study.card import performance_card, rehearse_reference_run
    from tsis.study.folder import open_study

    known = None if calibration is None else tsis.calibration.read_usable_calibration(calibration)
    if folder.exists():
        study = open_study(folder)
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
    outcome = CommandOutcome(
        document=card_document(result, now=now),
        page=tsis.report.html(page),
        tables=tuple(rich_tables(page.tables)),
        notes=page.notes,
        files={PAPER: pdf(page)},
        trusted=result.passed,
    )
    publish(outcome, out, as_json=as_json)


def check(
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
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path("tsis-checks"),
    as_json: AsJson = False,
) -> None:
    """Add a daily check of the probe on one phantom, and draw the control charts: Shewhart and EWMA limits.

    The exit code is 3 when a rule warns at the last check. Probe, phantom, force, baseline and tolerance are those of
    the first check.
    """
    from tsis.report.paper import pdf
    from tsis.report.study import PAPER, drift_document, drift_notes, drift_page, drift_tables
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
    log = read_checks(folder) if folder.exists() else None
    begun = 1.0 if log is None else log.plan.force_n
    force = begun if force_n is None else force_n
    plan = CheckPlan(probe=probe, phantom=phantom, force_n=force, baseline=baseline, tolerance=tolerance)
    if log is not None and force != begun:
        raise InputError(f"--force-n must be {begun:g}, as at the first check; got {force:g} (newtons)")
    plan = plan if log is None else log.plan
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
    outcome = CommandOutcome(
        document=drift_document(log, charts),
        page=tsis.report.html(page),
        tables=tuple(rich_tables(drift_tables(charts))),
        notes=drift_notes(log, charts),
        files={PAPER: pdf(page)},
        trusted=not any(item.warns for item in charts),
    )
    publish(outcome, out, as_json=as_json)

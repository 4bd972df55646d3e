"""``tsis study repeatability`` and ``tsis study size``: how well readings repeat, and how many show it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

import tsis
from tsis.cli._options import AsJson
from tsis.cli._output import CommandOutcome, CommandResult, publish, rich_tables, show_result
from tsis.cli.study._new import StudyFolder
from tsis.errors import InputError

REPEATS = (2, 3, 5)
OPERATORS = (2, 3, 5, 10, 20)


def repeatability(
    folder: StudyFolder,
    *,
    out: Annotated[Path, typer.Option(help="Folder to write; a number is added when it exists.")] = Path(
        "tsis-repeatability"
    ),
    as_json: AsJson = False,
) -> None:
    """Repeatability, reproducibility, limits of agreement, bias and linearity of an unblinded study with repeats.

    Writes index.html, report.pdf and result.json. ISO 5725 and QIBA name the quantities.
    """
    from tsis.report.paper import pdf
    from tsis.report.study import PAPER, precision_document, precision_notes, precision_page, precision_tables
    from tsis.study.card import analyse_precision
    from tsis.study.folder import open_study

    analysis = analyse_precision(open_study(folder))
    page = precision_page(analysis)
    outcome = CommandOutcome(
        document=precision_document(analysis),
        page=tsis.report.html(page),
        tables=tuple(rich_tables(precision_tables(analysis))),
        notes=precision_notes(analysis),
        files={PAPER: pdf(page)},
    )
    publish(outcome, out, as_json=as_json)


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
    table = Table(title=f"Upper limit at most {width:.0%} above the coefficient")
    for head in ("operators", "repeats", "phantoms", "presses", "repeatability", "reproducibility"):
        table.add_column(head, justify="right")
    for item in sizes:
        counts = ("none", "") if item.phantoms is None else (str(item.phantoms), str(item.presses))
        uppers = (f"+{item.upper_repeatability:.0%}", f"+{item.upper_reproducibility:.0%}")
        table.add_row(str(item.operators), str(item.repeats), *counts, *uppers)
    fewest = min((item for item in sizes if item.presses is not None), key=lambda item: item.presses or 0, default=None)
    if fewest is None:
        raise InputError(
            f"--width must be one that {OPERATORS[-1]} operators and 500 phantoms can reach; got {width:g}: widen it, "
            "or leave out --reproducibility"
        )
    show_result(
        CommandResult(
            document=tsis.report.envelope(
                "study size",
                width=width,
                operator_sd=operator_sd,
                interaction_sd=interaction_sd,
                reproducibility_too=reproducibility,
                designs=[
                    {
                        "operators": item.operators,
                        "repeats": item.repeats,
                        "phantoms": item.phantoms,
                        "presses": item.presses,
                        "upper_repeatability": item.upper_repeatability,
                        "upper_reproducibility": item.upper_reproducibility,
                    }
                    for item in sizes
                ],
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

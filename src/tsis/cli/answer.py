"""What commands that calculate print, and write where a folder is named: tables, notes, figures; JSON for programs."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tsis.cli.console_output import print_found, print_json
from tsis.report import free_folder, write_folder
from tsis.report.document import json_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from matplotlib.figure import Figure
    from rich.table import Table

Out = Annotated[
    Path | None,
    typer.Option(
        "--out", help="Folder for the figures and result.json; a number is added when it exists.", metavar="FOLDER"
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CommandResult:
    """What a command found; a figure is a call that draws it, made only when somebody asked for a folder."""

    document: Mapping[str, Any]
    tables: tuple[Table, ...] = ()
    notes: tuple[str, ...] = ()
    figures: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)


def show_result(answer: CommandResult, out: Path | None, *, as_json: bool) -> None:
    """Write the folder when one is named, and print the answer; its document carries the notes too."""
    document = {**answer.document, "notes": list(answer.notes)}
    folder = None
    if out is not None:
        wanted = free_folder(out)  # refused before anything is drawn
        files = {f"{name}.png": _png(draw()) for name, draw in answer.figures.items()}
        folder = write_folder(wanted, {**files, "result.json": json_bytes(document)})
    if as_json:
        print_json(document if folder is None else {**document, "folder": str(folder)})
        return
    print_found(answer.tables, answer.notes, where="" if folder is None else f"Figures: {folder}")


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150)
    return buffer.getvalue()

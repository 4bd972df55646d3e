"""What commands print: tables and progress for people on a terminal, JSON for programs."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rich.console import Console

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.report import free_folder, write_folder
from tsis.report.document import json_bytes

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path
    from typing import Any

    from rich.table import Table

RESULT = "result.json"


def people() -> Console:
    """Standard output for people."""
    return Console(highlight=False)


def print_json(document: Mapping[str, Any]) -> None:
    """Write a result to standard output, and nothing else there."""
    sys.stdout.write(json_bytes(document).decode())
    sys.stdout.flush()


def print_notice(console: Console) -> None:
    """The sentence that every output carries."""
    console.print(RESEARCH_USE_ONLY, style="bold")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CommandOutcome:
    """What a command found: for programs, for the folder, and for people."""

    document: Mapping[str, Any]
    page: bytes
    tables: tuple[Table, ...]
    notes: tuple[str, ...]
    files: Mapping[str, bytes] = field(default_factory=dict)


def publish(outcome: CommandOutcome, out: Path, *, as_json: bool) -> None:
    """Write the folder ``out`` (or the next free name) and print what is in it."""
    print_outcome(outcome, write_outcome(outcome, out), as_json=as_json)


def write_outcome(outcome: CommandOutcome, out: Path) -> Path:
    """Write the folder ``out`` (or the next free name), whole or not at all; which one it is."""
    files = {**outcome.files, RESULT: json_bytes(outcome.document), "index.html": outcome.page}
    return write_folder(free_folder(out), files)


def print_outcome(outcome: CommandOutcome, folder: Path, *, as_json: bool) -> None:
    """Print what was found, and where it is."""
    if as_json:
        print_json({**outcome.document, "folder": str(folder)})
        return
    print_found(outcome.tables, outcome.notes, where=f"Page: {folder / 'index.html'}")


def print_found(tables: Iterable[Table], notes: Iterable[str], *, where: str = "") -> None:
    """Print tables, notes and where the files are, if any, for people."""
    console = people()
    for table in tables:
        console.print(table)
    for note in notes:
        console.print(f"- {note}", markup=False)
    if where:
        console.print(where, soft_wrap=True, markup=False)
    print_notice(console)

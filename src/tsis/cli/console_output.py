"""What commands print: tables and progress for people on a terminal, JSON for programs."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.report.document import json_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from typing import Any


def people() -> Console:
    """Standard output for people."""
    return Console(highlight=False)


def print_json(document: Mapping[str, Any]) -> None:
    """Write a result to standard output, and nothing else there."""
    sys.stdout.write(json_bytes(document).decode())


def print_notice(console: Console) -> None:
    """The sentence that every output carries."""
    console.print(RESEARCH_USE_ONLY, style="bold")


@contextmanager
def progress_bar(description: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error, given (done, total); it appears with the first call and leaves nothing behind."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(description, total=None, visible=False)

        def advance(done: int, total: int) -> None:
            progress.update(task, completed=done, total=total, visible=True)

        yield advance

"""What is written on standard error while a command runs."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from tsis.cli._exit_codes import INTERRUPTED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@dataclass(slots=True)
class Verbosity:
    """How much the program writes on standard error."""

    quiet: bool = False
    verbose: bool = False


verbosity = Verbosity()


def stop_interrupted(message: str) -> NoReturn:
    """End the program after Ctrl-C with this one line on standard error, instead of the general one."""
    sys.stderr.write(f"Interrupted{message}\n")
    sys.exit(INTERRUPTED)


@contextmanager
def progress_bar(description: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error, called with (done, total); it appears with the first call, on terminals only."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal or verbosity.quiet
    ) as progress:
        task = progress.add_task(description, total=None, visible=False)

        def advance(done: int, total: int) -> None:
            progress.update(task, completed=done, total=total, visible=True)

        yield advance


@contextmanager
def waiting(description: str) -> Iterator[None]:
    """A spinner on standard error, on terminals only."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal or verbosity.quiet:
        yield
        return
    with console.status(description):
        yield

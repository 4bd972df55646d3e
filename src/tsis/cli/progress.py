"""What standard error says while a command runs."""

from __future__ import annotations

import signal
import sys
import threading
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from tsis.errors import (
    CalibrationError,
    InputError,
    MechanicsError,
    MissingExtraError,
    NotCalibratedError,
    NotIdentifiedError,
    TsisError,
    UntrustedError,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType


FAILED = 1  # a camera, a store or a check failed; one message says why
BAD_INPUT = 2  # one message says what was wrong
WITHHELD = 3  # the result must not be trusted, or the calculation was refused
INTERRUPTED = 130  # Ctrl-C, as shells have it
REFUSALS = (NotCalibratedError, UntrustedError, NotIdentifiedError, CalibrationError, MechanicsError)


@dataclass(slots=True)
class Verbosity:
    """How much the program writes on standard error."""

    quiet: bool = False
    verbose: bool = False


verbosity = Verbosity()


def exit_code_of(error: TsisError) -> int:
    """The exit code of a command that ends with this error."""
    if isinstance(error, (InputError, MissingExtraError)):
        return BAD_INPUT
    return WITHHELD if isinstance(error, REFUSALS) else FAILED


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


@contextmanager
def ended_by(*numbers: signal.Signals) -> Iterator[threading.Event]:
    """An event that these signals set inside the block; the old handlers return after it."""
    ended = threading.Event()

    def end(_number: int, _frame: FrameType | None) -> None:
        ended.set()

    before = {number: signal.signal(number, end) for number in numbers}
    try:
        yield ended
    finally:
        for number, action in before.items():
            signal.signal(number, action)

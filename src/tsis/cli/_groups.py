"""A group of commands with a default command."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from typer.core import TyperGroup

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType


class DefaultCommand(TyperGroup):
    """Commands with a default: ``tsis match A B`` runs ``tsis match points A B``."""

    default = ""
    is_default = True  # whether an empty command line runs it, instead of showing help

    @classmethod
    def named(cls, default: str, *, is_default: bool = True) -> type[DefaultCommand]:
        """The group with that default."""
        return type("DefaultCommand", (cls,), {"default": default, "is_default": is_default})

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert the default command before arguments that begin with no command."""
        if not args and not self.is_default:
            args = ["--help"]
        if not args or args[0] not in (*self.commands, "-h", "--help"):
            args = [self.default, *args]
        return super().parse_args(ctx, args)


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

"""Ctrl-C as an end in order, for commands that run until somebody ends them."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType


@contextmanager
def ended_by(*numbers: signal.Signals) -> Iterator[threading.Event]:
    """An event that these signals set inside the block, in place of what they did before."""
    ended = threading.Event()

    def end(_number: int, _frame: FrameType | None) -> None:
        ended.set()

    before = {number: signal.signal(number, end) for number in numbers}
    try:
        yield ended
    finally:
        for number, action in before.items():
            signal.signal(number, action)

"""Waiting for what another thread or process does, however busy the machine is."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

HANGS_S = 240.0  # a wait of this length is a hang


def until(happened: Callable[[], bool]) -> None:
    """Wait for something that another thread does."""
    pause = threading.Event()
    for _ in range(int(HANGS_S / 0.005)):
        if happened():
            return
        pause.wait(0.005)
    raise AssertionError("it did not happen")

"""A button that turns while what it began is under way, and cannot be clicked meanwhile."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nicegui import ui


@contextmanager
def loading(button: ui.button) -> Iterator[None]:
    """Have a button turn until this is over, however it ends."""
    button.props(add="loading")
    try:
        yield
    finally:
        button.props(remove="loading")

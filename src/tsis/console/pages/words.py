"""What every page says in the same words: a force, a time, a press."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.records.values import ROLE_WORDS
from tsis.report.target_words import time_text

if TYPE_CHECKING:
    from datetime import datetime

    from tsis.records import StoredPress


def force_words(force_n: float | None) -> str:
    """A force, also one that nobody knows.

    Examples
    --------
    >>> force_words(0.7), force_words(None)
    ('0.7 N', 'force not measured')
    """
    return "force not measured" if force_n is None else f"{force_n:.3g} N"


def time_words(when: datetime) -> str:
    """A time where nothing else says that it is in UTC."""
    return f"{time_text(when)} UTC"


def press_words(press: StoredPress) -> str:
    """A press: what was pressed, how hard, when."""
    return f"{ROLE_WORDS[press.role]}, {force_words(press.force_n)}, {time_words(press.taken)}"

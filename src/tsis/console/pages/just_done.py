"""What was just done is not shown undone: the state that all pages share may be a moment old."""

from __future__ import annotations

PATIENT = 2  # states that may still be from before


class JustDone:
    """Remembers the value that was replaced.

    Examples
    --------
    >>> last = JustDone()
    >>> last.replaced(1)
    >>> last.is_old(1), last.is_old(1), last.is_old(1)
    (True, True, False)
    >>> last.replaced(1)
    >>> last.is_old(2), last.is_old(1)
    (False, False)
    """

    def __init__(self) -> None:
        self._before: object = None
        self._left = 0

    def replaced(self, before: object) -> None:
        """Take note that this value was replaced now."""
        self._before, self._left = before, PATIENT

    def is_old(self, value: object) -> bool:
        """Whether a state with this value is probably from before; at most `PATIENT` times in a row."""
        if self._left and value == self._before:
            self._left -= 1
            return True
        self._left = 0
        return False

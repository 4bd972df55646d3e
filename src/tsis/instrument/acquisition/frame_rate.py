"""How many frames a second really come."""

from __future__ import annotations

from collections import deque

from tsis.model.check import require_number


class FrameRate:
    """Rate over the last seconds, from the times at which frames came; never the nominal one.

    Parameters
    ----------
    window_s
        Over how long, s, in [0.01, 3600].

    Examples
    --------
    >>> rate = FrameRate()
    >>> for number in range(60):
    ...     rate.add(number / 30)
    >>> round(rate.per_s(59 / 30), 6)
    30.0
    >>> rate.per_s(4.0)  # two seconds without frames
    0.0
    """

    def __init__(self, window_s: float = 2.0) -> None:
        self._window_s = require_number("window_s", window_s, 0.01, 3600.0, hint="seconds")
        self._times_s: deque[float] = deque()

    def add(self, time_s: float) -> None:
        """Note that a frame came."""
        self._times_s.append(time_s)
        self._forget(time_s)

    def per_s(self, now_s: float) -> float:
        """Frames a second in the window that ends now; 0 where fewer than two came."""
        self._forget(now_s)
        if len(self._times_s) < 2:
            return 0.0
        intervals = len(self._times_s) - 1
        spanned = self._times_s[-1] - self._times_s[0]
        # A frame that is overdue counts against the rate before the window forgets the last ones.
        overdue = now_s - self._times_s[-1]
        waited = overdue if overdue > 2 * spanned / intervals else 0.0
        return intervals / (spanned + waited) if spanned + waited > 0 else 0.0

    def _forget(self, now_s: float) -> None:
        while self._times_s and now_s - self._times_s[0] > self._window_s:
            self._times_s.popleft()

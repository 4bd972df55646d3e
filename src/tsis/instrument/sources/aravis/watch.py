"""How long a reader waits for a frame before it calls the camera lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.instrument.patience import LATE_FRAMES, SILENT_S

if TYPE_CHECKING:
    from collections.abc import Callable

TORN_S = 10.0  # with parts of frames alone


class Watch:
    """Started whenever a reader begins to wait, so that time which the reader spends elsewhere does not count.

    Parameters
    ----------
    clock
        Seconds, monotonic.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._began_s = self._heard_s = clock()
        self._torn = 0

    def reason(self, *, heard: bool, period_s: float = 0.0) -> str | None:
        """Why to give up, if so.

        Parameters
        ----------
        heard
            Whether a part of a frame came, but no whole one.
        period_s
            How long a frame takes with the present settings, seconds.
        """
        now_s = self._clock()
        if heard:
            self._heard_s, self._torn = now_s, self._torn + 1
        silent_s = max(SILENT_S, LATE_FRAMES * period_s)
        if now_s - self._heard_s >= silent_s:
            return f"nothing came for {silent_s:g} s"
        if now_s - self._began_s >= max(TORN_S, silent_s) and self._torn:
            return f"in {now_s - self._began_s:.0f} s came parts of {self._torn} frames and no whole one"
        return None

"""How long a reader waits for a frame before it calls the camera lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

SILENT_S = 1.0  # without any part of a frame
PERIODS = 3.0  # of a slow camera that may pass in silence
TORN_S = 10.0  # with parts of frames alone


class Watch:
    """Started whenever a reader begins to wait, so that time which the reader spends elsewhere does not count.

    Parameters
    ----------
    clock
        Seconds, monotonic.
    frames_per_s
        Rate of the camera; None when it tells none.
    """

    def __init__(self, clock: Callable[[], float], frames_per_s: float | None) -> None:
        self._clock = clock
        self._silent_s = SILENT_S if frames_per_s is None else max(SILENT_S, PERIODS / frames_per_s)
        self._began_s = self._heard_s = clock()
        self._torn = 0

    def reason(self, *, heard: bool) -> str | None:
        """Why to give up, if so; ``heard`` tells that a part of a frame came, but no whole one."""
        now_s = self._clock()
        if heard:
            self._heard_s, self._torn = now_s, self._torn + 1
        if now_s - self._heard_s >= self._silent_s:
            return f"nothing came for {self._silent_s:g} s"
        if now_s - self._began_s >= max(TORN_S, self._silent_s) and self._torn:
            return f"in {now_s - self._began_s:.0f} s came parts of {self._torn} frames and no whole one"
        return None

"""The camera's settings as they are, read in a thread: drivers take their time, and people change them elsewhere."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

from tsis.model.errors import TsisError
from tsis.virtual.camera import FORCE

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.instrument import Setting
    from tsis.instrument.acquisition import Acquisition

EVERY_S = 1.0
LOOK_S = 1.0  # that a look waits for another one, which may be stuck in a driver


class SettingsSeen:
    """Knows what can be adjusted now, without asking the camera each time that somebody wants to know.

    The force of the virtual probe is left out: no camera has such a setting.

    Parameters
    ----------
    acquisition
        Gives the running acquisition; None while there is none.
    changed
        Called when a setting has another value than at the last look.
    every_s
        Time between two looks, s.
    """

    def __init__(
        self, acquisition: Callable[[], Acquisition | None], changed: Callable[[], None], *, every_s: float = EVERY_S
    ) -> None:
        self._acquisition, self._changed, self._every_s = acquisition, changed, every_s
        self._one_look = threading.Lock()
        self._seen: tuple[Acquisition | None, tuple[Setting, ...]] = (None, ())
        self._values: dict[str, float] = {}
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="settings of the camera", daemon=True)
        self._thread.start()

    def now(self) -> tuple[Setting, ...]:
        """What can be adjusted; empty while the camera is stopped or away. It never waits."""
        acquisition = self._acquisition()
        of, settings = self._seen
        return settings if acquisition is not None and acquisition is of and not acquisition.lost else ()

    def look(self) -> None:
        """Ask the camera now."""
        if not self._one_look.acquire(timeout=LOOK_S):
            return
        try:
            acquisition = self._acquisition()
            if acquisition is None or acquisition.lost:
                return
            settings = tuple(each for each in acquisition.settings() if each.name != FORCE)
            values = {each.name: each.value for each in settings}
            differ = acquisition is self._seen[0] and values != self._values
            self._seen, self._values = (acquisition, settings), values
        except TsisError:  # it went this moment
            return
        finally:
            self._one_look.release()
        if differ:
            self._changed()

    def close(self) -> None:
        """End the thread; one that is stuck in a driver is left behind."""
        self._closing.set()
        self._thread.join(timeout=1.0)

    def _run(self) -> None:
        while not self._closing.wait(self._every_s):
            self.look()

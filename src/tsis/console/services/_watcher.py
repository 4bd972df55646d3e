"""Analysis of the newest frame a few times a second, for all clients."""

from __future__ import annotations

import logging
import threading
import time
from typing import TYPE_CHECKING

from tsis.calibration.guard import FrameShape, PressWatch, WatchState
from tsis.console.services._frame_analysis import analyse_frame, reduced
from tsis.errors import TsisError

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from tsis.calibration.guard import GuardReference
    from tsis.console.services._frame_analysis import FrameAnalysis
    from tsis.console.services._subject import PressForce
    from tsis.instrument.acquisition import Acquisition, ReceivedFrame


EVERY_S = 0.15  # often enough for the eye, and a small part of a core
WAIT_S = 0.25
_log = logging.getLogger(__name__)


class Watcher:
    """A thread that analyses frames until it is closed.

    ``acquisition`` gives the running acquisition, ``reference`` the press guard's reference and its scale (x, y) in mm
    per pixel, ``force`` the force at a frame; acquisition, scale and force may be None. ``gel`` analyses a frame of
    a gel sensor, with its number and force, and returns None where there is no such sensor.
    """

    def __init__(
        self,
        acquisition: Callable[[], Acquisition | None],
        reference: Callable[[], tuple[GuardReference, tuple[float, float] | None]],
        force: Callable[[ReceivedFrame], PressForce | None],
        gel: Callable[[ReceivedFrame, int, PressForce | None], FrameAnalysis | None] = lambda *_: None,
    ) -> None:
        self._acquisition, self._reference, self._force, self._gel = acquisition, reference, force, gel
        self.frame_analysis: FrameAnalysis | None = None  # of the newest frame
        self.failure = ""  # why frames cannot be analysed
        self._anew, self._closing = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="watcher of presses", daemon=True)
        self._thread.start()

    def begin_anew(self) -> None:
        """Forget the press so far: camera, calibration or what is pressed has changed."""
        self._anew.set()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        watch: PressWatch | None = None
        state, untouched, position = WatchState(), None, 0
        followed: Acquisition | None = None
        spent_s = 0.0
        while not self._closing.wait(max(EVERY_S, spent_s)):  # half of a core at most
            acquisition = self._acquisition()
            away = acquisition is not None and (acquisition.lost or acquisition.ended)
            if acquisition is not followed or away or self._anew.is_set():
                self._anew.clear()
                followed, watch, state, position = acquisition, None, WatchState(), 0
                self.frame_analysis, self.failure = None, ""
            if acquisition is not None and away:
                position = acquisition.ring.end  # earlier frames are of a press before the interruption
                continue
            if acquisition is None or not acquisition.ring.wait(position, WAIT_S):
                continue
            received, position = acquisition.latest(), acquisition.ring.end
            if received is None:
                continue
            begun_s = time.monotonic()
            try:
                force = self._force(received)
                analysis = self._gel(received, position, force)
                if analysis is None:
                    if watch is None:
                        watch, untouched = self._guard(received)
                    analysis, state = analyse_frame(
                        watch, state, received.frame, number=position, force=force, untouched=untouched
                    )
                self.frame_analysis, self.failure = analysis, ""
            except TsisError as error:  # e.g. a calibration of another size; the live view goes on without flags
                self.frame_analysis, self.failure = None, str(error)
            except Exception as error:
                self._fail(error)
            spent_s = time.monotonic() - begun_s

    def _fail(self, error: Exception) -> None:
        """Go on with the live view, and log the error once."""
        message = f"frames cannot be judged because of an unexpected error: {type(error).__name__}: {error}"
        if message != self.failure:
            _log.exception("a frame could not be judged")
        self.frame_analysis, self.failure = None, message

    def _guard(self, frame: ReceivedFrame) -> tuple[PressWatch, NDArray[np.float64] | None]:
        reference, scale = self._reference()
        shape = FrameShape.of(frame.frame.tactile_image(mm_per_pixel=scale))
        given = reference.untouched
        return PressWatch(shape, reference=reference), None if given is None else reduced(given.grey)

"""Calibration frames from running hardware: camera frames with the gauge's force."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.calibration.session._folder import CalibrationFrame
from tsis.errors import CameraError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.instrument.acquisition import Acquisition, ReceivedFrame
    from tsis.instrument.gauge import ForceLog


TIMEOUT_S = 5.0
FORCE_S = 1.0  # longest wait for the reading after a frame


class LiveCalibration:
    """Takes calibration frames from a running acquisition.

    Parameters
    ----------
    acquisition
        Running.
    log
        Readings of the gauge, if any.
    """

    def __init__(self, acquisition: Acquisition, log: ForceLog | None = None) -> None:
        self._acquisition, self._log = acquisition, log

    def still(self, frames: int) -> Iterator[CalibrationFrame]:
        """Yield the next frames, all taken after the call; `CameraError` when no frame arrives for 5 s."""
        for _, received in zip(range(frames), self._fresh(), strict=False):
            yield CalibrationFrame(image=received.frame.tactile_image(), time_s=received.arrived_s)

    def loading(self, over: Callable[[], bool], *, every_s: float = 0.5) -> Iterator[CalibrationFrame]:
        """Yield a frame with its force every ``every_s`` seconds until ``over`` is true.

        Raises `CameraError` when no frame arrives for 5 s; `GaugeError` when the gauge stops sending.
        """
        assert self._log is not None  # without a gauge use `take_frame`
        last_s = float("-inf")
        for received in self._fresh():
            if over():
                return
            if received.arrived_s - last_s >= every_s:
                last_s = received.arrived_s
                self._log.wait_until(last_s, timeout_s=FORCE_S)
                force = self._log.at(last_s).force_n
                yield CalibrationFrame(image=received.frame.tactile_image(), time_s=last_s, force_n=force)

    def take_frame(self, force_n: float) -> CalibrationFrame:
        """The next frame, with a force that the user entered."""
        received = next(self._fresh())
        return CalibrationFrame(image=received.frame.tactile_image(), time_s=received.arrived_s, force_n=force_n)

    def _fresh(self) -> Iterator[ReceivedFrame]:
        ring = self._acquisition.ring
        position = ring.end
        while True:
            if not ring.wait(position, TIMEOUT_S):
                why = f": {self._acquisition.failure}" if self._acquisition.failure is not None else ""
                raise CameraError(f"{self._acquisition.name} must bring frames; none came for {TIMEOUT_S:g} s{why}")
            arrivals, position, _ = ring.read(position)
            yield from arrivals

"""Cameras through Aravis, and the time that a reader waits before a camera counts as lost."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tsis.errors import CameraError
from tsis.instrument._camera import SILENT_S, Frame, checked_setting, silence_timeout_s
from tsis.instrument.drivers._frame_numbers import BlockCount
from tsis.instrument.drivers.aravis import _features as features
from tsis.instrument.drivers.aravis._connection import Connection, Stream
from tsis.instrument.drivers.aravis._library import load
from tsis.model.require import require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from numpy.typing import NDArray

    from tsis.instrument._camera import Mode, Setting
    from tsis.instrument.drivers.aravis._connection import ReceivedBuffer
    from tsis.instrument.drivers.aravis._library import Aravis


TORN_S = 10.0  # with incomplete frames only


class Watch:
    """Started whenever a reader begins to wait, so that the reader's own time does not count."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._began_s = self._heard_s = clock()
        self._torn = 0

    def reason(self, *, heard: bool, silent_s: float = SILENT_S) -> str | None:
        """Why the camera counts as lost; None if it does not. An incomplete frame counts as ``heard``."""
        now_s = self._clock()
        if heard:
            self._heard_s, self._torn = now_s, self._torn + 1
        if now_s - self._heard_s >= silent_s:
            return f"nothing came for {silent_s:g} s"
        if now_s - self._began_s >= max(TORN_S, silent_s) and self._torn:
            return f"in {now_s - self._began_s:.0f} s came parts of {self._torn} frames and no whole one"
        return None


POLL_S = 0.05  # a reader notices stop() within it
RELEASE_S = 0.5  # time limit of stop() for the release of a camera


@dataclass(slots=True, eq=False)
class _Reading:
    """State of one reader of frames."""

    blocks: BlockCount = field(default_factory=BlockCount)
    first_ns: int | None = None
    delivered: int = 0


class AravisCamera:
    """A camera that Aravis finds over the network or USB 3.

    The camera's automatic exposure and gain are switched off at the start, so that each frame records its settings; a
    change applies to the frames that arrive after it. Incomplete frames are dropped and leave a gap in the sequence.
    Raises `InputError` when the identity is not a text.

    Parameters
    ----------
    identity
        Its name from the search, or its network address; None takes the first camera that answers.
    library
        Returns the library.
    clock
        Seconds, monotonic.

    Examples
    --------
    >>> AravisCamera("Basler-acA1300-22334455").name
    'Basler-acA1300-22334455'
    """

    def __init__(
        self,
        identity: str | None = None,
        *,
        library: Callable[[], Aravis] = load,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if identity is not None:
            require_type("identity", identity, str)
        self._identity = identity or None
        self._library, self._clock = library, clock
        self._connection: Connection | None = None
        self._stream: Stream | None = None
        self._mode: Mode | None = None
        self._taken: list[tuple[int, Mapping[str, float]]] = []  # settings, each with the start of its validity
        self._running = threading.Event()
        self._controlling, self._popping = threading.RLock(), threading.Lock()
        self._lost = False

    @property
    def name(self) -> str:
        """Display name."""
        return self._identity or "the first camera of Aravis"

    @property
    def lost(self) -> bool:
        """True when frames ended before the camera was stopped."""
        return self._lost

    def open(self) -> None:
        """Connect to the camera with a new handle.

        Raises `MissingExtraError` when Aravis is not installed; `CameraError` when no camera of this identity answers,
        or another program uses it.
        """
        self.stop()
        self._connection = Connection.open(self._library(), self._identity)
        self._identity = self._connection.identity  # the same camera at the next open
        self._lost = False

    def modes(self) -> tuple[Mode, ...]:
        """Present size and whole sensor in each grey format, the present one first."""
        with self._controlling:
            connection = self._opened()
            return features.modes(connection.aravis, connection.camera)

    def settings(self) -> tuple[Setting, ...]:
        """Exposure in ms, gain, brightness (black level) and frame rate, where the camera has them."""
        with self._controlling:
            connection = self._opened()
            return features.settings(connection.aravis, connection.camera)

    def adjust(self, name: str, value: float) -> None:
        """Change one of `settings`; the camera may round the value.

        Raises `UnknownNameError` when there is no such setting; `InputError` when the value lies outside its range;
        `CameraError` when the camera does not take it.
        """
        with self._controlling:
            connection = self._opened()
            requested = checked_setting(self.settings(), name, value, camera=self.name)
            features.adjust(connection.aravis, connection.camera, name, requested)
            if self._running.is_set():
                self._taken = [*self._taken[-1:], (time.time_ns(), features.values(self.settings()))]

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames in ``mode``, or in the present one.

        Raises `CameraError` when the camera has no such mode, or does not start.
        """
        with self._controlling:
            connection = self._opened()
            if self._running.is_set():
                raise CameraError(f"{self.name} runs already; call stop() and open() before another start()")
            chosen = features.offered(mode, self.modes(), self.name)
            aravis, camera = connection.aravis, connection.camera
            features.choose(aravis, camera, chosen)
            self._stream = connection.stream = Stream(aravis, camera, chosen)
            self._mode, self._taken = chosen, [(0, features.values(self.settings()))]
            aravis.call("camera_start_acquisition", camera)
            self._running.set()

    def frames(self) -> Iterator[Frame]:
        """Yield complete frames on arrival, until the camera is stopped.

        Raises `CameraError` when the camera is silent for a second (three frame times of a slow one), or sends only
        incomplete frames for ten; frames already yielded stay valid.
        """
        if not self._running.is_set():
            raise CameraError(f"{self.name} must be started before frames are read; call start()")
        reading = _Reading()
        while (frame := self._awaited(reading)) is not None:
            yield frame
            reading.delivered += 1

    def stop(self) -> None:
        """End the stream and release the camera."""
        self._running.clear()
        with self._controlling, self._popping:
            connection, self._connection, self._stream = self._connection, None, None
        if connection is not None:
            # a lost camera does not answer, and its driver waits for answers
            connection.close(wait_s=0.0 if self._lost else RELEASE_S)

    def _awaited(self, reading: _Reading) -> Frame | None:
        """The next complete frame; None once the camera is stopped."""
        watch = Watch(self._clock)
        while self._running.is_set():
            heard, frame = self._popped(reading)
            if frame is not None:
                return frame
            reason = watch.reason(heard=heard, silent_s=silence_timeout_s(self._taken[-1][1]))
            if reason and self._running.is_set():
                name, self._lost = self.name, True
                self.stop()
                raise CameraError(
                    f"{name} was lost after {reading.delivered} frames: {reason}; check its cable and open it again"
                )
        return None

    def _popped(self, reading: _Reading) -> tuple[bool, Frame | None]:
        """Whether anything arrived within a short time, and the frame if it is complete."""
        with self._popping:
            if self._stream is None:
                return False, None
            with self._stream.next(POLL_S) as received:
                if received is None:
                    return False, None
                if received.pixels is None:
                    reading.blocks.begin(received.number)
                    return True, None
                return True, self._frame(received, received.pixels, reading)

    def _frame(self, received_buffer: ReceivedBuffer, pixels: NDArray[Any], reading: _Reading) -> Frame:
        """The frame of a complete arrival, with a copy of its pixels."""
        if reading.first_ns is None:
            reading.first_ns = received_buffer.device_ns
        sequence = reading.blocks.at(received_buffer.number)
        return Frame(
            pixels=pixels,
            sequence=sequence,
            time_s=(received_buffer.device_ns - reading.first_ns) / 1e9,
            full_scale=255.0 if self._mode is None else self._mode.full_scale,
            name=f"{self.name}#{sequence}",
            settings=next(taken for since_ns, taken in reversed(self._taken) if since_ns <= received_buffer.arrived_ns),
        )

    def _opened(self) -> Connection:
        if self._connection is None:
            raise CameraError(f"{self.name} must be opened first; call open()")
        return self._connection

"""Buffers that travel between Aravis and the reader of a camera."""

from __future__ import annotations

import ctypes
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from tsis.instrument.camera import Mode
    from tsis.instrument.sources.aravis.library import Aravis

BUFFERS = 16  # half a second of 30 frames/s that a reader may be late
BACKLOG, MOST_BACKLOG_BYTES = 4, 2**26  # frames that wait in the system; it may grant less
WHOLE = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReceivedBuffer:
    """One buffer as it came; ``pixels`` is a view that ends with the buffer's loan, None when not all of it arrived."""

    number: int
    device_ns: int
    arrived_ns: int
    pixels: NDArray[Any] | None


class Stream:
    """A stream of a camera with its buffers.

    Parameters
    ----------
    aravis
        The library.
    camera
        Handle of a camera that is in the mode wanted.
    mode
        That mode.

    Raises
    ------
    CameraError
        When the camera gives no stream.
    """

    def __init__(self, aravis: Aravis, camera: int, mode: Mode) -> None:
        self._aravis = aravis
        self._shape = (mode.height_px, mode.width_px)
        self._dtype = np.dtype("u1" if mode.full_scale <= 255 else "<u2")
        self._bytes = int(np.prod(self._shape)) * self._dtype.itemsize
        payload = max(aravis.call("camera_get_payload", camera), self._bytes)
        self.handle: int = aravis.call("camera_create_stream", camera, None, None)
        if aravis.call("camera_is_gv_device", camera):
            # the system's default holds a fraction of a frame, and a camera sends a whole one at once
            aravis.set_whole(self.handle, "socket-buffer-size", min(BACKLOG * payload, MOST_BACKLOG_BYTES))
        for _ in range(BUFFERS):
            aravis.call("stream_push_buffer", self.handle, aravis.call("buffer_new_allocate", payload))

    @contextmanager
    def next(self, timeout_s: float) -> Iterator[ReceivedBuffer | None]:
        """Lend the next buffer; None when none came in time."""
        buffer = self._aravis.call("stream_timeout_pop_buffer", self.handle, round(1e6 * timeout_s))
        if not buffer:
            yield None
            return
        try:
            yield ReceivedBuffer(
                number=self._of(buffer, "frame_id"),
                device_ns=self._of(buffer, "timestamp"),
                arrived_ns=self._of(buffer, "system_timestamp"),
                pixels=self._pixels(buffer),
            )
        finally:
            self._aravis.call("stream_push_buffer", self.handle, buffer)

    def _of(self, buffer: int, what: str) -> int:
        return int(self._aravis.call(f"buffer_get_{what}", buffer))

    def _pixels(self, buffer: int) -> NDArray[Any] | None:
        if self._of(buffer, "status") != WHOLE:
            return None
        if (self._of(buffer, "image_height"), self._of(buffer, "image_width")) != self._shape:
            return None  # of the mode before
        size = ctypes.c_size_t()
        data = self._aravis.call("buffer_get_data", buffer, ctypes.byref(size))
        if not data or size.value < self._bytes:
            return None
        lent = (ctypes.c_ubyte * self._bytes).from_address(data)
        return np.ctypeslib.as_array(lent).view(self._dtype).reshape(self._shape)

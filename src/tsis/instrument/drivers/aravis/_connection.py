"""The connection to a camera through Aravis, and the buffers of its stream."""

from __future__ import annotations

import ctypes
import ipaddress
import threading
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import CameraError, MissingExtraError
from tsis.instrument._discovery import CameraInfo
from tsis.instrument.drivers.aravis._library import load

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from typing import Self

    from numpy.typing import NDArray

    from tsis.instrument._camera import Mode
    from tsis.instrument.drivers.aravis._library import Aravis


SOURCE = "aravis"
_the_list = threading.Lock()  # the library has one list, whose entries are read one by one


def missing_requirement(library: Callable[[], Aravis] = load) -> str | None:
    """What is not installed, with the cure; None when cameras can be searched."""
    try:
        library()
    except MissingExtraError as error:
        return str(error)
    return None


def find_cameras_here(library: Callable[[], Aravis] = load) -> tuple[CameraInfo, ...]:
    """Cameras that answer now, by name; the search takes about a second.

    Raises `MissingExtraError` when Aravis is not installed.
    """
    return tuple(camera for camera, _ in search(library()))


def search(aravis: Aravis) -> list[tuple[CameraInfo, str]]:
    """Cameras that answer now, each with its address."""
    with _the_list:
        aravis.call("update_device_list")
        indices = range(aravis.call("get_n_devices"))
        cameras = [(_described(aravis, index), aravis.text("get_device_address", index)) for index in indices]
    return sorted(cameras, key=lambda camera: camera[0].identity)


def _described(aravis: Aravis, index: int) -> CameraInfo:
    protocol, address = (aravis.text(f"get_device_{what}", index) for what in ("protocol", "address"))
    return CameraInfo(
        source=SOURCE,
        identity=aravis.text("get_device_id", index),
        maker=aravis.text("get_device_vendor", index),
        model=aravis.text("get_device_model", index),
        note=f"{protocol} at {address}" if address else protocol,
    )


BUFFERS = 16  # half a second of delay at 30 frames/s
BACKLOG, MOST_BACKLOG_BYTES = 4, 2**26  # frames in the system's socket buffer; it may grant less
WHOLE = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReceivedBuffer:
    """One buffer on arrival; ``pixels`` is a view while the buffer is borrowed, None when it is incomplete."""

    number: int
    device_ns: int
    arrived_ns: int
    pixels: NDArray[Any] | None


class Stream:
    """A stream of a camera in that mode, with its buffers; `CameraError` when the camera provides none."""

    def __init__(self, aravis: Aravis, camera: int, mode: Mode) -> None:
        self._aravis = aravis
        self._shape = (mode.height_px, mode.width_px)
        self._dtype = np.dtype("u1" if mode.full_scale <= 255 else "<u2")
        self._bytes = int(np.prod(self._shape)) * self._dtype.itemsize
        payload = max(aravis.call("camera_get_payload", camera), self._bytes)
        self.handle: int = aravis.call("camera_create_stream", camera, None, None)
        if aravis.call("camera_is_gv_device", camera):
            # the system's default is a fraction of a frame, and a camera sends a complete one at once
            aravis.set_whole(self.handle, "socket-buffer-size", min(BACKLOG * payload, MOST_BACKLOG_BYTES))
        for _ in range(BUFFERS):
            aravis.call("stream_push_buffer", self.handle, aravis.call("buffer_new_allocate", payload))

    @contextmanager
    def next(self, timeout_s: float) -> Iterator[ReceivedBuffer | None]:
        """Borrow the next buffer; None when none arrived in time."""
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


HELD_S, AGAIN_S = 4.0, 0.25  # a program that died holds a camera until its heartbeat ends, by default after 3 s
CONTROLLER_ADDRESS = 0x0A14  # GigE Vision's register of the controller's network address; 0 where not stored


@dataclass(slots=True, kw_only=True, eq=False)
class Connection:
    """Handles of one camera, released together."""

    aravis: Aravis
    camera: int
    identity: str
    stream: Stream | None = field(default=None)

    @classmethod
    def open(cls, aravis: Aravis, identity: str | None) -> Self:
        """Connect to the camera of that identity or address, or to the first that answers.

        Raises `CameraError` when none answers, or another program uses it for longer than a program that died.
        """
        chosen, address = _chosen(aravis, identity)
        until = time.monotonic() + HELD_S
        while True:
            try:
                camera = aravis.call("camera_new", address.encode())
            except CameraError as error:
                raise CameraError(f"{chosen} could not be opened: {error}; check its cable and power") from error
            connection = cls(aravis=aravis, camera=camera, identity=chosen)
            owner = connection._controller()
            if owner is None:
                return connection
            connection.close(wait_s=AGAIN_S)
            if time.monotonic() > until:
                raise CameraError(f"{chosen} is held by {owner}; close it there, then open the camera again")
            time.sleep(AGAIN_S)

    def close(self, *, wait_s: float = 0.5) -> None:
        """Release the camera; one that does not answer is left to a thread after ``wait_s``."""
        leaving = threading.Thread(target=self._release, name=f"leaving {self.identity}", daemon=True)
        leaving.start()
        leaving.join(wait_s)

    def _release(self) -> None:
        if self.stream is not None:
            with suppress(CameraError):  # it is lost, or stops when control ends
                self.aravis.call("camera_stop_acquisition", self.camera)
            self.aravis.unref(self.stream.handle)  # and its buffers
        self.aravis.unref(self.camera)

    def _controller(self) -> str | None:
        """The other program that controls the camera; for USB cameras the driver reports it at opening."""
        if not self.aravis.call("camera_is_gv_device", self.camera):
            return None
        device = self.aravis.call("camera_get_device", self.camera)
        if self.aravis.call("gv_device_is_controller", device):
            return None
        address = ctypes.c_uint32()
        try:
            self.aravis.call("device_read_register", device, CONTROLLER_ADDRESS, ctypes.byref(address))
        except CameraError:
            address.value = 0
        at = f" at {ipaddress.ip_address(address.value)}" if address.value else ""
        return f"another program{at}"


def _chosen(aravis: Aravis, identity: str | None) -> tuple[str, str]:
    """Identity of the requested camera, and the name by which the library opens it."""
    if identity is not None and _is_address(identity):  # perhaps on a network outside the search
        return identity, identity
    cameras = search(aravis)
    for camera, address in cameras:
        if identity in (None, camera.identity):
            # Aravis may find a camera of this machine over another network, where its frames would not arrive.
            here = _is_address(address) and ipaddress.ip_address(address).is_loopback
            return camera.identity, address if here else camera.identity
    requested = "no camera answers" if identity is None else f"no camera called {identity!r} answers"
    names = ", ".join(camera.identity for camera, _ in cameras) or "none"
    raise CameraError(
        f"{requested} through Aravis; found: {names}; check its power, cable and network, or name another"
    )


def _is_address(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True

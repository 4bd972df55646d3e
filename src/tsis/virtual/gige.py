"""The virtual probe as a GigE Vision camera, through Aravis."""

from __future__ import annotations

import ctypes
import errno
import ipaddress
import re
import socket
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import CameraError, InputError
from tsis.instrument.drivers.aravis import load
from tsis.model.require import require_number, require_type
from tsis.virtual.camera import USUAL_MS, VirtualCamera

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import TracebackType
    from typing import Self

    from numpy.typing import NDArray

    from tsis.instrument.camera import Frame
    from tsis.instrument.drivers.aravis import Aravis


MAKER, MODEL = "tsis", "VirtualProbe"
SERIAL = re.compile(r"[A-Za-z0-9_.-]{1,15}")  # the protocol's limit

CONTROL_PORT = 3956  # of GigE Vision

# Registers of the simulated camera and of GigE Vision.
MAKER_AT, MODEL_AT, NAME_BYTES = 0x48, 0x68, 32
WIDTH, HEIGHT, SENSOR_HEIGHT, SENSOR_WIDTH = 0x100, 0x104, 0x118, 0x11C
EXPOSURE_US, FIRST_COLUMN, FIRST_ROW, PERIOD_US = 0x120, 0x130, 0x134, 0x138
SIXTEEN_BITS = 257  # 65535 / 255

_FILL = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint32)


class GigEServer:
    """Frames of a virtual camera for all programs that read GigE Vision cameras.

    Programs may set the exposure and the gain in decibels; the camera must allow their exposure. The server is a
    context manager and serves inside its ``with`` block.

    Parameters
    ----------
    camera
        The virtual camera; its press is computed before a program can connect.
    interface
        IPv4 address of this machine to listen on; one camera an address.
    serial
        Serial number, 1 to 15 letters, digits, dots, hyphens and underscores.
    frames_per_s
        Initial rate, in [0.1, 1000]; programs may change it.
    library
        Function that loads Aravis.

    Raises
    ------
    InputError
        When the serial number or the rate is invalid.
    """

    def __init__(
        self,
        camera: VirtualCamera,
        *,
        interface: str = "127.0.0.1",
        serial: str = "TSIS01",
        frames_per_s: float = 30.0,
        library: Callable[[], Aravis] = load,
    ) -> None:
        require_type("camera", camera, VirtualCamera)
        require_type("interface", interface, str)
        require_type("serial", serial, str)
        if not SERIAL.fullmatch(serial):
            raise InputError(f"serial must be 1 to 15 letters, digits, dots, hyphens or underscores; got {serial!r}")
        self._camera, self._interface, self._serial = camera, interface, serial
        self._period_us = round(1e6 / require_number("frames_per_s", frames_per_s, 0.1, 1000.0))
        self._library = library
        self._handle: int | None = None
        self._frames: Iterator[Frame] = iter(())
        self._callback: Any = None  # Aravis calls it until the handle is released
        self._aravis: Aravis
        self.sent = 0
        self.failure: Exception | None = None

    @property
    def identity(self) -> str:
        """Name of the camera in programs that use Aravis."""
        return f"{MAKER}-{MODEL}-{self._serial}"

    def __enter__(self) -> Self:
        """Compute the press, then listen.

        Raises
        ------
        MissingExtraError
            When Aravis is not installed.
        InputError
            When the interface is no IPv4 address.
        CameraError
            When this machine has no such address or another program serves a camera there.
        """
        self._aravis = self._library()
        require_free_address(self._interface)
        self._camera.open()
        self._camera.start()
        self._frames = self._camera.frames()
        next(self._frames)
        handle = self._aravis.call("gv_fake_camera_new", self._interface.encode(), self._serial.encode())
        if not self._aravis.call("gv_fake_camera_is_running", handle):
            self._aravis.unref(handle)
            raise CameraError(f"Aravis could not serve a camera on {self._interface}; try another interface")
        self._handle = handle
        self._prepare(self._fake)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Stop listening."""
        handle, self._handle = self._handle, None
        if handle is not None:
            self._aravis.unref(handle)  # waits for the current frame
        self._camera.stop()

    @property
    def _fake(self) -> int:
        return int(self._aravis.call("gv_fake_camera_get_fake_camera", self._handle))

    def _prepare(self, fake: int) -> None:
        (mode,) = self._camera.modes()
        for address, text in ((MAKER_AT, MAKER), (MODEL_AT, MODEL)):
            self._aravis.call(
                "fake_camera_write_memory", fake, address, NAME_BYTES, text.encode().ljust(NAME_BYTES, b"\0")
            )
        for address, value in {
            SENSOR_WIDTH: mode.width_px,
            SENSOR_HEIGHT: mode.height_px,
            WIDTH: mode.width_px,
            HEIGHT: mode.height_px,
            EXPOSURE_US: round(1000 * USUAL_MS),
            PERIOD_US: self._period_us,
        }.items():
            self._aravis.call("fake_camera_write_register", fake, address, value)
        self._callback = _FILL(self._fill)
        self._aravis.call("fake_camera_set_fill_pattern", fake, self._callback, None)

    def _fill(self, buffer: int, _: int | None, exposure_us: int, gain_db: int, pixel_format: int) -> None:
        """Fill a frame; Aravis calls this in its own thread, which must not raise."""
        try:
            self._camera.adjust("exposure_ms", exposure_us / 1000)
            self._camera.adjust("gain", gain_db)
            pixels = next(self._frames).pixels
            content = region_bytes(pixels, self._region(), pixel_format)
            # A frame of the registers' size fits; Aravis checks this, and only this thread changes the registers.
            ctypes.memmove(self._aravis.call("buffer_get_data", buffer, None), content, len(content))
            self.sent += 1
        except Exception as error:
            self.failure = error

    def _region(self) -> tuple[slice, slice]:
        fake, value = self._fake, ctypes.c_uint32()
        numbers = []
        for register in (FIRST_ROW, HEIGHT, FIRST_COLUMN, WIDTH):
            self._aravis.call("fake_camera_read_register", fake, register, ctypes.byref(value))
            numbers.append(value.value)
        first_row, rows, first_column, columns = numbers
        return slice(first_row, first_row + rows), slice(first_column, first_column + columns)


def require_free_address(interface: str) -> None:
    """Refuse what is no IPv4 address of this machine, or is in use: Aravis does not check it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
        try:
            trial.bind((str(ipaddress.IPv4Address(interface)), CONTROL_PORT))
        except ValueError as error:
            raise InputError(f"interface must be an IPv4 address as 127.0.0.1; got {interface!r}") from error
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise CameraError(f"another program serves a camera on {interface}; end it first") from error
            raise CameraError(f"interface must be an address of this machine; got {interface}") from error


def region_bytes(pixels: NDArray[Any], region: tuple[slice, slice], pixel_format: int) -> bytes:
    r"""Bytes of a region of a grey frame of 8 bits, dark outside the frame.

    The pixel format of GigE Vision contains the bits a pixel: 8, 16 over the whole range, or 24 with grey in each
    colour.

    Examples
    --------
    >>> region_bytes(np.array([[1, 2]], dtype=np.uint8), (slice(0, 1), slice(1, 3)), 0x01100007)
    b'\x02\x02\x00\x00'
    """
    rows, columns = (part.stop - part.start for part in region)
    frame = np.zeros((rows, columns), dtype=np.uint8)
    cut = pixels[region]
    frame[: cut.shape[0], : cut.shape[1]] = cut
    bits = pixel_format >> 16 & 0xFF
    if bits == 16:
        return (frame.astype("<u2") * SIXTEEN_BITS).tobytes()
    return np.repeat(frame, bits // 8, axis=1).tobytes()

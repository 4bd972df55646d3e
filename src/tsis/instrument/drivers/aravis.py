"""GigE Vision and USB3 Vision cameras through Aravis.

In this order: settings and modes in the units of the camera protocol; the library (libaravis 0.8, whose interface is
stable), with the signatures of its calls; the search; the connection to a camera and the buffers of its stream; the
camera.
"""

from __future__ import annotations

import ctypes
import ipaddress
import sys
import threading
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import CameraError, MissingExtraError
from tsis.instrument.camera import SILENT_S, AwakeClock, Frame, Mode, Setting, checked_setting, silence_timeout_s
from tsis.instrument.discovery import CameraInfo, missing_message
from tsis.instrument.drivers.frame_numbers import FULL_SCALE, BlockCount
from tsis.model.require import require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from typing import Self

    from numpy.typing import NDArray


AUTO_OFF, CONTINUOUS = 0, 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A setting and its name in Aravis; the library's value is ``scale`` times ours."""

    name: str
    call: str
    unit: str
    scale: float = 1.0
    auto: str = ""


QUANTITIES = (
    Quantity(name="exposure_ms", call="exposure_time", unit="ms", scale=1000.0, auto="exposure"),
    Quantity(name="gain", call="gain", unit="", auto="gain"),
    Quantity(name="brightness", call="black_level", unit="", auto="black_level"),
    Quantity(name="frames_per_s", call="frame_rate", unit="1/s"),
)


def settings(aravis: Aravis, camera: int) -> tuple[Setting, ...]:
    """The adjustable settings, with present values and ranges."""
    return tuple(_setting(aravis, camera, quantity) for quantity in _offered(aravis, camera))


def adjust(aravis: Aravis, camera: int, name: str, value: float) -> None:
    """Set one of `settings`, and switch off its automatic control."""
    (quantity,) = (quantity for quantity in QUANTITIES if quantity.name == name)
    _take_over(aravis, camera, quantity)
    aravis.call(f"camera_set_{quantity.call}", camera, quantity.scale * value)


def hold_settings(aravis: Aravis, camera: int) -> None:
    """Switch off the automatic control of every setting."""
    for quantity in _offered(aravis, camera):
        _take_over(aravis, camera, quantity)


def modes(aravis: Aravis, camera: int) -> tuple[Mode, ...]:
    """Present size and whole sensor in each grey format, the present one first.

    Raises `CameraError` when the camera has no grey format.
    """
    present = aravis.text("camera_get_pixel_format_as_string", camera)
    formats = [name for name in _pixel_formats(aravis, camera) if name in FULL_SCALE]
    if not formats:
        raise CameraError(f"the camera must offer one of {', '.join(FULL_SCALE)}; it offers none")
    formats.sort(key=lambda name: (name != present, list(FULL_SCALE).index(name)))
    _, _, *size = region(aravis, camera)
    sizes = dict.fromkeys((tuple(size), _sensor_size(aravis, camera) or tuple(size)))  # unique, in order
    has_rate = aravis.call("camera_is_frame_rate_available", camera)
    rate = aravis.call("camera_get_frame_rate", camera) if has_rate else 0.0
    return tuple(
        Mode(
            width_px=width,
            height_px=height,
            full_scale=FULL_SCALE[name],
            frames_per_s=rate if rate > 0 else None,
            pixel_format=name,
        )
        for name in formats
        for width, height in sizes
    )


def offered(mode: Mode | None, modes: tuple[Mode, ...], name: str) -> Mode:
    """The requested mode at any rate, or the first mode when None.

    Raises `CameraError` when no mode has its size and pixel format.
    """
    if mode is None:
        return modes[0]
    for present in modes:
        if replace(mode, frames_per_s=present.frames_per_s) == present:
            return mode
    raise CameraError(f"{name} has no mode {mode.label}; it has {', '.join(present.label for present in modes)}")


def choose(aravis: Aravis, camera: int, mode: Mode) -> None:
    """Apply one of `modes`."""
    aravis.call("camera_set_pixel_format_from_string", camera, mode.pixel_format.encode())
    if region(aravis, camera)[2:] != (mode.width_px, mode.height_px):
        aravis.call("camera_set_region", camera, 0, 0, mode.width_px, mode.height_px)
    if mode.frames_per_s is not None:
        adjust(aravis, camera, "frames_per_s", mode.frames_per_s)
    aravis.call("camera_set_acquisition_mode", camera, CONTINUOUS)
    hold_settings(aravis, camera)


def region(aravis: Aravis, camera: int) -> tuple[int, int, int, int]:
    """First column, first row, columns and rows of the sensor's region."""
    numbers = [ctypes.c_int() for _ in range(4)]
    aravis.call("camera_get_region", camera, *(ctypes.byref(number) for number in numbers))
    first_column, first_row, columns, rows = (number.value for number in numbers)
    return first_column, first_row, columns, rows


def values(offered: tuple[Setting, ...]) -> Mapping[str, float]:
    """The present values by name, for a frame."""
    return {setting.name: setting.value for setting in offered}


def _offered(aravis: Aravis, camera: int) -> list[Quantity]:
    return [quantity for quantity in QUANTITIES if aravis.call(f"camera_is_{quantity.call}_available", camera)]


def _setting(aravis: Aravis, camera: int, quantity: Quantity) -> Setting:
    try:
        low, high = aravis.pair(f"camera_get_{quantity.call}_bounds", camera, ctypes.c_double)
    except CameraError:  # some cameras give no range
        low, high = -np.inf, np.inf
    return Setting(
        name=quantity.name,
        value=aravis.call(f"camera_get_{quantity.call}", camera) / quantity.scale,
        low=low / quantity.scale,
        high=high / quantity.scale,
        unit=quantity.unit or _unit(aravis, camera, quantity),
    )


def _unit(aravis: Aravis, camera: int, quantity: Quantity) -> str:
    """Unit of the camera's value; empty for its own steps."""
    feature = {"gain": b"Gain", "black_level": b"BlackLevel"}[quantity.call]
    node = aravis.call("device_get_feature", aravis.call("camera_get_device", camera), feature)
    return aravis.text("gc_float_get_unit", node) if node and aravis.is_a(node, "gc_float") else ""


def _take_over(aravis: Aravis, camera: int, quantity: Quantity) -> None:
    if quantity.auto and aravis.call(f"camera_is_{quantity.auto}_auto_available", camera):
        aravis.call(f"camera_set_{quantity.call}_auto", camera, AUTO_OFF)


def _pixel_formats(aravis: Aravis, camera: int) -> list[str]:
    count = ctypes.c_uint()
    names = aravis.call("camera_dup_available_pixel_formats_as_strings", camera, ctypes.byref(count))
    if not names:
        return []
    texts = ctypes.cast(names, ctypes.POINTER(ctypes.c_char_p))
    formats = [(texts[index] or b"").decode(errors="replace") for index in range(count.value)]
    aravis.free(names)
    return formats


def _sensor_size(aravis: Aravis, camera: int) -> tuple[int, int] | None:
    try:
        columns, rows = aravis.pair("camera_get_sensor_size", camera, ctypes.c_int)
    except CameraError:  # some cameras give no size
        return None
    return (columns, rows) if columns > 0 and rows > 0 else None


POINTER, TEXT = ctypes.c_void_p, ctypes.c_char_p
INT, UINT, U32, U64 = ctypes.c_int, ctypes.c_uint, ctypes.c_uint32, ctypes.c_uint64
SIZE, REAL = ctypes.c_size_t, ctypes.c_double

# By name without "arv_": result, then arguments.
SIGNATURES: dict[str, tuple[Any, ...]] = {
    "update_device_list": (None,),
    "get_n_devices": (UINT,),
    "get_device_id": (TEXT, UINT),
    "get_device_vendor": (TEXT, UINT),
    "get_device_model": (TEXT, UINT),
    "get_device_protocol": (TEXT, UINT),
    "get_device_address": (TEXT, UINT),
    "camera_get_device": (POINTER, POINTER),
    "camera_is_gv_device": (INT, POINTER),
    "gv_device_is_controller": (INT, POINTER),
    "device_get_feature": (POINTER, POINTER, TEXT),
    "gc_float_get_type": (SIZE,),
    "stream_push_buffer": (None, POINTER, POINTER),
    "stream_timeout_pop_buffer": (POINTER, POINTER, U64),
    "buffer_new_allocate": (POINTER, SIZE),
    "buffer_get_status": (INT, POINTER),
    "buffer_get_frame_id": (U64, POINTER),
    "buffer_get_timestamp": (U64, POINTER),
    "buffer_get_system_timestamp": (U64, POINTER),
    "buffer_get_data": (POINTER, POINTER, POINTER),
    "buffer_get_image_width": (INT, POINTER),
    "buffer_get_image_height": (INT, POINTER),
    "gv_fake_camera_new": (POINTER, TEXT, TEXT),
    "gv_fake_camera_is_running": (INT, POINTER),
    "gv_fake_camera_get_fake_camera": (POINTER, POINTER),
    "fake_camera_read_register": (INT, POINTER, U32, POINTER),
    "fake_camera_write_register": (INT, POINTER, U32, U32),
    "fake_camera_write_memory": (INT, POINTER, U32, U32, POINTER),
    "fake_camera_set_fill_pattern": (None, POINTER, POINTER, POINTER),
}

# The same for calls that report errors: each takes a pointer for an error as a further argument.
FALLIBLE: dict[str, tuple[Any, ...]] = {
    "camera_new": (POINTER, TEXT),
    "camera_get_sensor_size": (None, POINTER, POINTER, POINTER),
    "camera_get_region": (None, POINTER, POINTER, POINTER, POINTER, POINTER),
    "camera_set_region": (None, POINTER, INT, INT, INT, INT),
    "camera_dup_available_pixel_formats_as_strings": (POINTER, POINTER, POINTER),
    "camera_get_pixel_format_as_string": (TEXT, POINTER),
    "camera_set_pixel_format_from_string": (None, POINTER, TEXT),
    "camera_set_acquisition_mode": (None, POINTER, INT),
    "camera_get_payload": (UINT, POINTER),
    "camera_create_stream": (POINTER, POINTER, POINTER, POINTER),
    "camera_start_acquisition": (None, POINTER),
    "camera_stop_acquisition": (None, POINTER),
    "device_read_register": (None, POINTER, U64, POINTER),
    "gc_float_get_unit": (TEXT, POINTER),
} | {
    f"camera_{call.format(quantity)}": kinds
    for quantity in ("exposure_time", "gain", "black_level", "frame_rate")
    for call, kinds in {
        "is_{}_available": (INT, POINTER),
        "get_{}": (REAL, POINTER),
        "set_{}": (None, POINTER, REAL),
        "get_{}_bounds": (None, POINTER, POINTER, POINTER),
    }.items()
}
FALLIBLE |= {f"camera_is_{what}_auto_available": (INT, POINTER) for what in ("exposure", "gain", "black_level")}
FALLIBLE |= {f"camera_set_{what}_auto": (None, POINTER, INT) for what in ("exposure_time", "gain", "black_level")}

# Of the libraries below Aravis, by their full names.
BELOW: dict[str, tuple[Any, ...]] = {
    "g_object_unref": (None, POINTER),
    "g_free": (None, POINTER),
    "g_error_free": (None, POINTER),
    "g_value_init": (POINTER, POINTER, SIZE),
    "g_value_set_int": (None, POINTER, INT),
    "g_object_set_property": (None, POINTER, TEXT, POINTER),
    "g_type_check_instance_is_a": (INT, POINTER, SIZE),
}


# File names by system; on Linux and macOS the symbols of GLib are available through Aravis.
FILES = {
    "darwin": (
        "libaravis-0.8.0.dylib",
        "/opt/homebrew/lib/libaravis-0.8.0.dylib",
        "/usr/local/lib/libaravis-0.8.0.dylib",
    ),
    "win32": ("libaravis-0.8-0.dll", "aravis-0.8-0.dll"),
}
LINUX_FILES = ("libaravis-0.8.so.0",)
WINDOWS_BELOW = (("libgobject-2.0-0.dll", "gobject-2.0-0.dll"), ("libglib-2.0-0.dll", "glib-2.0-0.dll"))
CURES = {
    "darwin": "brew install aravis",
    "win32": "the package mingw-w64-x86_64-aravis of MSYS2, with its folder bin in PATH",
}
G_TYPE_INT = 6 << 2
DEBIAN_CURE = "on Debian and Ubuntu: apt install libaravis-0.8-0"


class _Error(ctypes.Structure):
    """GLib's GError."""

    _fields_ = (("domain", ctypes.c_uint32), ("code", ctypes.c_int), ("message", ctypes.c_char_p))


class Aravis:
    """The calls of libaravis by their names without ``arv_``.

    Raises `MissingExtraError` when no library has a symbol.

    Parameters
    ----------
    parts
        Loaded libraries; each symbol comes from the first that has it.
    """

    def __init__(self, *parts: ctypes.CDLL) -> None:
        self._infallible = {name: _bound(parts, f"arv_{name}", kinds) for name, kinds in SIGNATURES.items()}
        self._fallible = {
            name: _bound(parts, f"arv_{name}", (*kinds, ctypes.POINTER(ctypes.POINTER(_Error))))
            for name, kinds in FALLIBLE.items()
        }
        self._below = {name: _bound(parts, name, kinds) for name, kinds in BELOW.items()}

    def call(self, name: str, *arguments: Any) -> Any:
        """The result of ``arv_name``; `CameraError` when the library reports an error."""
        if name in self._infallible:
            return self._infallible[name](*arguments)
        error = ctypes.POINTER(_Error)()
        returned = self._fallible[name](*arguments, ctypes.byref(error))
        if error:
            message = (error.contents.message or b"no reason given").decode(errors="replace")
            self._below["g_error_free"](error)
            raise CameraError(f"Aravis could not do {name}: {message}")
        return returned

    def text(self, name: str, *arguments: Any) -> str:
        """The text result of ``arv_name``; empty without one."""
        return (self.call(name, *arguments) or b"").decode(errors="replace")

    def pair(self, name: str, handle: int, kind: Any) -> tuple[Any, Any]:
        """Two numbers that ``arv_name`` writes through pointers."""
        first, second = kind(), kind()
        self.call(name, handle, ctypes.byref(first), ctypes.byref(second))
        return first.value, second.value

    def is_a(self, handle: int, kind: str) -> bool:
        """Whether an object is of the class of ``arv_kind_get_type``."""
        return bool(self._below["g_type_check_instance_is_a"](handle, self.call(f"{kind}_get_type")))

    def set_whole(self, handle: int, name: str, value: int) -> None:
        """Set a property of an object to a whole number."""
        holder = (ctypes.c_uint64 * 3)()  # GLib's GValue
        self._below["g_value_init"](holder, G_TYPE_INT)
        self._below["g_value_set_int"](holder, value)
        self._below["g_object_set_property"](handle, name.encode(), holder)

    def unref(self, handle: int) -> None:
        """Release an object."""
        self._below["g_object_unref"](handle)

    def free(self, memory: int) -> None:
        """Release memory."""
        self._below["g_free"](memory)


def _bound(parts: tuple[ctypes.CDLL, ...], symbol: str, kinds: tuple[Any, ...]) -> Callable[..., Any]:
    for part in parts:
        function = getattr(part, symbol, None)
        if function is not None:
            function.restype, function.argtypes = kinds[0], kinds[1:]
            return function  # type: ignore[no-any-return]
    raise MissingExtraError(f"cameras through Aravis need a newer Aravis 0.8, this one has no {symbol}; {cure()}")


@cache
def load() -> Aravis:
    """The library of this system.

    Raises `MissingExtraError` when it is not installed or too old; the message includes the cure.
    """
    if sys.platform == "win32":
        return Aravis(_first(FILES["win32"]), *(_first(names) for names in WINDOWS_BELOW))
    return Aravis(_first(FILES.get(sys.platform, LINUX_FILES)))


def _first(names: tuple[str, ...]) -> ctypes.CDLL:
    for name in names:
        with suppress(OSError):
            return ctypes.CDLL(name)
    raise MissingExtraError(f"cameras through Aravis need its library {names[0]}, which is not installed; {cure()}")


def cure() -> str:
    """How to install the library on this system."""
    return CURES.get(sys.platform, DEBIAN_CURE)


SOURCE = "aravis"
_the_list = threading.Lock()  # the library has one list, whose entries are read one by one


def missing_requirement(library: Callable[[], Aravis] = load) -> str | None:
    """What is not installed, with the cure; None when cameras can be searched."""
    return missing_message(library)


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


HELD_S, AGAIN_S = 6.0, 0.25  # a program that died holds a camera until its heartbeat ends, by default after 3 s
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
    absent = "no camera answers" if identity is None else f"no camera called {identity!r} answers"
    names = ", ".join(camera.identity for camera, _ in cameras) or "none"
    raise CameraError(f"{absent} through Aravis; found: {names}; check its power, cable and network, or name another")


def _is_address(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True


TORN_S = 10.0  # with incomplete frames only


class Watch:
    """Started whenever a reader begins to wait, so that the reader's own time does not count."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._awake = AwakeClock(clock)
        self._began_s = self._heard_s = self._awake()
        self._torn = 0

    def reason(self, *, heard: bool, silent_s: float = SILENT_S) -> str | None:
        """Why the camera counts as lost; None if it does not. An incomplete frame counts as ``heard``."""
        now_s = self._awake()
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
            return modes(connection.aravis, connection.camera)

    def settings(self) -> tuple[Setting, ...]:
        """Exposure in ms, gain, brightness (black level) and frame rate, where the camera has them."""
        with self._controlling:
            connection = self._opened()
            return settings(connection.aravis, connection.camera)

    def adjust(self, name: str, value: float) -> None:
        """Change one of `settings`; the camera may round the value.

        Raises `UnknownNameError` when there is no such setting; `InputError` when the value lies outside its range;
        `CameraError` when the camera does not take it.
        """
        with self._controlling:
            connection = self._opened()
            checked = checked_setting(self.settings(), name, value, camera=self.name)
            adjust(connection.aravis, connection.camera, name, checked)
            if self._running.is_set():
                self._taken = [*self._taken[-1:], (time.time_ns(), values(self.settings()))]

    def start(self, mode: Mode | None = None) -> None:
        """Begin to deliver frames in ``mode``, or in the present one.

        Raises `CameraError` when the camera has no such mode, or does not start.
        """
        with self._controlling:
            connection = self._opened()
            if self._running.is_set():
                raise CameraError(f"{self.name} runs already; call stop() and open() before another start()")
            chosen = offered(mode, self.modes(), self.name)
            aravis, camera = connection.aravis, connection.camera
            choose(aravis, camera, chosen)
            self._stream = connection.stream = Stream(aravis, camera, chosen)
            self._mode, self._taken = chosen, [(0, values(self.settings()))]
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

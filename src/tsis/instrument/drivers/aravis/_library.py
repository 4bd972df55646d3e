"""The library Aravis: signatures of libaravis 0.8, whose interface is stable, and its loading."""

from __future__ import annotations

import ctypes
import sys
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, Any

from tsis.errors import CameraError, MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Callable


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
        response = self._fallible[name](*arguments, ctypes.byref(error))
        if error:
            message = (error.contents.message or b"no reason given").decode(errors="replace")
            self._below["g_error_free"](error)
            raise CameraError(f"Aravis could not do {name}: {message}")
        return response

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

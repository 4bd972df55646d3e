"""The library Aravis, loaded when a camera is first asked for; its errors become sentences."""

from __future__ import annotations

import ctypes
import sys
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, Any

from tsis.instrument.sources.aravis.prototypes import BELOW, FALLIBLE, PLAIN
from tsis.model.errors import CameraError, MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Callable

# Where a system keeps them; on Linux and macOS the symbols of GLib are found through Aravis.
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
    """The calls of libaravis that are used here, by their names without ``arv_``.

    Parameters
    ----------
    parts
        Loaded libraries; each symbol is taken from the first that has it.

    Raises
    ------
    MissingExtraError
        When a symbol is in none of them.
    """

    def __init__(self, *parts: ctypes.CDLL) -> None:
        self._plain = {name: _bound(parts, f"arv_{name}", kinds) for name, kinds in PLAIN.items()}
        self._fallible = {
            name: _bound(parts, f"arv_{name}", (*kinds, ctypes.POINTER(ctypes.POINTER(_Error))))
            for name, kinds in FALLIBLE.items()
        }
        self._below = {name: _bound(parts, name, kinds) for name, kinds in BELOW.items()}

    def call(self, name: str, *arguments: Any) -> Any:
        """What ``arv_name`` answers.

        Raises
        ------
        CameraError
            What the library says went wrong.
        """
        if name in self._plain:
            return self._plain[name](*arguments)
        error = ctypes.POINTER(_Error)()
        answer = self._fallible[name](*arguments, ctypes.byref(error))
        if error:
            message = (error.contents.message or b"no reason given").decode(errors="replace")
            self._below["g_error_free"](error)
            raise CameraError(f"Aravis could not do {name}: {message}")
        return answer

    def text(self, name: str, *arguments: Any) -> str:
        """The text that ``arv_name`` answers; empty when there is none."""
        return (self.call(name, *arguments) or b"").decode(errors="replace")

    def pair(self, name: str, handle: int, kind: Any) -> tuple[Any, Any]:
        """Two numbers that ``arv_name`` writes to places given to it."""
        first, second = kind(), kind()
        self.call(name, handle, ctypes.byref(first), ctypes.byref(second))
        return first.value, second.value

    def is_a(self, handle: int, kind: str) -> bool:
        """Whether an object is of the class of ``arv_kind_get_type``."""
        return bool(self._below["g_type_check_instance_is_a"](handle, self.call(f"{kind}_get_type")))

    def set_whole(self, handle: int, name: str, value: int) -> None:
        """Set a property of an object to a whole number."""
        place = (ctypes.c_uint64 * 3)()  # GLib's GValue
        self._below["g_value_init"](place, G_TYPE_INT)
        self._below["g_value_set_int"](place, value)
        self._below["g_object_set_property"](handle, name.encode(), place)

    def unref(self, handle: int) -> None:
        """Give an object back."""
        self._below["g_object_unref"](handle)

    def free(self, memory: int) -> None:
        """Give memory back."""
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

    Raises
    ------
    MissingExtraError
        When it is not installed or too old; the sentence tells how to install it.
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

"""The protocol between a GenICam camera and its maker's library, and the import of such libraries."""

from __future__ import annotations

import contextlib
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from tsis.errors import CameraError, import_extra
from tsis.instrument._quiet import quiet_decoders
from tsis.instrument.drivers.genicam._settings import number_node

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.instrument.drivers.genicam._settings import Nodes


def maker_library(name: str, *, source: str) -> Any:
    """Import a library when its source is first used.

    Libraries made with SWIG emit warnings at import, and Harvesters changes the filters of all warnings; both are
    undone here. Raises `MissingExtraError` when it is not installed.
    """
    imported = name in sys.modules
    with contextlib.nullcontext() if imported else quiet_decoders():  # silences warnings, and restores the filters
        return import_extra(name, feature=f"the camera source {source}", extra=f"camera-{source}")


_BUFFER_BYTES = 64 * 2**20
_FEWEST_BUFFERS, _MOST_BUFFERS = 4, 32
_LONGEST_REASON = 160


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grab:
    """One buffer of the camera.

    Parameters
    ----------
    pixels
        Grey levels, shape (rows, columns); None for an incomplete buffer.
    number
        The camera's number; None without one.
    time_s
        Seconds on the camera's own clock; None without one.
    """

    pixels: NDArray[Any] | None
    number: int | None = None
    time_s: float | None = None


class Link(Protocol):
    """The connection to one open camera; it is never used again after its release or loss."""

    @property
    def identity(self) -> str:
        """The camera's name in its source."""

    @property
    def nodes(self) -> Nodes:
        """The camera's features."""

    @property
    def present(self) -> bool:
        """False when the library knows that the camera was removed."""

    @property
    def errors(self) -> tuple[type[Exception], ...]:
        """Exceptions of the library when the camera does not answer."""

    def begin(self) -> None:
        """Start the camera."""

    def grab(self, timeout_s: float) -> Grab | None:
        """The next buffer, or None when none arrived in time."""

    def end(self) -> None:
        """Stop the camera."""

    def close(self) -> None:
        """Release the camera."""


def buffer_count(payload_bytes: float) -> int:
    """Number of buffers for a camera: a second's worth at usual rates, within 64 MiB.

    Examples
    --------
    >>> buffer_count(768 * 492), buffer_count(10_000_000)
    (32, 6)
    """
    return int(min(max(_BUFFER_BYTES // max(payload_bytes, 1.0), _FEWEST_BUFFERS), _MOST_BUFFERS))


def buffers_of(nodes: Nodes) -> int:
    """Number of buffers for the frames of a camera."""
    payload = number_node(nodes, "PayloadSize")
    return buffer_count(0.0 if payload is None else payload.value)


def ticks_per_s(nodes: Nodes) -> float:
    """Frequency of a camera's clock; that of nanoseconds where it states none."""
    frequency = number_node(nodes, "GevTimestampTickFrequency")
    return 1e9 if frequency is None else frequency.value


def reason(error: Exception) -> str:
    r"""The text of a library's error for a message: one line, without its source position, not too long.

    Examples
    --------
    >>> reason(RuntimeError("Node is not writable. : AccessException thrown in node 'Width' (file 'x.h', line 76)"))
    'Node is not writable'
    """
    text = " ".join(str(error).split()).partition(" : ")[0]
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text[:_LONGEST_REASON].rstrip(" .") or type(error).__name__


def cannot_open(name: str, error: Exception, *, busy: bool) -> CameraError:
    """The error of a camera that does not open."""
    if busy:
        why = "is busy: another program, or another part of this one, holds it; close that first"
    else:
        why = "cannot be opened; check its cable and power, and that no other program holds it"
    return CameraError(f"{name} {why} (the driver says: {reason(error)})")


def camera_not_found(source: str, identity: str, others: list[str]) -> CameraError:
    """The error of a camera that did not answer the search."""
    start = f"no {source} camera is called {identity!r}" if identity else f"no {source} camera was found"
    return CameraError(start + (f"; found: {', '.join(others)}" if others else "; check its cable and power"))

"""Libraries of camera makers, imported so that they leave this program's warnings as they were."""

from __future__ import annotations

import contextlib
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from tsis.errors import CameraError, import_extra
from tsis.instrument._quiet import quiet_decoders

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.instrument.drivers.genicam._settings import Nodes


def maker_library(name: str, *, source: str) -> Any:
    """Import a library when its source is first used.

    Those made with SWIG warn about themselves, and Harvesters changes the filters of all warnings; neither is for our
    users to see.

    Raises
    ------
    MissingExtraError
        When it is not installed.
    """
    imported = name in sys.modules
    with contextlib.nullcontext() if imported else quiet_decoders():  # silences warnings, and puts the filters back
        return import_extra(name, feature=f"the camera source {source}", extra=f"camera-{source}")


_BUFFER_BYTES = 64 * 2**20
_FEWEST_BUFFERS, _MOST_BUFFERS = 4, 32
_LONGEST_REASON = 160


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grab:
    """One buffer as it came from the camera.

    Parameters
    ----------
    pixels
        Grey levels, shape (rows, columns); None when the buffer came incomplete.
    number
        What the camera numbered it; None when it does not.
    time_s
        When, in seconds on the camera's own clock; None when it does not tell.
    """

    pixels: NDArray[Any] | None
    number: int | None = None
    time_s: float | None = None


class Link(Protocol):
    """A hold on one open camera; it serves until the camera is let go of or lost, and is never used again."""

    @property
    def identity(self) -> str:
        """What its source calls the camera."""

    @property
    def nodes(self) -> Nodes:
        """Its features."""

    @property
    def present(self) -> bool:
        """False when the library knows that the camera was removed."""

    @property
    def errors(self) -> tuple[type[Exception], ...]:
        """What the library raises when the camera does not answer."""

    def begin(self) -> None:
        """Let the camera send frames."""

    def grab(self, timeout_s: float) -> Grab | None:
        """The next buffer, or None when none came within the time."""

    def end(self) -> None:
        """Let it send no more."""

    def close(self) -> None:
        """Let go of it."""


def buffer_count(payload_bytes: float) -> int:
    """How many buffers to keep between the camera and us: a second's worth at usual rates, within 64 MiB.

    Examples
    --------
    >>> buffer_count(768 * 492), buffer_count(10_000_000)
    (32, 6)
    """
    return int(min(max(_BUFFER_BYTES // max(payload_bytes, 1.0), _FEWEST_BUFFERS), _MOST_BUFFERS))


def reason(error: Exception) -> str:
    r"""What a library's error says, as the end of a sentence: one line, no place in its source, not too long.

    Examples
    --------
    >>> reason(RuntimeError("Node is not writable. : AccessException thrown in node 'Width' (file 'x.h', line 76)"))
    'Node is not writable'
    """
    text = " ".join(str(error).split()).partition(" : ")[0]
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text[:_LONGEST_REASON].rstrip(" .") or type(error).__name__


def cannot_open(name: str, error: Exception, *, busy: bool) -> CameraError:
    """The sentence for a camera that does not open."""
    if busy:
        why = "is busy: another program, or another part of this one, holds it; close that first"
    else:
        why = "cannot be opened; check its cable and power, and that no other program holds it"
    return CameraError(f"{name} {why} (the driver says: {reason(error)})")


def camera_not_found(source: str, identity: str, others: list[str]) -> CameraError:
    """The sentence for a camera that did not answer the search."""
    requested = f"no {source} camera is called {identity!r}" if identity else f"no {source} camera was found"
    observed = f"; found: {', '.join(others)}" if others else "; check its cable and power"
    return CameraError(requested + observed)

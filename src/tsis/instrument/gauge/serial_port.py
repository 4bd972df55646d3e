"""Serial ports: which there are, and opening one or saying in a sentence why not."""

from __future__ import annotations

import errno
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from serial.tools import list_ports

from tsis.model.errors import GaugeError

if TYPE_CHECKING:
    from collections.abc import Callable

# What a driver raises when a port goes away or was closed by another thread; termios' error is none of OSError.
PORT_FAILURES: tuple[type[Exception], ...] = (OSError, ValueError, TypeError)
with suppress(ImportError):  # on Windows
    import termios

    PORT_FAILURES += (termios.error,)

# Windows' ports carry no number: the name of the error is in the text.
_CAUSES = {
    "FileNotFoundError": errno.ENOENT,
    "PermissionError": errno.EACCES,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialPort:
    """A serial port of this machine: its name, as ``"/dev/ttyUSB0"`` or ``"COM3"``, and what the system says of it."""

    device: str
    description: str


def find_ports() -> tuple[SerialPort, ...]:
    """The serial ports of this machine, by name.

    Raises
    ------
    GaugeError
        When the system does not list them.

    Examples
    --------
    >>> all(port.device for port in find_ports())
    True
    """
    try:
        found = list_ports.comports()
    except PORT_FAILURES as error:
        raise GaugeError(f"the serial ports of this machine cannot be listed; got: {error!s:.120}") from error
    return tuple(
        SerialPort(device=str(each.device), description=str(each.description))
        for each in sorted(found, key=lambda each: str(each.device))
    )


def opened(port: str, open_port: Callable[..., Any], **settings: Any) -> Any:
    """The port, held for this program alone.

    Raises
    ------
    GaugeError
        When there is none of that name, another program holds it, or this user may not use it.
    """
    try:
        return open_port(port, exclusive=True, **settings)
    except PORT_FAILURES as error:
        raise GaugeError(_refusal(port, error)) from error


def _refusal(port: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    number = number or next((code for name, code in _CAUSES.items() if name in str(error)), None)
    shown = f"{port!r:.120}"
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        found = ", ".join(each.device for each in find_ports()) or "none"
        return f"no serial port is called {shown}; check the cable and the name (found: {found})"
    if number in (errno.EBUSY, errno.EAGAIN):
        return f"serial port {shown} is in use by another program; close that one"
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"serial port {shown} must be open to you; close other programs that use it, or on Linux have "
            "yourself added to its group (often dialout) and log in again"
        )
    return f"{shown} cannot be opened as a serial port; got: {error!s:.120}"

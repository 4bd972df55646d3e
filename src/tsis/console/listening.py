"""Where a console listens, and by which names it may then be called."""

from __future__ import annotations

import ipaddress
import socket

from tsis.model.errors import InputError

LOOPBACK = "127.0.0.1"
OWN_NAMES = ("127.0.0.1", "localhost", "[::1]")
# A port that was left just now may be taken again. On Windows that option would let other programs take one that is
# in use, and be given what was meant for the console; there this one forbids it.
_OPTION: int = getattr(socket, "SO_EXCLUSIVEADDRUSE", socket.SO_REUSEADDR)


def resolved(host: str) -> str:
    """The address of this machine that is meant by ``host``.

    Raises
    ------
    InputError
        When it is none.
    """
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        said = getattr(error, "strerror", None) or error
        raise InputError(f"host must be an address of this machine; got {host!r:.80}: {said}") from error
    return str(found[0][4][0])


def is_loopback(address: str) -> bool:
    """Whether only programs of this machine can reach it."""
    return ipaddress.ip_address(address.partition("%")[0]).is_loopback


def listening(address: str, port: int) -> socket.socket:
    """A socket that listens there; port 0 is any free one.

    Raises
    ------
    InputError
        When the port cannot be taken, or the address is not one of this machine.
    """
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, _OPTION, 1)
    try:
        listener.bind((address, port))
        listener.listen()  # at once: of two consoles that begin together the second is told now
    except OSError as error:
        listener.close()
        raise InputError(
            f"port {port} of {address} must be free; got: {error.strerror or error} "
            "(choose another with --port, or 0 for any)"
        ) from error
    return listener


def shown_name(address: str, names: tuple[str, ...]) -> str:
    """The name under which people open it: the first that was given, else the address itself."""
    if names:
        return names[0]
    if ipaddress.ip_address(address.partition("%")[0]).is_unspecified:
        return LOOPBACK
    return f"[{address}]" if ":" in address else address

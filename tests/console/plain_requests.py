"""Requests letter by letter, as libraries would not send them."""

from __future__ import annotations

import socket
import ssl
from contextlib import suppress
from urllib.parse import urlsplit

from tests.waiting import HANGS_S

MOST_BYTES = 2**16


def answer_to(address: str, request: bytes) -> bytes:
    """Send this to a server, and read until it closes or has sent a head."""
    parts = urlsplit(address)
    assert parts.hostname is not None
    with socket.create_connection((parts.hostname, parts.port or 80), timeout=HANGS_S) as connection:
        wrapped = _unchecked().wrap_socket(connection) if parts.scheme == "https" else connection
        with wrapped:
            with suppress(ConnectionError):  # it may say no before all was sent
                wrapped.sendall(request)
            read = b""
            while b"\r\n\r\n" not in read and len(read) < MOST_BYTES:
                part = wrapped.recv(4096)
                if not part:
                    break
                read += part
            return read


def status_of(answer: bytes) -> int:
    """The status of an answer."""
    return int(answer.split(b" ", 2)[1])


def upgraded(address: str, path: str, headers: dict[str, str]) -> int:
    """The status with which a WebSocket is answered: 101 when it is opened."""
    requested = {"Host": urlsplit(address).netloc, **headers}
    fixed = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }
    lines = [f"GET {path} HTTP/1.1", *(f"{name}: {value}" for name, value in {**requested, **fixed}.items()), "", ""]
    return status_of(answer_to(address, "\r\n".join(lines).encode("latin-1")))


def _unchecked() -> ssl.SSLContext:
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context

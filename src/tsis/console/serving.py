"""Serve the console until it is told to end: the address that people open, and what may reach it."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import uvicorn

from tsis.console.allocation import share_memory_among_threads, tidied
from tsis.console.app import console_app
from tsis.console.bench import Bench, BenchTerms
from tsis.console.listening import LOOPBACK, OWN_NAMES, is_loopback, listening, resolved, shown_name
from tsis.console.log import logged
from tsis.console.patience import PatientProtocol
from tsis.console.security.access import Access
from tsis.console.security.asked import name_of
from tsis.console.security.key import kept_token
from tsis.console.security.logins import Logins
from tsis.console.security.private_files import console_folder
from tsis.console.security.sessions import Sessions
from tsis.model.check import require_integer
from tsis.model.errors import InputError

if TYPE_CHECKING:
    import socket
    import ssl
    from collections.abc import Callable, Iterator

    from starlette.types import ASGIApp

    from tsis.console.tls import Certificate

LARGEST_PORT = 65535
END_S = 1  # for which open pages are waited for
LARGEST_HEADERS = 2**15
LARGEST_MESSAGE = 2**20  # of a WebSocket, to the console
CONNECTIONS = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsoleTerms:
    """How a console is served.

    Parameters
    ----------
    bench
        What it begins with.
    host, port
        Where it listens; port 0 is any free one. An address that other machines can reach needs a certificate and a
        login.
    certificate
        With which it speaks TLS; then people may come in by a login too.
    names
        Names, beside its own addresses, by which it may be called.
    new_token
        Make another key, which shuts out everybody who had the old one.
    """

    bench: BenchTerms = field(default_factory=BenchTerms)
    host: str = LOOPBACK
    port: int = 8642
    certificate: Certificate | None = None
    names: tuple[str, ...] = ()
    new_token: bool = False

    def __post_init__(self) -> None:
        require_integer("port", self.port, 0, LARGEST_PORT)
        for name in self.names:
            if not name or name_of(name) != name.lower():
                raise InputError(f"name of a host must be a name without a port; got {name!r:.80}")


def serve_console(terms: ConsoleTerms, *, ready: Callable[[str], None]) -> None:
    """Serve a console until the process is interrupted or terminated.

    Parameters
    ----------
    terms
        How.
    ready
        Told the address to open once it listens.

    Raises
    ------
    InputError
        When the address cannot be listened on, or may not be.
    TsisError
        As `Bench`, and when the console's key, logins or certificate cannot be used.
    """
    with _terminated_as_interrupted():
        address, tls, logins = _permitted(terms)
        folder = console_folder()
        with listening(address, terms.port) as listener:  # before another key: whoever fails here shuts nobody out
            token = kept_token(new=terms.new_token, folder=folder)
            access = Access(
                token,
                sessions=Sessions(token, folder=folder),
                logins=logins,
                port=listener.getsockname()[1],
                secure=tls is not None,
            )
            share_memory_among_threads()
            with logged(folder), Bench(terms.bench) as bench:
                application = console_app(bench, access=access, hosts=(*OWN_NAMES, *terms.names))
                ready(_entrance(listener, address, terms, token))
                with tidied(), suppress(KeyboardInterrupt):  # the server has ended in order, and raises what ended it
                    uvicorn.Server(_config(application, tls)).run(sockets=[listener])


def _entrance(listener: socket.socket, address: str, terms: ConsoleTerms, token: str) -> str:
    """The address that people open."""
    scheme = "http" if terms.certificate is None else "https"
    return f"{scheme}://{shown_name(address, terms.names)}:{listener.getsockname()[1]}/?token={token}"


def _permitted(terms: ConsoleTerms) -> tuple[str, ssl.SSLContext | None, Logins | None]:
    """The address to listen on, TLS and logins; refused is a network without either."""
    address = resolved(terms.host)
    tls = None if terms.certificate is None else terms.certificate.context()
    logins = None if tls is None else Logins()
    if not is_loopback(address) and (tls is None or logins is None or not logins.names()):
        raise InputError(
            f"host must be an address of this machine alone, as {LOOPBACK}, unless a certificate and "
            f"a login are there; got {terms.host} (give --certificate and --key, and "
            "add a login with tsis login add NAME)"
        )
    return address, tls, logins


def _config(application: ASGIApp, tls: ssl.SSLContext | None) -> uvicorn.Config:
    return uvicorn.Config(
        application,
        http=PatientProtocol,  # by h11, which bounds headers; the quicker parser does not
        ws="websockets-sansio",  # of which that one knows whether a WebSocket was asked for in good form
        h11_max_incomplete_event_size=LARGEST_HEADERS,
        ws_max_size=LARGEST_MESSAGE,
        ws_per_message_deflate=False,  # frames do not shrink
        limit_concurrency=CONNECTIONS,
        proxy_headers=False,  # nobody stands between
        log_config=None,
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=END_S,
        ssl_context_factory=None if tls is None else lambda *_: tls,
    )


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """A process that is terminated ends as one that is interrupted: what was begun is finished."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)

"""The server of a console: certificate, address, log."""

from __future__ import annotations

import asyncio
import ipaddress
import itertools
import logging
import signal
import socket
import ssl
import threading
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from logging.handlers import RotatingFileHandler
from typing import TYPE_CHECKING, Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from tsis.console.app import console_app
from tsis.console.auth import Access, Logins, Sessions, console_folder, name_of, saved_token
from tsis.console.services.choice import InstrumentSettings
from tsis.console.services.instrument import Instrument, warm_up
from tsis.console.worker import WorkerProcess, collecting_garbage, share_memory_among_threads, solving_process
from tsis.errors import FileInputError, InputError, TsisError
from tsis.model.require import require_integer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    import h11
    from starlette.types import ASGIApp


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """A certificate with its chain, and its private key.

    Attributes
    ----------
    chain, key
        Files in PEM; the key must not be locked by a password.
    """

    chain: Path
    key: Path

    def context(self) -> ssl.SSLContext:
        """TLS context of a server, from version 1.2 on.

        Raises
        ------
        FileInputError
            When the files cannot be read or do not belong together.
        """
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        for name, path in (("certificate", self.chain), ("key", self.key)):
            if not path.is_file():
                raise FileInputError(f"{name} must be a file in PEM; got {path}, which is none")
        try:
            context.load_cert_chain(self.chain, self.key, _no_password)
        except ssl.SSLError as error:
            raise FileInputError(
                f"{self.chain} and {self.key} must hold a certificate and its key in PEM; got: {error.reason or error}"
            ) from error
        except OSError as error:
            cause = error.strerror or error
            raise FileInputError(f"{self.chain} and {self.key} must be readable; got: {cause}") from error
        return context


def _no_password() -> str:
    raise FileInputError("key must not be locked by a password (openssl pkey -in LOCKED -out KEY unlocks it)")


LOOPBACK = "127.0.0.1"
OWN_NAMES = ("127.0.0.1", "localhost", "[::1]")
# A port that was closed just now may be taken again. On Windows that option would let other programs take a port in
# use, and receive its requests; there this one forbids it.
_OPTION: int = getattr(socket, "SO_EXCLUSIVEADDRUSE", socket.SO_REUSEADDR)


def resolve_host(host: str) -> str:
    """The address of this machine for ``host``.

    Raises
    ------
    InputError
        When it is none.
    """
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        cause = getattr(error, "strerror", None) or error
        raise InputError(f"host must be an address of this machine; got {host!r:.80}: {cause}") from error
    return str(found[0][4][0])


def is_loopback(address: str) -> bool:
    """Whether only programs of this machine can reach it."""
    return ipaddress.ip_address(address.partition("%")[0]).is_loopback


def listen(address: str, port: int) -> socket.socket:
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
        listener.listen()  # at once, so that the second of two consoles fails here
    except OSError as error:
        listener.close()
        raise InputError(
            f"port {port} of {address} must be free; got: {error.strerror or error} "
            "(choose another with --port, or 0 for any)"
        ) from error
    return listener


def public_host(address: str, names: tuple[str, ...]) -> str:
    """The public name: the first given one, else the address."""
    if names:
        return names[0]
    unspecified = ipaddress.ip_address(address.partition("%")[0]).is_unspecified
    return LOOPBACK if unspecified else f"[{address}]" if ":" in address else address


FILE = "console.log"
LARGEST_BYTES = 2**20
SOURCES = ("tsis", "nicegui", "uvicorn.error", "asyncio")
LOGINS = "tsis.console.auth"  # of it the file holds who came in, too
_NOT_LOGGED = (
    "timeout graceful shutdown exceeded",  # an open page was ended with the console
    "Invalid HTTP request received",  # anybody can send such, as often as he likes, and was answered
    "Unsupported upgrade request",
)


class OneLineFormatter(logging.Formatter):
    """The message and the error, without traceback."""

    def format(self, record: logging.LogRecord) -> str:
        """One line."""
        text = record.getMessage()
        error = record.exc_info[1] if record.exc_info else None
        if error is not None:
            text = f"{text}: {type(error).__name__}: {error}"
        return f"{record.levelname.capitalize()}: {' '.join(text.split())[:500]}"


class FullLogHandler(RotatingFileHandler):
    """The log file; write errors are ignored."""

    def handleError(self, _: logging.LogRecord) -> None:  # noqa: N802 - the library's name
        """Do nothing: on a full disk a message would repeat for each line."""


@contextmanager
def logging_to(folder: Path) -> Iterator[None]:
    """Log the console and its libraries inside the block: to `FILE` of the folder, and to the terminal."""
    whole = FullLogHandler(folder / FILE, maxBytes=LARGEST_BYTES, backupCount=2, encoding="utf-8", delay=True)
    whole.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    short = logging.StreamHandler()
    short.setFormatter(OneLineFormatter())
    for handler, level in ((whole, logging.INFO), (short, logging.WARNING)):
        handler.setLevel(level)
        handler.addFilter(_is_logged)
    sources = [logging.getLogger(name) for name in SOURCES]
    for source in sources:
        source.addHandler(whole)
        source.addHandler(short)
    logins = logging.getLogger(LOGINS)
    level = logins.level
    logins.setLevel(logging.INFO)
    try:
        yield
    finally:
        logins.setLevel(level)
        for source in sources:
            source.removeHandler(whole)
            source.removeHandler(short)
        whole.close()


def _is_logged(record: logging.LogRecord) -> bool:
    if record.levelno < logging.WARNING and not record.name.startswith(LOGINS):
        return False
    if record.exc_info and isinstance(record.exc_info[1], asyncio.CancelledError):  # what waited when the console ended
        return False
    return not any(item in record.getMessage() for item in _NOT_LOGGED)


LARGEST_PORT = 65535
END_S = 1  # for which open pages are waited for
LARGEST_HEADERS = 2**15
LARGEST_MESSAGE = 2**20  # of a WebSocket, to the console
CONNECTIONS = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsoleSettings:
    """Settings of a console's server.

    Parameters
    ----------
    instrument
        Initial settings.
    host, port
        Address and port; port 0 is any free one. An address open to other machines needs a certificate and a
        login.
    certificate
        Certificate for TLS; it enables logins.
    names
        Accepted host names, beside its own addresses.
    new_token
        Create a new key; the old one is no longer valid.
    """

    instrument: InstrumentSettings = field(default_factory=InstrumentSettings)
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


DRAWS = (  # what makes a report, loaded before one is asked for, also where a process replaces another
    "tsis.console.worker tsis.present.pdf tsis.records.store tsis.files.json_values matplotlib.figure "
    "matplotlib.backends.backend_agg skimage.measure skimage.filters scipy.ndimage numba"
)


def serve_console(
    settings: ConsoleSettings, *, ready: Callable[[str], None], solver: WorkerProcess | None = None
) -> None:
    """Serve a console until the process is interrupted or terminated.

    Parameters
    ----------
    settings
        Where it listens, with what, and how the instrument begins.
    ready
        Called with the address when it listens.
    solver
        Process that solves the virtual probe's presses, of `solving_process`; closed here.

    Raises
    ------
    InputError
        When the address cannot or may not be used.
    TsisError
        As `Instrument`, and when the console's key, logins or certificate cannot be used.
    """
    with _terminated_as_interrupted():
        address, tls, logins = _permitted(settings)
        folder = console_folder()
        with listen(address, settings.port) as listener:  # before a new key, so that a failure here ends no session
            token = saved_token(new=settings.new_token, folder=folder)
            access = Access(
                token,
                sessions=Sessions(token, folder=folder),
                logins=logins,
                port=listener.getsockname()[1],
                secure=tls is not None,
            )
            share_memory_among_threads()
            worker = WorkerProcess(loads=DRAWS)  # of reports; it fills the caches of the first estimate
            solver = solver or solving_process()
            with logging_to(folder), closing(worker), closing(solver), Instrument(settings.instrument) as instrument:
                instrument.before_estimates = warm_up_once(worker)
                instrument.camera_controller.solver = solver
                instrument.camera_controller.prepare()
                hosts = (*OWN_NAMES, *settings.names)
                application = console_app(instrument, access=access, hosts=hosts, worker=worker)
                scheme, port = "http" if tls is None else "https", listener.getsockname()[1]
                ready(f"{scheme}://{public_host(address, settings.names)}:{port}/?token={token}")
                # The server has ended in order, and raises the interruption that ended it.
                with collecting_garbage(), suppress(KeyboardInterrupt):
                    uvicorn.Server(_config(application, tls)).run(sockets=[listener])


def warm_up_once(worker: WorkerProcess) -> Callable[[str], None]:
    """A function that warms up the estimates of a probe in the background, once for each; a failure is only logged."""
    begun: set[str] = set()

    def warm(probe: str) -> None:
        try:
            worker.call(warm_up, probe)
        except (TsisError, RuntimeError) as error:
            logging.getLogger(__name__).info("estimates of %s were not warmed up: %s", probe, error)

    def begin(probe: str) -> None:
        if probe and probe not in begun:
            begun.add(probe)
            threading.Thread(target=warm, args=(probe,), name="warm-up", daemon=True).start()

    return begin


def _permitted(settings: ConsoleSettings) -> tuple[str, ssl.SSLContext | None, Logins | None]:
    """The address to listen on, TLS and logins; a network needs both."""
    address = resolve_host(settings.host)
    tls = None if settings.certificate is None else settings.certificate.context()
    logins = None if tls is None else Logins()
    if not is_loopback(address) and (tls is None or logins is None or not logins.names()):
        raise InputError(
            f"host must be an address of this machine alone, as {LOOPBACK}, unless a certificate and "
            f"a login are there; got {settings.host} (give --certificate and --key, and "
            "add a login with tsis login add NAME)"
        )
    return address, tls, logins


def _config(application: ASGIApp, tls: ssl.SSLContext | None) -> uvicorn.Config:
    return uvicorn.Config(
        application,
        http=TimeoutProtocol,  # by h11, which bounds headers; the quicker parser does not
        ws="websockets-sansio",  # which recognises malformed requests for a WebSocket
        h11_max_incomplete_event_size=LARGEST_HEADERS,
        ws_max_size=LARGEST_MESSAGE,
        ws_per_message_deflate=False,  # frames do not shrink
        limit_concurrency=CONNECTIONS,
        proxy_headers=False,  # there is none
        log_config=None,
        access_log=False,
        server_header=False,
        timeout_keep_alive=KEPT_S,
        timeout_graceful_shutdown=END_S,
        ssl_context_factory=None if tls is None else lambda *_: tls,
    )


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """Treat termination as an interruption, so that running work is finished."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


SILENCE_S = 10.0
KEPT_S = 75  # an answered connection is kept so long, as other servers do: a script rarely pauses for longer
SILENT = 64  # connections of one address that have sent no request
NOT_OPENED = "A WebSocket is asked for by GET, without a body, and with few and short headers."


class TimeoutProtocol(H11Protocol):
    """uvicorn's HTTP protocol with a timeout for connections without a request, which make room for new ones."""

    silence_s = SILENCE_S
    _numbers = itertools.count()

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._last_cycle: object = None
        self._awaited = True  # a whole request, at the last check
        self._number = next(self._numbers)

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to watch a connection; where its address has too many silent ones, or all are in use, close the oldest.

        One that never sent a request is closed before one that waits for its next.
        """
        super().connection_made(transport)
        self.loop.call_later(self.silence_s, self._check)
        others = {item for item in self.connections if isinstance(item, TimeoutProtocol)} - {self}
        waiting = sorted((item for item in others if item.waits()), key=lambda item: (bool(item.cycle), item._number))
        silent = [item for item in waiting if not item.cycle and (item.client or ())[:1] == (self.client or ())[:1]]
        full = len(self.connections) >= CONNECTIONS - 1
        for item in silent[:1] if len(silent) >= SILENT else waiting[:full]:
            self.connections.discard(item)
            item.transport.abort()

    def waits(self) -> bool:
        """Whether no request is under way."""
        return self.cycle is None or self.cycle.response_complete

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Answer a request that cannot become a WebSocket: uvicorn sends nothing, and no timeout applies any more."""
        super().handle_websocket_upgrade(event)
        understood = getattr(self.transport.get_protocol(), "handshake_initiated", True)
        if not understood and not self.transport.is_closing():
            self.send_400_response(NOT_OPENED)

    def _check(self) -> None:
        if self not in self.connections:  # it was closed, or has become a WebSocket
            return
        # An answered connection without a byte of the next request has a timer of uvicorn, which ends it later.
        # To end it here could meet the next request on its way.
        awaits = self.waits() and self.timeout_keep_alive_task is None
        if awaits and self._awaited and self.cycle is self._last_cycle:  # no whole request since the last check
            self.transport.close()
            return
        self._last_cycle, self._awaited = self.cycle, awaits
        self.loop.call_later(self.silence_s, self._check)

"""The server of a console: where it listens, its certificate and log, silent connections, and its end."""

from __future__ import annotations

import asyncio
import logging
import os
import re
import signal
import socket
import ssl
import subprocess
import sys
import threading
from contextlib import ExitStack, closing
from http.client import HTTPConnection
from pathlib import Path
from typing import TYPE_CHECKING

import httpx
import pytest
import uvicorn
from tests.console.browser import needs_browser
from tests.console.plain_requests import upgraded
from tests.console.running import running_console
from tests.console.tls import OPENSSL
from tests.waiting import HANGS_S

from tsis.console import serving as serving
from tsis.console.auth import FOLDER, Access, AuthMiddleware, Logins, saved_token
from tsis.console.serving import (
    CONNECTIONS,
    FILE,
    SILENT,
    Certificate,
    ConsoleSettings,
    TimeoutProtocol,
    is_loopback,
    listen,
    logging_to,
    public_host,
    resolve_host,
    serve_console,
)
from tsis.errors import FileInputError, InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser
    from starlette.types import ASGIApp, Message, Receive, Scope, Send


PASSWORD = "correct horse battery"
ELSEWHERE = "192.0.2.1"  # an address that no machine has


def refused(terms: ConsoleSettings) -> str:
    """The sentence with which these are refused, before anything is opened."""
    with pytest.raises(InputError) as caught:
        serve_console(terms, ready=lambda _: pytest.fail("it listens"))
    return str(caught.value)


@pytest.mark.system
def test_a_network_is_refused_without_a_certificate_and_a_login(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, certificate: tuple[Path, Path]
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    tls = Certificate(chain=certificate[0], key=certificate[1])
    expected = "unless a certificate and a login are there"
    for host in ("0.0.0.0", "::", ELSEWHERE):
        assert expected in refused(ConsoleSettings(host=host))
        assert expected in refused(ConsoleSettings(host=host, certificate=tls))
    Logins(tmp_path).add("anna", PASSWORD)
    assert expected in refused(ConsoleSettings(host=ELSEWHERE))
    # With both it gets as far as the socket, and this machine has no such address.
    assert "must be free" in refused(ConsoleSettings(host=ELSEWHERE, certificate=tls))


@pytest.mark.parametrize("name", ["", "lab.example:80", "http://lab.example", "a b", "lab.example/x", "*"])
def test_names_of_a_console_are_plain(name: str) -> None:
    with pytest.raises(InputError, match="name of a host must be"):
        ConsoleSettings(names=(name,))


@pytest.mark.parametrize("port", [-1, 65536, 1.5, True])
def test_ports_are_ports(port: float) -> None:
    with pytest.raises(InputError, match="port must"):
        ConsoleSettings(port=port)  # type: ignore[arg-type]


def test_only_loopback_is_loopback() -> None:
    assert all(is_loopback(item) for item in ("127.0.0.1", "127.8.9.1", "::1"))
    assert not any(is_loopback(item) for item in ("0.0.0.0", "::", "192.0.2.1", "fe80::1%eth0", "10.0.0.1"))
    assert is_loopback(resolve_host("localhost"))
    with pytest.raises(InputError, match="must be an address of this machine"):
        resolve_host("no such name")


@pytest.mark.system
def test_the_second_to_want_a_port_is_told_at_once() -> None:
    with listen("127.0.0.1", 0) as first:
        port = first.getsockname()[1]
        with pytest.raises(InputError, match=rf"port {port} of 127\.0\.0\.1 must be free; got: .+--port"):
            listen("127.0.0.1", port)
        socket.create_connection(
            ("127.0.0.1", port)
        ).close()  # who comes while it is prepared waits, and is not refused


@pytest.mark.system
def test_a_console_that_cannot_listen_leaves_the_key_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    key = saved_token()
    with listen("127.0.0.1", 0) as first:
        assert "must be free" in refused(ConsoleSettings(port=first.getsockname()[1], new_token=True))
    assert saved_token() == key


@pytest.mark.system
def test_logins_load_no_page_and_no_server() -> None:
    requested = "import sys; from tsis.console.auth import Logins; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", requested], capture_output=True, text=True, check=True)
    assert not {"nicegui", "fastapi", "uvicorn", "tsis.console.services", "tsis.records"} & set(done.stdout.split())


def test_the_address_that_is_shown() -> None:
    assert public_host("0.0.0.0", ("lab.example", "other")) == "lab.example"
    assert public_host("0.0.0.0", ()) == "127.0.0.1"
    assert public_host("2001:db8::1", ()) == "[2001:db8::1]"


def test_a_certificate_speaks_nothing_old(certificate: tuple[Path, Path]) -> None:
    assert Certificate(chain=certificate[0], key=certificate[1]).context().minimum_version == ssl.TLSVersion.TLSv1_2


@pytest.mark.system
def test_certificates_that_will_not_do_are_one_sentence(certificate: tuple[Path, Path], tmp_path: Path) -> None:
    assert OPENSSL is not None
    chain, key = certificate
    (tmp_path / "text").write_text("no certificate")
    locked, other = tmp_path / "locked", tmp_path / "other"
    subprocess.run(
        [OPENSSL, "pkey", "-in", str(key), "-aes256", "-passout", "pass:hush", "-out", str(locked)], check=True
    )
    subprocess.run(
        [OPENSSL, "genpkey", "-algorithm", "EC", "-pkeyopt", "ec_paramgen_curve:P-256", "-out", str(other)],
        check=True, capture_output=True,
    )  # fmt: skip
    wrong = {
        (tmp_path / "none", key): "certificate must be a file",
        (chain, tmp_path / "none"): "key must be a file",
        (chain, tmp_path): "key must be a file",
        (tmp_path / "text", key): "must hold a certificate and its key",
        (chain, tmp_path / "text"): "must hold a certificate and its key",
        (chain, other): "must hold a certificate and its key",
        (chain, locked): "must not be locked by a password",
    }
    for (item, its), message in wrong.items():
        with pytest.raises(FileInputError, match=message):
            Certificate(chain=item, key=its).context()


def test_who_came_in_is_in_the_file_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    controller, other = logging.getLogger("tsis.console.auth"), logging.getLogger("uvicorn.error")
    with logging_to(tmp_path):
        controller.info("anna logged in from 192.0.2.7")
        other.log(logging.INFO, "a connection was opened")
        controller.warning("a login from 192.0.2.8 failed")
    controller.info("bert logged in from 192.0.2.9")
    whole = (tmp_path / FILE).read_text()
    assert [line.split(": ", 1)[1] for line in whole.splitlines()] == [
        "anna logged in from 192.0.2.7",
        "a login from 192.0.2.8 failed",
    ]
    assert capsys.readouterr().err == "Warning: a login from 192.0.2.8 failed\n"


def test_an_error_is_a_sentence_on_the_terminal_and_a_story_in_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with logging_to(tmp_path):
        try:
            int("a reason\nin lines")
        except ValueError:
            logging.getLogger("tsis.console.app").exception("it failed")
    reported = capsys.readouterr().err
    assert reported.startswith("Error: it failed: ValueError: invalid literal")
    assert reported.count("\n") == 1
    assert "Traceback" in (tmp_path / FILE).read_text()


@pytest.mark.system
@pytest.mark.parametrize("requested", [b"GET / HTTP/1.1\r\nHost: x\r\n\r\n", b"\x00\x01\x02\r\n\r\n"])
def test_nothing_is_said_of_what_waits_when_the_console_ends_nor_of_noise(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, requested: bytes
) -> None:
    monkeypatch.setattr(serving, "END_S", 0)
    begun = asyncio.Event()

    async def waiting(scope: Scope, receive: Receive, send: Send) -> None:
        begun.set()
        await asyncio.Event().wait()

    async def served() -> None:
        with listen("127.0.0.1", 0) as listener:
            server = uvicorn.Server(serving._config(waiting, None))
            server.config.lifespan = "off"
            running = asyncio.create_task(server._serve([listener]))
            reader, writer = await asyncio.open_connection(*listener.getsockname())
            writer.write(requested)
            if requested.startswith(b"GET"):
                await begun.wait()
            else:
                await reader.read()
            server.should_exit = True
            await running
            writer.close()

    with logging_to(tmp_path):
        asyncio.run(served())
    assert capsys.readouterr().err == ""
    assert not (tmp_path / FILE).exists()


CHECKS = 4


class Hurried(TimeoutProtocol):
    """Looks often, and says when it has looked a few times at a request under way."""

    silence_s = 0.02
    checks = 0
    looked: asyncio.Event

    def _check(self) -> None:
        super()._check()
        if self.cycle is not None and not self.cycle.response_complete:
            Hurried.checks += 1
            if Hurried.checks == CHECKS:
                Hurried.looked.set()


async def slow(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer only when several looks have gone by."""
    Hurried.checks, Hurried.looked = 0, asyncio.Event()
    await Hurried.looked.wait()
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"4")]})
    await send({"type": "http.response.body", "body": b"done"})


async def quick(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer at once."""
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"4")]})
    await send({"type": "http.response.body", "body": b"done"})


class Patient(TimeoutProtocol):
    """Never ends silence by itself: only what needs the room does."""

    silence_s = 1e6


@pytest.fixture
def port() -> Iterator[int]:
    yield from served(slow, Hurried)


@pytest.fixture
def patient_port() -> Iterator[int]:
    yield from served(quick, Patient)


def served(application: ASGIApp, protocol: type[TimeoutProtocol]) -> Iterator[int]:
    with listen("127.0.0.1", 0) as listener:
        config = uvicorn.Config(
            application,
            http=protocol,
            log_config=None,
            lifespan="off",
            timeout_keep_alive=1000,
            limit_concurrency=CONNECTIONS,
        )
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        yield listener.getsockname()[1]
        server.should_exit = True
        thread.join()


@pytest.mark.system
@pytest.mark.parametrize("reported", [b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: x\r\nX: y\r\n"])
def test_silence_is_ended(port: int, reported: bytes) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=30) as connection:
        connection.sendall(reported)
        assert connection.recv(1) == b""


def closed(connections: list[socket.socket]) -> list[bool]:
    """Which of the connections the server has ended."""
    found = []
    for connection in connections:
        connection.setblocking(False)
        try:
            found.append(connection.recv(1) == b"")
        except BlockingIOError:
            found.append(False)
        except ConnectionResetError:
            found.append(True)
    return found


@pytest.mark.system
@pytest.mark.parametrize("begun", [b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: x\r\nX: y\r\n"])
def test_six_hundred_silent_connections_of_one_address_keep_nobody_out(patient_port: int, begun: bytes) -> None:
    with ExitStack() as stack:
        crowd = []
        for _ in range(600):
            crowd.append(stack.enter_context(socket.create_connection(("127.0.0.1", patient_port), timeout=60)))
            crowd[-1].sendall(begun)
        assert [httpx.get(f"http://127.0.0.1:{patient_port}/", timeout=60).text for _ in range(20)] == ["done"] * 20
        ended = closed(crowd)
    assert 600 - sum(ended) <= SILENT
    assert not any(ended[-SILENT // 2 :])  # the newest have their time to ask


@pytest.mark.system
def test_connections_that_wait_for_their_next_request_make_room(patient_port: int) -> None:
    def answered(connection: HTTPConnection) -> tuple[int, bytes]:
        connection.request("GET", "/")
        answer = connection.getresponse()
        return answer.status, answer.read()

    crowd = [HTTPConnection("127.0.0.1", patient_port, timeout=60) for _ in range(CONNECTIONS + 20)]
    assert {answered(each) for each in crowd} == {(200, b"done")}
    assert answered(crowd[-1]) == (200, b"done")  # as it stays open
    for each in crowd:
        each.close()


@pytest.mark.system
def test_an_answer_that_takes_long_is_waited_for(port: int) -> None:
    assert httpx.get(f"http://127.0.0.1:{port}/", timeout=30).text == "done"
    assert Hurried.checks == CHECKS


@pytest.mark.system
def test_an_answered_connection_is_kept_for_the_next_request(port: int) -> None:
    with closing(HTTPConnection("127.0.0.1", port, timeout=30)) as kept:
        for _ in range(3):
            kept.request("GET", "/")  # on a closed connection this fails: nothing opens it again
            assert kept.getresponse().read() == b"done"
            assert httpx.get(f"http://127.0.0.1:{port}/", timeout=30).text == "done"  # which takes several looks


@pytest.mark.system
def test_an_answered_connection_that_never_ends_its_next_request_is_ended(port: int) -> None:
    with closing(HTTPConnection("127.0.0.1", port, timeout=30)) as kept:
        kept.request("GET", "/")
        assert kept.getresponse().read() == b"done"
        kept.sock.sendall(b"GET / HT")
        assert kept.sock.recv(1) == b""


def test_a_login_that_is_never_sent_whole_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tsis.console.auth.FORM_S", 0.05)
    logins = Logins(tmp_path)
    logins.add("anna", "correct horse battery")
    guarded_app, sent = AuthMiddleware(slow, access=Access("t" * 43, logins=logins), hosts=("127.0.0.1",)), []

    async def receive() -> Message:
        await asyncio.Event().wait()
        raise AssertionError

    async def send(message: Message) -> None:
        sent.append(message)

    scope = {"type": "http", "method": "POST", "path": "/login", "scheme": "http", "query_string": b"",
             "headers": [(b"host", b"127.0.0.1")], "client": ("192.0.2.7", 1), "server": ("127.0.0.1", 1)}  # fmt: skip
    asyncio.run(guarded_app(scope, receive, send))
    assert sent[0]["status"] == 400


@pytest.mark.system
@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_with_pages_open_and_says_nothing_of_it(
    tmp_path: Path, browser: Browser, number: signal.Signals
) -> None:
    with running_console(tmp_path) as console:
        pages = [browser.new_context().new_page() for _ in range(2)]
        for page in pages:
            page.goto(console.entrance)
            page.get_by_role("navigation", name="Groups of pages").wait_for()
        pages[0].get_by_role("button", name="Release the camera").wait_for()
        pages[0].get_by_role("button", name=re.compile("^Start")).first.click()
        pages[0].get_by_text(re.compile(r"^\d+ frames/s, ")).wait_for()
        console.process.send_signal(number)
        assert console.process.wait(HANGS_S) == 0
        assert (tmp_path / "console.log").read_text() == ""
        assert not (tmp_path / "user" / "console.log").exists()
    for page in pages:
        page.context.close()


@pytest.mark.system
@pytest.mark.slow
def test_a_page_stays_open_when_the_console_is_started_anew(tmp_path: Path) -> None:
    with running_console(tmp_path) as console:
        port = httpx.URL(console.address).port
        with httpx.Client(base_url=console.address, timeout=HANGS_S) as user:
            user.get(f"/?token={console.token}")
            cookies = dict(user.cookies)
        first = console.token
    headers = {"Cookie": "; ".join(f"{name}={value}" for name, value in cookies.items())}
    with running_console(tmp_path, "--port", str(port)) as console:
        assert console.token == first
        assert httpx.get(console.address + "/records", headers=headers, timeout=HANGS_S).status_code == 200
        assert upgraded(console.address, "/live", headers) == 101
    with running_console(tmp_path, "--port", str(port), "--new-token") as console:
        assert console.token != first
        assert httpx.get(console.address + "/records", headers=headers, timeout=HANGS_S).status_code == 401
        assert httpx.get(f"{console.address}/?token={first}", timeout=HANGS_S).status_code == 401


@pytest.mark.system
@pytest.mark.slow
def test_a_port_that_is_taken_is_one_sentence(tmp_path: Path) -> None:
    with listen("127.0.0.1", 0) as other:
        port = other.getsockname()[1]
        second = subprocess.run(
            [str(Path(sys.executable).with_name("tsis")), "console", "--no-browser", "--port", str(port)],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "TSIS_CONSOLE_DIR": str(tmp_path / "user")},
            check=False,
        )
    assert second.returncode == 2
    assert second.stderr.startswith(f"Error: port {port} of 127.0.0.1 must be free; got: ")
    assert second.stderr.count("\n") == 1
    assert not (tmp_path / "tsis-console").exists()


@pytest.mark.system
@pytest.mark.slow
def test_what_is_printed_for_programs_is_one_document(tmp_path: Path) -> None:
    with running_console(tmp_path) as console:
        assert console.address.startswith("http://127.0.0.1:")
        assert len(console.token) == 43
        console.process.send_signal(signal.SIGINT)
        rest, _ = console.process.communicate()
    assert rest == ""

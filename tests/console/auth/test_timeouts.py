"""Connections that say nothing, or only a part, against a real server."""

from __future__ import annotations

import asyncio
import socket
import threading
from contextlib import ExitStack
from http.client import HTTPConnection
from typing import TYPE_CHECKING

import httpx
import pytest
import uvicorn

from tsis.console.auth import Access, AuthMiddleware, Logins
from tsis.console.serving import CONNECTIONS, SILENT, TimeoutProtocol, listen

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from starlette.types import ASGIApp, Message, Receive, Scope, Send


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

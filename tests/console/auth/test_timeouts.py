"""Connections that say nothing, or only a part, against a real server."""

from __future__ import annotations

import asyncio
import socket
import threading
from typing import TYPE_CHECKING

import httpx
import pytest
import uvicorn

from tsis.console._serving import TimeoutProtocol, listen
from tsis.console.auth import Access, AuthMiddleware, Logins

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from starlette.types import Message, Receive, Scope, Send


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


@pytest.fixture
def port() -> Iterator[int]:
    with listen("127.0.0.1", 0) as listener:
        config = uvicorn.Config(slow, http=Hurried, log_config=None, lifespan="off", timeout_keep_alive=60)
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


@pytest.mark.system
def test_an_answer_that_takes_long_is_waited_for(port: int) -> None:
    assert httpx.get(f"http://127.0.0.1:{port}/", timeout=30).text == "done"
    assert Hurried.checks == CHECKS


def test_a_login_that_is_never_sent_whole_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tsis.console.auth._login_routes.FORM_S", 0.05)
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

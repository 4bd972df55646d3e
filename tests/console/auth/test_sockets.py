"""WebSockets behind the gate: counted, refused with an answer, and cut when whoever opened them may not stay."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from tests.waiting import HANGS_S

from tsis.console.auth import DENIAL, MOST_SOCKETS, Access, AuthMiddleware, OpenSockets

if TYPE_CHECKING:
    from collections.abc import Callable

    import pytest
    from starlette.types import Message, Receive, Scope, Send

TOKEN = "t" * 43


class Peer:
    """The other end of a WebSocket: what it was sent, and a receive that waits for ever."""

    def __init__(self) -> None:
        self.sent: list[Message] = []

    async def send(self, message: Message) -> None:
        self.sent.append(message)

    async def receive(self) -> Message:
        await asyncio.Event().wait()
        raise AssertionError

    @property
    def kinds(self) -> list[str]:
        return [message["type"] for message in self.sent]


async def accepting(_: Scope, receive: Receive, send: Send) -> None:
    """Accept, then wait."""
    await send({"type": "websocket.accept"})
    await receive()


async def failing(_scope: Scope, _receive: Receive, send: Send) -> None:
    await send({"type": "websocket.accept"})
    raise RuntimeError("secret")


def scope(headers: dict[str, str], **others: Any) -> dict[str, Any]:
    requested = {"host": "127.0.0.1", **headers}
    raw = [(name.encode(), value.encode()) for name, value in requested.items()]
    return {"type": "websocket", "path": "/live", "scheme": "ws", "query_string": b"", "headers": raw, **others}


def key(access: Access) -> dict[str, str]:
    return {"cookie": access.cookie().partition(";")[0]}


async def for_ever() -> None:
    await asyncio.Event().wait()


async def settled() -> None:
    for _ in range(5):
        await asyncio.sleep(0)


def test_refused_sockets_are_closed_or_answered() -> None:
    async def tried() -> None:
        guarded_app, plain, answered = (
            AuthMiddleware(accepting, access=Access(TOKEN), hosts=("127.0.0.1",)),
            Peer(),
            Peer(),
        )
        await guarded_app(scope({}), plain.receive, plain.send)
        assert plain.sent == [{"type": "websocket.close", "code": 1008}]
        await guarded_app(scope({}, extensions={DENIAL: {}}), answered.receive, answered.send)
        assert answered.kinds == ["websocket.http.response.start", "websocket.http.response.body"]
        assert answered.sent[0]["status"] == 401
        assert b"content-security-policy" in dict(answered.sent[0]["headers"])

    asyncio.run(tried())


def test_a_session_that_ends_takes_its_sockets_with_it_and_no_others() -> None:
    async def tried() -> None:
        access = Access(TOKEN)
        guarded_app = AuthMiddleware(accepting, access=access, hosts=("127.0.0.1",))
        first, second = key(access), key(access)
        peers = [Peer(), Peer(), Peer()]
        tasks = [
            asyncio.create_task(guarded_app(scope(headers), peer.receive, peer.send))
            for headers, peer in zip((first, second, first), peers, strict=True)
        ]
        await settled()
        guarded_app._sockets.check()
        await settled()
        assert [peer.kinds for peer in peers] == [["websocket.accept"]] * 3
        session = access.session(first)
        assert session is not None
        access.sessions.end(session)
        guarded_app._sockets.check()
        await settled()
        assert [task.done() for task in tasks] == [True, False, True]
        assert peers[0].sent[-1] == {"type": "websocket.close", "code": 1008}
        assert peers[1].kinds == ["websocket.accept"]
        tasks[1].cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        assert tasks[1].cancelled()  # the end of the server is not taken for the end of a session

    asyncio.run(tried())


def test_there_is_an_end_to_sockets() -> None:
    async def tried() -> None:
        access = Access(TOKEN)
        guarded_app, headers = AuthMiddleware(accepting, access=access, hosts=("127.0.0.1",)), key(access)
        peers = [Peer() for _ in range(MOST_SOCKETS)]
        tasks = [asyncio.create_task(guarded_app(scope(headers), peer.receive, peer.send)) for peer in peers]
        await settled()
        late = Peer()
        await guarded_app(scope(headers, extensions={DENIAL: {}}), late.receive, late.send)
        assert late.sent[0]["status"] == 503
        tasks[0].cancel()
        await settled()
        again = Peer()
        tasks.append(asyncio.create_task(guarded_app(scope(headers), again.receive, again.send)))
        await settled()
        assert again.kinds == ["websocket.accept"]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    asyncio.run(tried())


def test_a_socket_that_fails_is_closed() -> None:
    async def tried() -> None:
        access, peer = Access(TOKEN), Peer()
        await AuthMiddleware(failing, access=access, hosts=("127.0.0.1",))(scope(key(access)), peer.receive, peer.send)
        assert peer.kinds == ["websocket.accept", "websocket.close"]

    asyncio.run(tried())


def test_the_watch_goes_on_whatever_it_meets_until_it_is_told_to_end(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("tsis.console.auth.CHECK_EVERY_S", 0.0)

    def unknown() -> bool:
        raise OSError("the disk is gone")

    async def tried() -> None:
        sockets, over = OpenSockets(), asyncio.Event()
        watch = asyncio.create_task(sockets.watch())

        async def served(stays: Callable[[], bool]) -> bool:
            return await sockets.serve(for_ever(), stays=stays)

        stays = asyncio.create_task(served(lambda: not over.is_set()))
        assert await asyncio.wait_for(served(unknown), HANGS_S)  # who cannot be asked about does not stay
        assert not stays.done()
        over.set()
        assert await asyncio.wait_for(stays, HANGS_S)
        assert not watch.done()
        watch.cancel()
        await watch

    asyncio.run(tried())
    assert [str(record.exc_info[1]) for record in caplog.records if record.exc_info] == ["the disk is gone"]

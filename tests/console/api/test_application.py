"""The calls are built late: by the first of them, or a while after the start."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from unittest.mock import MagicMock

import pytest
from tests.waiting import until

import tsis.console.api.application  # noqa: F401 - a library that it loads starts a process, which no test may
from tsis.console import api
from tsis.console.api import Calls


@pytest.fixture
def calls() -> Calls:
    return Calls(MagicMock(), MagicMock())


def built(calls: Calls) -> bool:
    return vars(calls)["_application"] is not None


def test_the_first_call_builds_them(calls: Calls) -> None:
    sent: list[Any] = []

    async def called() -> None:
        async def receive() -> Any:
            return {"type": "http.request"}

        async def send(message: Any) -> None:
            sent.append(message)

        scope = {"type": "http", "method": "GET", "path": "/openapi.json", "query_string": b"", "headers": []}
        await calls(scope, receive, send)

    assert not built(calls)
    asyncio.run(called())
    assert built(calls)
    assert sent[0]["status"] == 200


def test_calls_that_come_together_have_one_application(calls: Calls) -> None:
    with ThreadPoolExecutor(4) as pool:
        first, *others = pool.map(lambda _: calls.application, range(4))
    assert all(each is first for each in others)


def test_they_are_built_soon_after_the_start(calls: Calls, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(api, "SOON_S", 0.0)
    with calls.built_soon():
        until(lambda: built(calls))


def test_a_console_that_ends_at_once_builds_none(calls: Calls) -> None:
    with calls.built_soon():
        assert not built(calls)
    assert not built(calls)

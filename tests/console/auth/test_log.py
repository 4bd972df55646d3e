"""What the log tells, where, and of what it says nothing."""

from __future__ import annotations

import asyncio
import logging
from typing import TYPE_CHECKING

import pytest
import uvicorn

from tsis.console import serving as serving
from tsis.console.serving import FILE, listen, logging_to

if TYPE_CHECKING:
    from pathlib import Path

    from starlette.types import Receive, Scope, Send


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

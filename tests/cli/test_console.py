"""``tsis console``: what it prints and what it opens, around a server that the test stands in for."""

from __future__ import annotations

import gc
import json
import queue
import webbrowser
from typing import TYPE_CHECKING

import pytest
from tests.waiting import HANGS_S

from tsis.console import serving as serving
from tsis.console.auth import FOLDER

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.cli.conftest import RunTsis

    from tsis.console import ConsoleSettings
    from tsis.console.worker import WorkerProcess

TOKEN = "t" * 43
ADDRESS = f"http://127.0.0.1:8642/?token={TOKEN}"


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, idle_solver: WorkerProcess) -> queue.Queue[str]:
    """What a browser was told to open while the console was served."""
    result: queue.Queue[str] = queue.Queue()
    found: queue.Queue[str] = queue.Queue()

    def served(_: ConsoleSettings, *, ready: Callable[[str], None], solver: WorkerProcess | None) -> None:
        assert solver is idle_solver
        ready(ADDRESS)
        found.put(result.get(timeout=HANGS_S))

    monkeypatch.setenv(FOLDER, str(tmp_path / "user"))
    monkeypatch.setattr(webbrowser, "open", result.put)
    monkeypatch.setattr(serving, "serve_console", served)
    monkeypatch.setattr(gc, "freeze", lambda: None)  # this process goes on
    return found


def test_the_address_that_is_opened_does_not_hold_the_key(
    run_tsis: RunTsis, opened: queue.Queue[str], tmp_path: Path
) -> None:
    ended = run_tsis("console")
    assert ended.code == 0
    assert f"Open {ADDRESS}" in ended.out
    address = opened.get_nowait()
    assert address == (tmp_path / "user" / "open-8642.html").as_uri()
    assert not list((tmp_path / "user").iterdir())


@pytest.mark.parametrize("options", [("--no-browser",), ("--json",)])
def test_who_wants_no_browser_gets_none(
    run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch, opened: queue.Queue[str], options: tuple[str, ...]
) -> None:
    monkeypatch.setattr(serving, "serve_console", lambda _, ready, solver: ready(ADDRESS))
    monkeypatch.setattr("tsis.console.app.opened_in_browser", lambda _: pytest.fail("it opens a browser"))
    ended = run_tsis("console", *options)
    assert ended.code == 0
    assert ADDRESS in (json.loads(ended.out)["address"] if "--json" in options else ended.out)
    assert opened.empty()


def test_no_garbage_is_collected_until_all_is_loaded(
    run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch, opened: queue.Queue[str]
) -> None:
    collected = []

    def served(_: ConsoleSettings, *, ready: Callable[[str], None], **_named: object) -> None:
        collected.append(gc.isenabled())
        ready(ADDRESS)
        collected.append(gc.isenabled())

    monkeypatch.setattr(serving, "serve_console", served)
    assert run_tsis("console", "--no-browser").code == 0
    assert collected == [False, True]
    assert opened.empty()


@pytest.mark.parametrize(("camera", "times"), [("virtual", 1), ("opencv:0", 0)])
def test_only_the_virtual_probe_begins_a_solving_process(
    run_tsis: RunTsis, idle_solver: WorkerProcess, monkeypatch: pytest.MonkeyPatch, camera: str, times: int
) -> None:
    begun: list[str] = []
    monkeypatch.setattr(idle_solver, "begin", lambda: begun.append(camera))
    monkeypatch.setattr(serving, "serve_console", lambda _, ready, solver: ready(ADDRESS))
    assert run_tsis("console", "--no-browser", "--camera", camera).code == 0
    assert len(begun) == times


@pytest.mark.usefixtures("idle_solver")
def test_garbage_is_collected_again_after_a_refusal(run_tsis: RunTsis) -> None:
    assert run_tsis("console", "--no-browser", "--probe", "no-such-probe").code == 2
    assert gc.isenabled()

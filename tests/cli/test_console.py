"""``tsis console`` and ``tsis login``: what they print and open, around a server that the test stands in for."""

from __future__ import annotations

import gc
import io
import json
import queue
import sys
import webbrowser
from typing import TYPE_CHECKING

import pytest
from tests.waiting import HANGS_S

from tsis.console import serving as serving
from tsis.console.auth import FOLDER, Logins

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.cli.conftest import RunTsis

    from tsis.console.serving import ConsoleSettings
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


PASSWORD = "correct horse battery"


@pytest.fixture
def logins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Logins:
    """The logins that the program works on."""
    monkeypatch.setenv(FOLDER, str(tmp_path / "user"))
    return Logins(tmp_path / "user")


def typed(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))


def test_a_login_is_added_listed_changed_and_removed(
    run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch, logins: Logins
) -> None:
    assert "No logins yet" in run_tsis("login", "list").out
    typed(monkeypatch, f"{PASSWORD}\n")
    assert "anna may log in" in run_tsis("login", "add", "anna").out
    assert logins.check("anna", PASSWORD) is not None
    typed(monkeypatch, "another long password\r\n")
    assert "has a new password" in run_tsis("login", "add", "anna").out
    assert logins.check("anna", PASSWORD) is None
    assert logins.check("anna", "another long password") is not None
    listed = json.loads(run_tsis("login", "list", "--json").out)
    assert [each["name"] for each in listed["logins"]] == ["anna"]
    assert "Research use only" in json.dumps(listed)
    assert "argon2" not in json.dumps(listed)
    assert "anna" in run_tsis("login", "list").out
    assert run_tsis("login", "remove", "anna").code == 0
    assert logins.names() == ()


@pytest.mark.parametrize(
    ("arguments", "line", "said"),
    [
        (("add", "anna"), "short\n", "password must have 12 to 1024 characters; got 5"),
        (("add", "anna"), "", "password must have 12 to 1024 characters; got 0"),
        (("add", "an na"), f"{PASSWORD}\n", "name must be 1 to 40 letters"),
        (("add", "../anna"), f"{PASSWORD}\n", "name must be 1 to 40 letters"),
        (("remove", "bob"), "", "name must be one of no logins at all; got 'bob'"),
        (("add", "anna", PASSWORD), "", "unexpected extra argument"),
    ],
)
def test_what_will_not_do_is_one_sentence(
    run_tsis: RunTsis,
    monkeypatch: pytest.MonkeyPatch,
    logins: Logins,
    arguments: tuple[str, ...],
    line: str,
    said: str,
) -> None:
    typed(monkeypatch, line)
    ended = run_tsis("login", *arguments)
    assert ended.code == 2
    assert said in ended.err.replace("Got", "got")
    assert ended.err.strip().count("\n") == 0
    assert logins.names() == ()


def test_a_file_that_others_can_read_is_refused(
    run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch, logins: Logins, tmp_path: Path
) -> None:
    logins.add("anna", PASSWORD)
    (tmp_path / "user" / "logins.json").chmod(0o644)
    typed(monkeypatch, f"{PASSWORD}\n")
    for arguments in (("list",), ("add", "bert"), ("remove", "anna")):
        assert "chmod 600" in run_tsis("login", *arguments).err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--certificate", "a.pem"), "certificate and key must be given together"),
        (("--key", "a.pem"), "certificate and key must be given together"),
        (("--certificate", "a.pem", "--key", "b.pem"), "certificate must be a file in PEM"),
        (("--host", "192.0.2.1"), "unless a certificate and a login are there"),
        (("--host", ""), "host must"),
        (("--allow-host", "a:1"), "name of a host must be"),
        (("--port", "70000"), "65535"),
    ],
)
@pytest.mark.usefixtures("logins", "idle_solver")
def test_a_console_that_may_not_listen_so_says_why(run_tsis: RunTsis, options: tuple[str, ...], said: str) -> None:
    ended = run_tsis("console", "--no-browser", *options)
    assert ended.code == 2
    assert said in ended.err
    assert ended.err.strip().count("\n") == 0

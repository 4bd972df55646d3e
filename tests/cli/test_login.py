"""``tsis login``: names and passwords, from the keyboard or a line, and what is said of wrong ones."""

from __future__ import annotations

import io
import json
import sys
from typing import TYPE_CHECKING

import pytest

from tsis.console.auth import FOLDER, Logins

if TYPE_CHECKING:
    from pathlib import Path

    from tests.cli.conftest import RunTsis

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

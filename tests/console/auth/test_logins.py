"""Names and passwords, against the reference library for argon2id and against damaged files."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import TYPE_CHECKING

import argon2.low_level
import pytest
from argon2 import extract_parameters
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.console.auth import ARGON2ID, LOGINS_FILE, MOST_LOGINS, NOBODY, Logins, write_private
from tsis.errors import FileInputError, InputError, UnknownNameError

if TYPE_CHECKING:
    from pathlib import Path

PASSWORD = "correct horse battery"


def test_the_right_password_and_no_other(tmp_path: Path) -> None:
    logins = Logins(tmp_path)
    logins.add("anna", PASSWORD)
    result = logins.check("anna", PASSWORD)
    assert result is not None
    assert result.name == "anna"
    for name, password in (("anna", PASSWORD + " "), ("anna", ""), ("Anna", PASSWORD), ("bob", PASSWORD), ("", "")):
        assert logins.check(name, password) is None


def test_what_is_kept_is_argon2id_of_the_password(tmp_path: Path) -> None:
    Logins(tmp_path).add("anna", PASSWORD)
    text = (tmp_path / LOGINS_FILE).read_text()
    assert PASSWORD not in text
    remaining = json.loads(text)["logins"][0]["hash"]
    assert argon2.low_level.verify_secret(remaining.encode(), PASSWORD.encode(), argon2.low_level.Type.ID)
    Logins(tmp_path).add("bob", PASSWORD)
    hashes = {item["hash"] for item in json.loads((tmp_path / LOGINS_FILE).read_text())["logins"]}
    assert len(hashes) == 2  # each with its own salt


def test_unknown_names_cost_what_known_ones_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert extract_parameters(NOBODY) == extract_parameters(ARGON2ID.hash(PASSWORD))
    logins = Logins(tmp_path)
    logins.add("anna", PASSWORD)
    observed: list[str] = []
    verify = ARGON2ID.verify

    def noted(_: object, remaining: str, given: str) -> bool:
        observed.append(remaining)
        return verify(remaining, given)

    monkeypatch.setattr(type(ARGON2ID), "verify", noted)
    logins.check("anna", "wrong")
    logins.check("nobody", "wrong")
    assert len(observed) == 2
    assert observed[1] == NOBODY


def test_one_password_whichever_keyboard_wrote_it(tmp_path: Path) -> None:
    logins = Logins(tmp_path)
    logins.add("anna", "Schlu\u0308ssel\u00a0bund")
    assert logins.check("anna", "Schl\u00fcssel bund") is not None


@pytest.mark.parametrize("name", ["", " anna", "an na", "anna.", "-a", "a" * 41, "a\nb", "ä", "<b>", "a;b", "a=b"])
def test_names_that_would_do_harm_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="name must be 1 to 40 letters"):
        Logins(tmp_path).add(name, PASSWORD)


@pytest.mark.parametrize("password", ["", "eleven char", "x" * 1025, " \u200b"])
def test_passwords_that_are_too_short_or_too_long_are_refused(tmp_path: Path, password: str) -> None:
    with pytest.raises(InputError, match="password must have 12 to 1024 characters"):
        Logins(tmp_path).add("anna", password)


def test_a_removed_login_is_gone_for_consoles_that_run(tmp_path: Path) -> None:
    running, program = Logins(tmp_path), Logins(tmp_path)
    program.add("anna", PASSWORD)
    result = running.check("anna", PASSWORD)
    assert result is not None
    assert running.holds("anna", result.proof)
    program.remove("anna")
    assert not running.holds("anna", result.proof)
    assert running.names() == ()
    with pytest.raises(UnknownNameError, match="'anna'"):
        program.remove("anna")


def test_there_is_an_end_to_logins(tmp_path: Path) -> None:
    remaining = [{"name": f"n{number}", "hash": NOBODY, "given": "2026-11-01"} for number in range(MOST_LOGINS)]
    write_private(tmp_path / LOGINS_FILE, json.dumps({"logins": remaining}).encode())
    with pytest.raises(InputError, match=f"at most {MOST_LOGINS}"):
        Logins(tmp_path).add("anna", PASSWORD)


@settings(max_examples=60)
@given(
    content=st.one_of(
        st.binary(max_size=80),
        st.recursive(
            st.none() | st.integers() | st.text(max_size=5),
            lambda inner: (
                st.lists(inner, max_size=3)
                | st.dictionaries(st.sampled_from(["logins", "name", "hash", "given"]), inner)
            ),
            max_leaves=6,
        ).map(lambda value: json.dumps(value).encode()),
    )
)
def test_damaged_files_are_one_sentence_and_let_nobody_in(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    folder = tmp_path_factory.mktemp("logins")
    write_private(folder / LOGINS_FILE, content)
    logins = Logins(folder)
    with suppress(FileInputError):  # anything else is an error of the test
        assert logins.names() == ()
    assert not logins.holds("anna", "")


@pytest.mark.parametrize("content", [b"{", b"[]", b'{"logins": [{"name": "anna"}]}', b'{"logins": 3}'])
def test_damaged_files_are_named_with_a_cure(tmp_path: Path, content: bytes) -> None:
    write_private(tmp_path / LOGINS_FILE, content)
    with pytest.raises(FileInputError, match=r"it is damaged \(remove it and add them again\)"):
        Logins(tmp_path).names()

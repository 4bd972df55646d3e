"""Sessions of browsers: nobody makes one, changes one, or keeps one longer than it holds."""

from __future__ import annotations

import base64
import json
import secrets
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.console.auth import DAY_S, ENDED, KEY_S, LOGIN_S, Access, Logins, Sessions, cookie_of, write_private
from tsis.errors import FileInputError

if TYPE_CHECKING:
    from pathlib import Path

TOKEN = "t" * 43
NOW_S = 1_790_000_000.0


def sessions(now_s: float = NOW_S, *, token: str = TOKEN, folder: Path | None = None) -> Sessions:
    return Sessions(token, folder=folder, clock=lambda: now_s)


def test_a_session_is_read_back_by_a_console_that_was_started_anew() -> None:
    value, lasts_s = sessions().cookie(name="anna", proof="p")
    result = sessions(NOW_S + 60).read(value)
    assert result is not None
    assert (result.name, result.proof, result.ends_s) == ("anna", "p", NOW_S + LOGIN_S)
    assert lasts_s == LOGIN_S
    assert sessions().cookie()[1] == KEY_S == 7 * DAY_S


@pytest.mark.parametrize(("name", "lasts_s"), [("", KEY_S), ("anna", LOGIN_S)])
def test_a_session_ends_at_its_second(name: str, lasts_s: int) -> None:
    value, _ = sessions().cookie(name=name)
    assert sessions(NOW_S + lasts_s - 1).read(value) is not None
    assert sessions(NOW_S + lasts_s).read(value) is None


def test_another_key_ends_every_session() -> None:
    assert sessions(token="u" * 43).read(sessions().cookie()[0]) is None


def test_a_cookie_does_not_hold_the_key() -> None:
    value, _ = sessions().cookie()
    payload, _, signature = value.rpartition(".")
    assert TOKEN not in value
    assert TOKEN.encode() not in base64.urlsafe_b64decode(payload + "===")
    assert len(base64.urlsafe_b64decode(signature + "===")) == 32


@given(st.data())
def test_a_changed_cookie_is_none(data: st.DataObject) -> None:
    value, _ = sessions().cookie(name="anna", proof="p")
    position = data.draw(st.integers(0, len(value) - 1))
    letter = data.draw(st.characters(min_codepoint=33, max_codepoint=126).filter(lambda item: item != value[position]))
    assert sessions().read(value[:position] + letter + value[position + 1 :]) is None


def test_another_spelling_of_a_signature_is_none() -> None:
    """Decoders of base64 read + as -, / as _, and leave bits of the last letter out."""
    for _ in range(40):
        value, _ = sessions().cookie()
        last = chr(ord(value[-1]) + 1)  # the bits that are left out are 0 as written
        signed, _, signature = value.rpartition(".")
        others = {
            f"{value[:-1]}{last}",
            f"{signed}.{signature.replace('-', '+')}",
            f"{signed}.{signature.replace('_', '/')}",
        }
        assert all(sessions().read(other) is None for other in others - {value})


@given(st.text(max_size=600))
def test_anything_else_is_no_session_and_no_error(text: str) -> None:
    assert sessions().read(text) is None


def test_fields_of_another_kind_are_no_session_though_well_signed() -> None:
    signer = sessions()._signer
    for fields in (None, 3, "anna", [], [1, 2], {"ends": 1}, ["i", "n", "p", "soon"], ["i", "n", "p", None]):
        assert sessions().read(str(signer.dumps(fields))) is None


def test_a_session_that_was_ended_stays_ended(tmp_path: Path) -> None:
    value, _ = sessions(folder=tmp_path).cookie()
    other, _ = sessions(folder=tmp_path).cookie()
    running = sessions(folder=tmp_path)
    result = running.read(value)
    assert result is not None
    running.end(result)
    for item in (running, sessions(NOW_S + 5, folder=tmp_path)):
        assert item.read(value) is None
        assert item.read(other) is not None


def test_ended_sessions_are_forgotten_when_they_would_be_over_anyway(tmp_path: Path) -> None:
    for now_s in (NOW_S, NOW_S + KEY_S + 1):
        running = sessions(now_s, folder=tmp_path)
        result = running.read(running.cookie()[0])
        assert result is not None
        running.end(result)
    assert len(json.loads((tmp_path / ENDED).read_bytes())) == 1


@pytest.mark.parametrize(
    "content", ["", "{", "null", "3", "[1]", '{"a": "x"}', '{"a": null}', '{"a": 1e999}', "[" * 100_000, "\x00"]
)
def test_a_damaged_list_of_ended_sessions_stops_nothing(tmp_path: Path, content: str) -> None:
    write_private(tmp_path / ENDED, content.encode())
    running = sessions(folder=tmp_path)
    result = running.read(running.cookie()[0])
    assert result is not None
    running.end(result)
    assert json.loads((tmp_path / ENDED).read_bytes()) == {result.identity: result.ends_s}


def test_two_consoles_of_one_user_keep_what_the_other_has_ended(tmp_path: Path) -> None:
    consoles = sessions(folder=tmp_path), sessions(folder=tmp_path)
    values = [item.cookie()[0] for item in consoles]
    for item, value in zip(consoles, values, strict=True):
        result = item.read(value)
        assert result is not None
        item.end(result)
    assert [sessions(folder=tmp_path).read(value) for value in values] == [None, None]


def test_a_session_is_over_though_that_cannot_be_written(tmp_path: Path) -> None:
    running = sessions(folder=tmp_path / "user")
    value, _ = running.cookie()
    result = running.read(value)
    assert result is not None
    (tmp_path / "user").write_bytes(b"")
    with pytest.raises(FileInputError):
        running.end(result)
    assert running.read(value) is None


def test_a_login_that_is_gone_or_has_another_password_ends_its_sessions(tmp_path: Path) -> None:
    logins, others = Logins(tmp_path), Logins(tmp_path)  # of the server, and of the program tsis login
    others.add("anna", "a long enough password")
    access = Access(TOKEN, logins=logins, port=1)
    login = logins.check("anna", "a long enough password")
    assert login is not None
    headers = {"cookie": access.cookie(login).partition(";")[0]}
    result = access.client_identity(headers)
    assert result is not None
    assert result.name == "anna"
    others.add("anna", "another long password")
    assert access.client_identity(headers) is None
    assert Access(TOKEN, port=1).client_identity(headers) is None  # a console without logins


def test_the_cookie_goes_nowhere_else() -> None:
    plain, tls = Access(TOKEN, port=8642).cookie(), Access(TOKEN, port=8642, secure=True).cookie()
    for cookie in (plain, tls):
        assert {"HttpOnly", "SameSite=Strict", "Path=/"} <= set(cookie.split("; "))
        assert "Domain" not in cookie
    assert tls.startswith("__Host-tsis-console-8642=")
    assert tls.endswith("; Secure")
    assert "Secure" not in plain


@given(before=st.lists(st.from_regex(r"[a-z%]{1,8}(=[^;\x00-\x1f]{0,8})?", fullmatch=True), max_size=4))
def test_our_cookie_is_found_among_others(before: list[str]) -> None:
    others = [item for item in before if not item.startswith("tsis=")]
    value = secrets.token_urlsafe(8)
    assert cookie_of("; ".join([*others, f"tsis={value}"]), "tsis") == value


@given(st.text(max_size=80))
def test_no_header_of_cookies_is_an_error(header: str) -> None:
    assert isinstance(cookie_of(header, "tsis"), str)


def test_a_planted_second_cookie_counts_as_none() -> None:
    assert cookie_of("tsis=mine; tsis=theirs", "tsis") == ""

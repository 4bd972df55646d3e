"""Who may use a console: hosts and origins, secrets, logins, sessions, the gate and its WebSockets."""

from __future__ import annotations

import asyncio
import base64
import errno
import json
import os
import re
import secrets
import stat
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import argon2.low_level
import httpx
import pytest
from argon2 import PasswordHasher, extract_parameters
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.console.guarded import KEY, METHODS, TOKEN, Clock, answered, client, guarded_app
from tests.waiting import HANGS_S

from tsis.console.auth import (
    A_MINUTE,
    A_MINUTE_OVER_ALL,
    ARGON2ID,
    DAY_S,
    DENIAL,
    ENDED,
    FAILED,
    FOLDER,
    KEY_S,
    LARGEST_BYTES,
    LOGIN_S,
    LOGINS_FILE,
    MOST_LOGINS,
    MOST_SOCKETS,
    NOBODY,
    TOKEN_FILE,
    TOO_LARGE,
    WINDOW_S,
    Access,
    AuthMiddleware,
    LoginBound,
    Logins,
    OpenSockets,
    Sessions,
    console_folder,
    cookie_of,
    headers_of,
    is_known,
    is_own_origin,
    is_repeated,
    local_address,
    name_of,
    network,
    read_private,
    saved_token,
    without_forwarded,
    write_private,
)
from tsis.errors import FileInputError, InputError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable
    from pathlib import Path

    from starlette.types import Message, Receive, Scope, Send


NAMES = frozenset(("127.0.0.1", "localhost", "[::1]", "lab.example"))
# Addresses made of parts that fit together now and then, and mislead often.
PARTS = (
    "http://",
    "https://",
    "localhost",
    "127.0.0.1",
    "[::1]",
    ":8642",
    ":80",
    "@",
    ".",
    "/",
    "evil.example",
    "null",
    " ",
)
addresses = st.lists(st.sampled_from(PARTS) | st.characters(min_codepoint=32, max_codepoint=126), max_size=4).map(
    "".join
)


@pytest.mark.parametrize(
    "host",
    ["localhost", "LOCALHOST:8642", "127.0.0.1:1", "[::1]:8642", "[::1]", "lab.example", "Lab.Example:443"],
)
def test_own_names_are_known_with_any_port(host: str) -> None:
    assert is_known(host, names=NAMES, local="127.0.0.1")


OTHERS = (
    "", ":8642", "evil.example", "localhost.", "localhost.evil.example", "evil.example:localhost", "localhost@evil",
    "localhost:80@evil.example", "localhost:80:80", "localhost:", "localhost:x", "localhost:123456", " localhost",
    "localhost ", "localhost,evil.example", "localhost/evil", "127.0.0.1.evil.example", "127.1", "0x7f.1", "2130706433",
    "[::1", "::1", "[::1]x", "local\u017fhost", "localhost\x00", "localhost\n", "lab.example.", "xlab.example",
    "192.0.2.1", "[::ffff:192.0.2.1]",
)  # fmt: skip


@pytest.mark.parametrize("host", OTHERS)
def test_other_names_are_not(host: str) -> None:
    assert not is_known(host, names=NAMES, local="127.0.0.1")


def test_the_address_that_was_reached_is_known_and_no_other() -> None:
    assert is_known("192.0.2.1:8642", names=NAMES, local="192.0.2.1")
    assert is_known("[2001:DB8:0::1]:8642", names=NAMES, local="2001:db8::1")
    assert is_known("192.0.2.1", names=NAMES, local="::ffff:192.0.2.1")
    assert not is_known("192.0.2.2", names=NAMES, local="192.0.2.1")
    assert not is_known("192.0.2.1", names=NAMES, local="")


@settings(max_examples=300)
@given(addresses)
def test_whatever_is_known_leads_here_as_clients_read_it(host: str) -> None:
    if is_known(host, names=NAMES, local="127.0.0.1"):
        assert httpx.URL(f"http://{host}/").host in {name.strip("[]") for name in NAMES}


@given(st.text(max_size=40))
def test_names_of_anything_are_plain(host: str) -> None:
    name = name_of(host)
    assert name == name.lower()
    assert not set(name) & set("@/\\ ,\r\n\x00")


def scope(kind: str = "http", *, method: str = "POST", scheme: str = "http") -> dict[str, Any]:
    return {"type": kind, "method": method, "scheme": scheme}


@pytest.mark.parametrize("origin", ["http://localhost:8642", "HTTP://LOCALHOST:8642"])
def test_own_pages_may_act(origin: str) -> None:
    headers = {"origin": origin, "host": "localhost:8642"}
    assert is_own_origin(scope(), headers)
    assert is_own_origin(scope("websocket", scheme="ws"), headers)


FOREIGN = (
    "null", "", "http://localhost", "http://localhost:8643", "https://localhost:8642", "http://127.0.0.1:8642",
    "http://evil.example", "http://localhost:8642.evil.example", "http://evil.example@localhost:8642", "localhost:8642",
    "http://localhost:8642/", "http://localhost:8642 http://evil.example", "file://", "http://localhost:08642",
)  # fmt: skip


@pytest.mark.parametrize("origin", FOREIGN)
def test_pages_of_other_places_may_not(origin: str) -> None:
    headers = {"origin": origin, "host": "localhost:8642"}
    assert not is_own_origin(scope(), headers)
    assert not is_own_origin(scope("websocket", scheme="ws"), headers)
    assert is_own_origin(scope(method="GET"), headers)  # reading is for the key alone to permit


def test_pages_of_the_same_name_without_tls_may_not_use_one_with() -> None:
    headers = {"origin": "http://lab.example", "host": "lab.example"}
    assert not is_own_origin(scope(scheme="https"), headers)
    assert not is_own_origin(scope("websocket", scheme="wss"), headers)
    assert is_own_origin(scope(scheme="https"), {**headers, "origin": "https://lab.example"})


@settings(max_examples=300)
@given(addresses)
@example("http://localhost:8642")
def test_an_own_origin_is_the_host_as_clients_read_it(origin: str) -> None:
    if is_own_origin(scope(), {"origin": origin, "host": "localhost:8642"}):
        url = httpx.URL(origin)
        assert (url.scheme, url.host, url.port) == ("http", "localhost", 8642)


def test_headers_that_are_there_twice() -> None:
    twice = {
        "headers": [
            (b"Host", b"localhost"),
            (b"cookie", b"a=1"),
            (b"cookie", b"b=2"),
            (b"accept", b"x"),
            (b"accept", b"y"),
        ]
    }
    assert headers_of(twice) == {"host": "localhost", "cookie": "a=1; b=2", "accept": "x, y"}
    assert not is_repeated(twice)
    for name in (b"host", b"ORIGIN", b"Authorization"):
        assert is_repeated({"headers": [(name, b"a"), (name.lower(), b"a")]})


@given(st.text(st.characters(min_codepoint=97, max_codepoint=122) | st.just("-"), max_size=12))
def test_nothing_that_a_proxy_would_say_is_passed_on(ending: str) -> None:
    headers = [(f"X-Forwarded-{ending}".encode(), b"x"), (b"Forwarded", b"x"), (b"host", b"localhost")]
    assert without_forwarded(headers) == [(b"host", b"localhost")]


@given(st.text(max_size=40))
def test_nobody_is_sent_elsewhere(text: str) -> None:
    there = httpx.URL("http://localhost:8642/").join(local_address(text))
    assert (there.scheme, there.host, there.port) == ("http", "localhost", 8642)


@pytest.mark.parametrize(
    "text",
    ["//evil.example", "/\\evil.example", "\\\\evil.example", "http:evil.example", "/\t/evil", "javascript:x", ""],
)
def test_addresses_that_browsers_would_read_as_elsewhere_are_the_first_page(text: str) -> None:
    assert local_address(text) == "/"


posix = pytest.mark.skipif(os.name != "posix", reason="modes of files say nothing here")


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


@posix
def test_a_secret_is_its_owners_alone_whatever_the_mask(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        write_private(tmp_path / "new" / "secret", b"hush")
    finally:
        os.umask(before)
    assert mode(tmp_path / "new") == 0o700
    assert mode(tmp_path / "new" / "secret") == 0o600
    assert read_private(tmp_path / "new" / "secret") == b"hush"


@posix
@pytest.mark.parametrize("bits", [0o640, 0o604, 0o620, 0o602, 0o777])
def test_a_secret_that_others_could_read_or_write_is_refused_with_a_cure(tmp_path: Path, bits: int) -> None:
    path = tmp_path / "secret"
    write_private(path, b"hush")
    path.chmod(bits)
    with pytest.raises(FileInputError, match=rf"owner alone; got mode {bits:04o} \(chmod 600"):
        read_private(path)


@posix
def test_links_and_folders_are_no_secrets(tmp_path: Path) -> None:
    write_private(tmp_path / "secret", b"hush")
    (tmp_path / "link").symlink_to(tmp_path / "secret")
    (tmp_path / "folder").mkdir()
    for name in ("link", "folder"):
        with pytest.raises(FileInputError, match="must be a"):
            read_private(tmp_path / name)


def test_a_disk_that_fails_while_a_secret_is_read_is_said_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: object) -> bytes:
        raise OSError(errno.EIO, "Input/output error")

    write_private(tmp_path / "secret", b"hush")
    monkeypatch.setattr(os, "read", failing)
    with pytest.raises(FileInputError, match="secret must be a file that can be read; got: Input/output error"):
        read_private(tmp_path / "secret")


def test_what_cannot_be_written_is_said_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(FileInputError, match=FOLDER):
        write_private(tmp_path / "file" / "secret", b"hush")


def test_the_folder_may_be_chosen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    assert console_folder() == tmp_path
    monkeypatch.delenv(FOLDER)
    assert console_folder().name == "console"


def test_the_key_stays_until_another_is_asked_for(tmp_path: Path) -> None:
    first = saved_token(folder=tmp_path)
    assert saved_token(folder=tmp_path) == first
    assert saved_token(folder=tmp_path / "other") != first
    second = saved_token(new=True, folder=tmp_path)
    assert second != first
    assert saved_token(folder=tmp_path) == second


def test_consoles_that_start_together_have_one_key(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        tokens = set(pool.map(lambda _: saved_token(folder=tmp_path), range(32)))
    assert len(tokens) == 1


@pytest.mark.parametrize("content", [b"", b"short", b"\xff" * 43, b"x" * 44, b"x" * 5000])
def test_a_damaged_key_is_named_with_its_cure(tmp_path: Path, content: bytes) -> None:
    write_private(tmp_path / TOKEN_FILE, content)
    with pytest.raises(FileInputError, match="--new-token makes another"):
        saved_token(folder=tmp_path)
    assert saved_token(new=True, folder=tmp_path)


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
    assert access.client_name(headers) == "anna"
    others.add("anna", "another long password")
    assert access.client_name(headers) is None
    assert Access(TOKEN, port=1).client_name(headers) is None  # a console without logins


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


def tried(bound: LoginBound, clock: Clock, *, for_s: float, addresses: int = 1) -> int:
    """How many tries somebody has who tries each second from each of so many addresses."""
    free = 0
    for _ in range(int(for_s)):
        free += sum(bound.wait_s(f"192.0.2.{number}") == 0 for number in range(addresses))
        clock.now_s += 1
    return free


def test_an_address_has_five_tries_a_minute_and_all_have_thirty() -> None:
    clock = Clock()
    assert tried(LoginBound(clock=clock), clock, for_s=3600) == 60 * A_MINUTE
    assert tried(LoginBound(clock=clock), clock, for_s=3600, addresses=50) == 60 * A_MINUTE_OVER_ALL


def test_guessing_takes_longer_than_any_password_lasts() -> None:
    """A thousand years of tries, from any number of addresses, against twelve letters."""
    assert A_MINUTE_OVER_ALL * 60 * 24 * 365 * 1000 < 26**12 / 1e6


def test_slow_people_never_wait() -> None:
    clock = Clock()
    bound = LoginBound(clock=clock)
    for _ in range(500):
        assert bound.wait_s("192.0.2.7") == 0
        clock.now_s += 60 / A_MINUTE


def test_addresses_do_not_wait_for_each_other_until_there_are_many() -> None:
    bound = LoginBound(clock=lambda: 0.0)
    waits = [bound.wait_s(f"192.0.2.{number}") for number in range(1, 50)]
    assert waits == [0.0] * A_MINUTE_OVER_ALL + [60.0] * (49 - A_MINUTE_OVER_ALL)


def test_many_addresses_shut_nobody_out_for_longer_than_a_minute() -> None:
    clock = Clock()
    bound = LoginBound(clock=clock)
    for round_ in range(20):
        for number in range(100):
            assert bound.wait_s(f"10.0.{round_}.{number}") <= 60
        clock.now_s += 60


def test_what_is_remembered_does_not_grow() -> None:
    clock = Clock()
    bound = LoginBound(clock=clock)
    for number in range(10_000):
        bound.wait_s(f"10.{number >> 16}.{number >> 8 & 255}.{number & 255}")
        clock.now_s += 0.01
    assert len(bound._tries) <= A_MINUTE_OVER_ALL


def test_a_customer_with_a_network_is_one() -> None:
    assert network("2001:db8::1") == network("2001:db8::ffff:1") != network("2001:db8:0:1::1")
    assert network("::ffff:192.0.2.1") == network("192.0.2.1")
    assert network("fe80::1%eth0") == network("fe80::2%eth1")


@given(st.lists(st.floats(0, 5000), max_size=60))
def test_who_waits_as_long_as_is_said_may_go_on(steps: list[float]) -> None:
    clock = Clock()
    bound = LoginBound(clock=clock)
    for step in steps:
        clock.now_s += step
        wait_s = bound.wait_s("192.0.2.7")
        assert 0 <= wait_s <= WINDOW_S
        if wait_s:
            clock.now_s += wait_s + 1e-6
            assert bound.wait_s("192.0.2.7") == 0


@pytest.fixture
def _cheap_passwords(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hash at the least cost; `test_logins` checks the real one."""
    cheap = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
    monkeypatch.setattr("tsis.console.auth.ARGON2ID", cheap)
    monkeypatch.setattr("tsis.console.auth.NOBODY", cheap.hash("nobody's password"))


@pytest.mark.usefixtures("_cheap_passwords")
def test_the_login_asks_says_no_waits_and_lets_in(tmp_path: Path) -> None:
    logins, clock = Logins(tmp_path), Clock()
    logins.add("anna", PASSWORD)
    around = guarded_app(logins=logins, clock=clock)
    right = {"name": "anna", "password": PASSWORD, "then": "/records/3"}

    async def tried() -> None:
        async with client(around) as user:
            sent = await user.get("/records/3?a=1", headers={"accept": "text/html,*/*"})
            assert (sent.status_code, sent.headers["location"]) == (303, "/login?then=%2Frecords%2F3%3Fa%3D1")
            assert (await user.get("/records/3")).status_code == 401
            form = await user.get(sent.headers["location"])
            assert 'value="/records/3?a=1"' in form.text
            assert "<script" not in form.text

            refused = [await user.post("/login", data=data) for data in (
                {"name": "anna", "password": "wrong"}, {"name": "nobody", "password": "wrong"}, {"name": "anna"}, {}
            )]  # fmt: skip
            assert {answer.status_code for answer in refused} == {401}
            assert len({answer.text for answer in refused}) == 1  # nobody learns which of the two was wrong
            foreign = await user.post("/login", data=right, headers={"origin": "http://evil.example"})
            assert foreign.status_code == 403

            assert (await user.post("/login", data={"name": "anna", "password": "wrong"})).status_code == 401
            waits = await user.post("/login", data=right)
            assert (waits.status_code, waits.headers["retry-after"]) == (429, "60")
            assert "in 60 s" in waits.text
            clock.now_s += 60
            into = await user.post("/login", data=right, headers={"origin": "http://127.0.0.1:8642"})
            assert (into.status_code, into.headers["location"]) == (303, "/records/3")
            assert (await user.get("/x")).json()["visitor"] == "anna"
            assert PASSWORD not in into.text

            stolen = dict(user.cookies)
            assert "anna" in (await user.get("/logout")).text
            assert (await user.get("/x")).status_code == 200  # a link to it does nothing
            gone = await user.post("/logout")
            assert (gone.status_code, gone.headers["clear-site-data"]) == (200, '"cache"')
            assert not user.cookies
            again = await user.get("/x", headers={"cookie": "; ".join(f"{k}={v}" for k, v in stolen.items())})
            assert again.status_code == 401

    asyncio.run(tried())


@pytest.mark.usefixtures("_cheap_passwords")
def test_guesses_at_once_count_as_many(tmp_path: Path) -> None:
    logins = Logins(tmp_path)
    logins.add("anna", PASSWORD)
    around = guarded_app(logins=logins)

    async def tried() -> list[int]:
        async with client(around) as user:
            tries = [user.post("/login", data={"name": "anna", "password": f"{number}"}) for number in range(12)]
            return [answer.status_code for answer in await asyncio.gather(*tries)]

    codes = asyncio.run(tried())
    assert codes.count(401) == A_MINUTE
    assert codes.count(429) == 12 - A_MINUTE


@pytest.mark.usefixtures("_cheap_passwords")
def test_what_is_no_form_is_refused_in_a_sentence(tmp_path: Path) -> None:
    logins = Logins(tmp_path)
    logins.add("anna", PASSWORD)
    for content, status in (
        (b"x" * 9000, 400),
        (b"\xff\xfe=\xff", 401),
        (b"name=anna&password=%00%ff", 401),
        (b"&" * 8000, 401),
    ):
        answer = answered("POST", "/login", around=guarded_app(logins=logins), content=content)
        assert answer.status_code == status
    damaged = Logins(tmp_path / "other")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "logins.json").write_text("{")
    (tmp_path / "other" / "logins.json").chmod(0o600)
    answer = answered("POST", "/login", around=guarded_app(logins=damaged), data={"name": "anna", "password": "x"})
    assert answer.status_code == 503


@pytest.mark.parametrize("then", ["//evil.example", "https://evil.example", "/\\evil.example", '"><script>x</script>'])
@pytest.mark.usefixtures("_cheap_passwords")
def test_the_login_leads_nowhere_else_and_writes_nothing_foreign_into_its_page(tmp_path: Path, then: str) -> None:
    logins = Logins(tmp_path)
    logins.add("anna", PASSWORD)
    form = answered("GET", "/login", around=guarded_app(logins=logins), params={"then": then})
    assert "evil" not in form.text
    assert "<script" not in form.text
    data = {"name": "anna", "password": PASSWORD, "then": then}
    assert answered("POST", "/login", around=guarded_app(logins=logins), data=data).headers["location"] == "/"


@pytest.mark.usefixtures("_cheap_passwords")
def test_a_console_without_logins_has_no_login() -> None:
    assert answered("GET", "/login").status_code == 401
    assert answered("POST", "/login", data={"name": "anna", "password": "x"}).status_code == 401
    assert answered("PUT", "/login").status_code == 405


@pytest.mark.usefixtures("_cheap_passwords")
def test_who_came_with_the_key_may_log_out_too() -> None:
    async def tried() -> None:
        async with client(guarded_app()) as user:
            await user.get(f"/?token={TOKEN}")
            assert (await user.get("/x")).status_code == 200
            assert "key" in (await user.post("/logout")).text
            assert (await user.get("/x")).status_code == 401

    asyncio.run(tried())


def test_the_key_lets_in_and_nothing_else_does() -> None:
    assert answered("GET", "/x", headers=KEY).json()["path"] == "/x"
    wrong = [{}, {"authorization": TOKEN}, {"authorization": "Bearer "}, {"authorization": f"Bearer {TOKEN}x"},
             {"authorization": f"Basic {TOKEN}"}, {"cookie": f"tsis-console-8642={TOKEN}"}]  # fmt: skip
    for headers in wrong:
        answer = answered("GET", "/x", headers=headers)
        assert answer.status_code == 401
        assert answer.headers["www-authenticate"] == "Bearer"


def test_the_printed_address_gives_a_cookie_and_hides_the_key() -> None:
    answer = answered("GET", f"/records/3?a=1&token={TOKEN}&a=2")
    assert (answer.status_code, answer.headers["location"]) == (303, "/records/3?a=1&a=2")
    cookie = answer.headers["set-cookie"].partition(";")[0]
    assert answered("GET", "/x", headers={"cookie": cookie}).status_code == 200
    assert answered("POST", f"/x?token={TOKEN}").status_code == 401
    assert answered("GET", "/x?token=wrong").status_code == 401


def test_who_is_in_sees_the_key_in_no_address_either() -> None:
    cookie = answered("GET", f"/?token={TOKEN}").headers["set-cookie"].partition(";")[0]
    again = answered("GET", f"/records?a=1&token={TOKEN}", headers={"cookie": cookie})
    assert (again.status_code, again.headers["location"]) == (303, "/records?a=1")
    assert "set-cookie" not in again.headers
    assert answered("GET", "/records?token=wrong", headers={"cookie": cookie}).status_code == 200


def test_who_comes_by_a_link_elsewhere_is_sent_on_by_a_page_of_the_console() -> None:
    path = f"/records?a=1&token={TOKEN}&b=%22%3E%3Cscript%3E"
    for site in ("cross-site", "same-site"):
        answer = answered("GET", path, headers={"sec-fetch-site": site})
        assert (answer.status_code, answer.headers["refresh"]) == (200, "0; url=/records?a=1&b=%22%3E%3Cscript%3E")
        assert answer.headers["set-cookie"].startswith("tsis-console-8642=")
        assert TOKEN not in answer.text
        assert "<script" not in answer.text
    for site in ("none", "same-origin"):
        assert answered("GET", path, headers={"sec-fetch-site": site}).status_code == 303


@pytest.mark.parametrize("path", ["//evil.example/", "/%5Cevil.example", "//evil.example/.."])
def test_the_printed_address_leads_nowhere_else(path: str) -> None:
    location = answered("GET", f"{path}?token={TOKEN}").headers["location"]
    assert httpx.URL("http://127.0.0.1:8642/").join(location).host == "127.0.0.1"
    assert answered("GET", f"/%09/evil.example?token={TOKEN}").status_code == 400


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "path",
    ["/x", "//x", "/./x", "/login/../x", "/login/", "/login/x", "/login%2F", "/LOGIN", "/static/../x", "/%6Cogin/x"],
)
def test_no_path_and_no_method_gets_round(method: str, path: str) -> None:
    assert answered(method, path).status_code == 401


def test_foreign_names_and_origins_are_refused_with_the_key() -> None:
    assert answered("GET", "/x", headers={**KEY, "host": "evil.example"}).status_code == 421
    assert answered("GET", "/x", headers={**KEY, "host": ""}).status_code == 421
    for method in ("POST", "PUT", "PATCH", "DELETE", "PROPFIND"):
        for origin in ("http://evil.example", "null", "http://127.0.0.1:1"):
            assert answered(method, "/x", headers={**KEY, "origin": origin}).status_code == 403
        own = answered(method, "/x", headers={**KEY, "origin": "http://127.0.0.1:8642"})
        assert own.status_code == (405 if method == "PROPFIND" else 200)
    for name in ("Host", "Authorization", "Origin"):
        twice = [
            *KEY.items(),
            ("host", "127.0.0.1:8642"),
            ("origin", "http://127.0.0.1:8642"),
            (name, "127.0.0.1:8642"),
        ]
        assert answered("GET", "/x", headers=twice).status_code == 400


def test_nothing_that_a_proxy_would_say_is_believed() -> None:
    endings = ("prefix", "host", "for", "proto", "port", "server")
    lies = {**{f"x-forwarded-{item}": "evil" for item in endings}, "forwarded": "for=127.0.0.1", "x-mine": "ours"}
    assert answered("GET", "/x", headers={**KEY, **lies}).json()["headers"] == {"x-mine": "ours"}


def test_bodies_have_an_end_announced_or_not() -> None:
    async def endless() -> AsyncIterator[bytes]:
        for _ in range(LARGEST_BYTES // 2**20 + 1):
            yield bytes(2**20)

    async def enough() -> AsyncIterator[bytes]:
        for _ in range(LARGEST_BYTES // 2**20):
            yield bytes(2**20)

    told_large = answered("POST", "/counted", headers={**KEY, "content-length": str(LARGEST_BYTES + 1)}, content=b"")
    large = answered("POST", "/counted", headers=KEY, content=endless())
    for answer in (told_large, large):
        assert (answer.status_code, answer.text) == (413, TOO_LARGE)
    assert answered("POST", "/counted", headers=KEY, content=enough()).text == str(LARGEST_BYTES)


def test_a_failure_is_one_sentence(caplog: pytest.LogCaptureFixture) -> None:
    class Failing:
        async def __call__(self, *_: object) -> None:
            raise RuntimeError("secret detail")

    around = AuthMiddleware(Failing(), access=Access(TOKEN), hosts=("127.0.0.1",))
    answer = answered("GET", "/x", around=around, headers=KEY)
    assert (answer.status_code, answer.text) == (500, FAILED)
    assert "secret detail" in caplog.text
    inside = answered("GET", "/broken", headers=KEY)
    assert inside.status_code == 500
    assert "secret" not in inside.text


def test_every_answer_bears_the_safe_headers_and_pages_their_nonce() -> None:
    nonces = set()
    for path, headers, status in (("/page", KEY, 200), ("/page", {}, 401), ("/broken", KEY, 500), ("/login", {}, 401)):
        answer = answered("GET", path, headers=headers)
        assert answer.status_code == status
        policy = answer.headers["content-security-policy"]
        nonces.add(re.findall(r"'nonce-([\w-]{20,})'", policy)[0])
        assert {"default-src 'self'", "object-src 'none'", "frame-ancestors 'none'"} <= set(policy.split("; "))
        assert "script-src" in policy
        assert "unsafe-inline" not in policy.partition("script-src")[2].partition(";")[0]
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers.get_list("x-frame-options") == ["DENY"]
        assert answer.headers["cache-control"] == "no-store"
        assert "strict-transport-security" not in answer.headers
    assert len(nonces) == 4
    answer = answered("GET", "/page", headers=KEY)
    nonce = re.findall(r"'nonce-([\w-]+)'", answer.headers["content-security-policy"])[0]
    assert answer.text.count(f'<script nonce="{nonce}"') == 2
    assert answer.headers["content-length"] == str(len(answer.content))


def test_tls_is_asked_for_from_now_on_but_not_of_the_whole_machine() -> None:
    around = guarded_app(secure=True)
    assert "max-age" in answered("GET", "/x", around=around).headers["strict-transport-security"]
    local = answered("GET", "/x", around=around, headers={"host": "localhost:8642"})
    assert "strict-transport-security" not in local.headers


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


def socket_scope(headers: dict[str, str], **others: Any) -> dict[str, Any]:
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
        await guarded_app(socket_scope({}), plain.receive, plain.send)
        assert plain.sent == [{"type": "websocket.close", "code": 1008}]
        await guarded_app(socket_scope({}, extensions={DENIAL: {}}), answered.receive, answered.send)
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
            asyncio.create_task(guarded_app(socket_scope(headers), peer.receive, peer.send))
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
        tasks = [asyncio.create_task(guarded_app(socket_scope(headers), peer.receive, peer.send)) for peer in peers]
        await settled()
        late = Peer()
        await guarded_app(socket_scope(headers, extensions={DENIAL: {}}), late.receive, late.send)
        assert late.sent[0]["status"] == 503
        tasks[0].cancel()
        await settled()
        again = Peer()
        tasks.append(asyncio.create_task(guarded_app(socket_scope(headers), again.receive, again.send)))
        await settled()
        assert again.kinds == ["websocket.accept"]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    asyncio.run(tried())


def test_a_socket_that_fails_is_closed() -> None:
    async def tried() -> None:
        access, peer = Access(TOKEN), Peer()
        await AuthMiddleware(failing, access=access, hosts=("127.0.0.1",))(
            socket_scope(key(access)), peer.receive, peer.send
        )
        assert peer.kinds == ["websocket.accept", "websocket.close"]

    asyncio.run(tried())


def test_a_socket_whose_handler_swallows_the_cancellation_is_cut_at_the_next_check() -> None:
    async def deaf(begun: asyncio.Event, swallowed: asyncio.Event) -> None:
        begun.set()
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            swallowed.set()
        await asyncio.Event().wait()

    async def tried() -> None:
        sockets, begun, swallowed = OpenSockets(), asyncio.Event(), asyncio.Event()
        task = asyncio.create_task(sockets.serve(deaf(begun, swallowed), stays=lambda: False))
        await begun.wait()
        sockets.check()
        await asyncio.wait_for(swallowed.wait(), HANGS_S)
        assert not task.done()
        sockets.check()
        assert await asyncio.wait_for(task, HANGS_S)
        assert task.cancelling() == 0

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

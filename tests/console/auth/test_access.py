"""What requests say of themselves, against the standard library's and httpx' reading of addresses."""

from __future__ import annotations

from typing import Any

import httpx
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tsis.console.auth import (
    headers_of,
    is_known,
    is_own_origin,
    is_repeated,
    local_address,
    name_of,
    without_forwarded,
)

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

"""Every route and every WebSocket of a running console, by real requests: refused to all but who has the key."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import httpx
import pytest
from tests.console.auth.plain_requests import answer_to, status_of, upgraded
from tests.waiting import HANGS_S

from tsis.console.auth import KEY_NEEDED, KEY_S, SAFE_METHODS, Access, Sessions

if TYPE_CHECKING:
    from tests.console.running import RunningConsole

pytestmark = pytest.mark.system
WALK = Path(__file__).with_name("every_route.py")
LIVE = "/live"
REPORT = "/files/study/1/report.1"
PUSH = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
REFUSALS = (KEY_NEEDED, "does not accept this host name", "Requests from other sites", "is malformed")
Route = tuple[str, str]


@pytest.fixture(scope="module")
def routes(tmp_path_factory: pytest.TempPathFactory) -> list[Route]:
    """Address and method of each route, as the application itself lists them."""
    reported = subprocess.run(
        [sys.executable, str(WALK)], capture_output=True, text=True, cwd=tmp_path_factory.mktemp("walk"), check=True
    )
    result = [(path, method) for path, method in json.loads(reported.stdout)]
    paths = {path for path, _ in result}
    assert {LIVE, REPORT, "/", "/api/v1/snapshot", "/static/console.css", "/favicon.ico", "/study/1"} <= paths
    assert any(path.startswith("/_nicegui_ws/socket.io") for path in paths)
    assert len(result) > 90
    return result


def of_http(routes: list[Route]) -> list[Route]:
    return [item for item in routes if item[1] != "WEBSOCKET"]


def port_of(console: RunningConsole) -> int:
    return httpx.URL(console.address).port or 80


def cookie(console: RunningConsole, token: str, *, age_s: float = 0.0) -> dict[str, str]:
    """The header of a session that began a while ago, signed by whoever has this token."""
    begun = Sessions(token, clock=lambda: time.time() - age_s)
    created = Access(token, sessions=begun, port=port_of(console)).cookie()
    return {"Cookie": created.partition(";")[0]}


def without_a_key(console: RunningConsole) -> dict[str, dict[str, str]]:
    """What they send who have no key, or one that is over or forged."""
    return {
        "no key": {},
        "wrong key": {"Authorization": "Bearer " + "x" * 43},
        "half a key": {"Authorization": f"Bearer {console.token[:20]}"},
        "the key as a cookie": {"Cookie": f"tsis-console-{port_of(console)}={console.token}"},
        "a forged session": cookie(console, "x" * 43),
        "a session that is over": cookie(console, console.token, age_s=KEY_S + 1),
        "a session of another port": {"Cookie": cookie(console, console.token)["Cookie"].replace("=", "1=", 1)},
    }


def test_nobody_without_a_key_reaches_any_route(console: RunningConsole, routes: list[Route]) -> None:
    passed, requested = [], 0
    with httpx.Client(base_url=console.address, timeout=HANGS_S) as user:
        for who, headers in without_a_key(console).items():
            for path, method in of_http(routes):
                requested += 1
                answer = user.request(method, path, headers=headers)
                if answer.status_code != 401 or (method != "HEAD" and answer.text != KEY_NEEDED):
                    passed.append((who, method, path, answer.status_code))
    assert not passed
    assert requested > 7 * 70


def test_nobody_without_a_key_opens_any_socket(console: RunningConsole, routes: list[Route]) -> None:
    paths = {path for path, _ in routes} | {PUSH}
    codes = {(path, upgraded(console.address, path, {})) for path in paths}
    for headers in without_a_key(console).values():
        codes |= {(path, upgraded(console.address, path, headers)) for path in (LIVE, PUSH)}
    codes |= {(path, upgraded(console.address, f"{path}?token={console.token}", {})) for path in (LIVE,)}
    assert {code for _, code in codes} == {401}


def test_foreign_names_reach_nothing_even_with_the_key(console: RunningConsole, routes: list[Route]) -> None:
    passed = []
    with httpx.Client(base_url=console.address, headers=console.key, timeout=HANGS_S) as user:
        for name in (
            "evil.example",
            f"evil.example:{port_of(console)}",
            "localhost.evil.example",
            "127.0.0.1.",
            "0.0.0.0",
        ):
            for path, method in of_http(routes):
                if user.request(method, path, headers={"Host": name}).status_code != 421:
                    passed.append((name, method, path))
            for path in (LIVE, PUSH):
                assert upgraded(console.address, path, {**console.key, "Host": name}) == 421, (name, path)
    assert not passed


def test_pages_of_other_places_change_nothing_even_with_the_key(console: RunningConsole, routes: list[Route]) -> None:
    passed = []
    origins = (
        "http://evil.example",
        "null",
        f"http://localhost:{port_of(console) + 1}",
        f"https://127.0.0.1:{port_of(console)}",
    )
    unsafe = [item for item in of_http(routes) if item[1] not in SAFE_METHODS]
    assert len(unsafe) > 15
    with httpx.Client(base_url=console.address, headers=console.key, timeout=HANGS_S) as user:
        for origin in origins:
            for path, method in unsafe:
                if user.request(method, path, headers={"Origin": origin}).status_code != 403:
                    passed.append((origin, method, path))
            for path in {path for path, _ in routes} | {PUSH}:
                assert upgraded(console.address, path, {**console.key, "Origin": origin}) == 403, (origin, path)
    assert not passed


def test_who_has_the_key_is_refused_nowhere(console: RunningConsole, routes: list[Route]) -> None:
    own = {"Origin": console.address}
    for headers in ({**console.key, **own}, {**cookie(console, console.token), **own}, console.key):
        with httpx.Client(base_url=console.address, headers=headers, timeout=HANGS_S) as user:
            for path, method in of_http(routes):
                answer = user.request(method, path)
                assert not answer.text.startswith(REFUSALS), (method, path)
                assert answer.status_code not in (401, 403, 421, 500), (method, path)
        assert {upgraded(console.address, path, headers) for path in (LIVE, PUSH)} == {101}


def test_polling_passes_the_same_gate_as_sockets(console: RunningConsole) -> None:
    poll = "/_nicegui_ws/socket.io/?EIO=4&transport=polling"
    with httpx.Client(base_url=console.address, timeout=HANGS_S) as user:
        opened = user.get(poll, headers=console.key)
        assert opened.status_code == 200
        reported = json.loads(opened.text[1:])
        assert reported["maxPayload"] <= 2**20
        session = reported["sid"]
        for headers, code in (({}, 401), ({**console.key, "Origin": "http://evil.example"}, 403)):
            assert user.post(f"{poll}&sid={session}", headers=headers, content="40").status_code == code
        assert user.post(f"{poll}&sid={session}", headers=console.key, content="40").status_code == 200


def test_every_answer_is_guarded(console: RunningConsole, routes: list[Route]) -> None:
    with httpx.Client(base_url=console.address, timeout=HANGS_S) as user:
        for headers in ({}, console.key):
            for path, method in of_http(routes):
                answer = user.request(method, path, headers=headers)
                assert answer.headers["x-content-type-options"] == "nosniff", (method, path)
                assert answer.headers["x-frame-options"] == "DENY"
                assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
                assert answer.headers["cache-control"]
                assert "server" not in answer.headers


def test_requests_that_no_browser_sends(console: RunningConsole) -> None:
    host, key = console.address.removeprefix("http://"), f"Authorization: Bearer {console.token}\r\n"
    reported = {
        "no host": f"GET / HTTP/1.1\r\n{key}\r\n",
        "no host, old": f"GET / HTTP/1.0\r\n{key}\r\n",
        "two hosts": f"GET / HTTP/1.1\r\nHost: {host}\r\nHost: evil.example\r\n{key}\r\n",
        "two keys": f"GET / HTTP/1.1\r\nHost: {host}\r\n{key}{key}\r\n",
        "elsewhere": f"GET http://evil.example/ HTTP/1.1\r\nHost: {host}\r\n{key}\r\n",
        "a name alone": f"GET evil.example:80 HTTP/1.1\r\nHost: {host}\r\n{key}\r\n",
        "a tunnel": f"CONNECT evil.example:80 HTTP/1.1\r\nHost: {host}\r\n{key}\r\n",
        "folded": f"GET / HTTP/1.1\r\nHost: evil.example\r\n : {host}\r\n{key}\r\n",
        "two lengths": f"POST / HTTP/1.1\r\nHost: {host}\r\n{key}Content-Length: 1\r\nContent-Length: 2\r\n\r\nab",
        "large headers": f"GET / HTTP/1.1\r\nHost: {host}\r\n{key}X: {'x' * 300_000}\r\n\r\n",
        "many headers": f"GET / HTTP/1.1\r\nHost: {host}\r\n{key}" + "X: x\r\n" * 60_000 + "\r\n",
    }
    codes = {what: status_of(answer_to(console.address, text.encode())) for what, text in reported.items()}
    assert set(codes.values()) <= {400, 421, 431}, codes
    upper = f"GET / HTTP/1.1\r\nHOST: {host.upper()}\r\n{key}\r\n"
    assert status_of(answer_to(console.address, upper.encode())) == 200


TRICKS = (
    "//", "/..", "/../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/static/../../serving.py", "/static/%2e%2e/serving.py",
    "/static/..%2fserving.py", "/\\", "/%00", "/login/../records", "/static//etc/passwd", "/login;x", "/%ff",
)  # fmt: skip


@pytest.mark.parametrize("path", TRICKS)
def test_tricks_with_paths_get_round_nothing_and_read_no_file(console: RunningConsole, path: str) -> None:
    head = f"GET {path} HTTP/1.1\r\nHost: {console.address.removeprefix('http://')}\r\n"
    assert status_of(answer_to(console.address, f"{head}\r\n".encode("latin-1"))) in (400, 401)
    remaining = answer_to(console.address, f"{head}Authorization: Bearer {console.token}\r\n\r\n".encode("latin-1"))
    assert b"root:" not in remaining
    assert b"serve_console" not in remaining
    assert status_of(remaining) != 500


def test_large_bodies_are_refused_before_they_are_read(console: RunningConsole) -> None:
    answer = answer_to(
        console.address,
        f"PUT /api/v1/calibration HTTP/1.1\r\nHost: {console.address.removeprefix('http://')}\r\n"
        f"Authorization: Bearer {console.token}\r\nContent-Length: {2**35}\r\n\r\n".encode(),
    )
    assert status_of(answer) == 413


def test_lies_of_a_proxy_change_no_page(console: RunningConsole) -> None:
    lies = {"X-Forwarded-Prefix": "/evil", "X-Forwarded-Host": "evil.example", "X-Forwarded-Proto": "https"}
    for path in ("/", "/records", "/static"):
        page = httpx.get(console.address + path, headers={**console.key, **lies}, timeout=HANGS_S)
        assert "evil" not in page.text
        assert "evil" not in page.headers.get("location", "")


@pytest.mark.parametrize(
    ("method", "more"),
    [
        ("PUT", ""),
        ("PUT", "Content-Length: 2\r\n"),
        ("GET", "Content-Length: 2\r\n"),
        ("GET", "Transfer-Encoding: chunked\r\n"),
        ("GET", "".join(f"X-{number}: y\r\n" for number in range(300))),
        ("GET", f"X: {'y' * 9000}\r\n"),
    ],
)
def test_what_cannot_become_a_websocket_is_answered(console: RunningConsole, method: str, more: str) -> None:
    host = console.address.partition("//")[2]
    opening = "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
    requested = f"Host: {host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n{opening}{more}\r\n"
    answer = answer_to(console.address, f"{method} /api/v1/press HTTP/1.1\r\n{requested}".encode())
    assert status_of(answer) in (400, 405)

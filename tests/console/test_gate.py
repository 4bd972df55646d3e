"""A running console by real requests and browsers: routes, the policy, TLS and logins."""

from __future__ import annotations

import json
import re
import socket
import ssl
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import httpx
import pytest
from tests.console.browser import needs_browser, picture
from tests.console.plain_requests import answer_to, status_of, upgraded
from tests.console.tls import PASSWORD
from tests.waiting import HANGS_S

from tsis.console.auth import KEY_NEEDED, KEY_S, SAFE_METHODS, Access, Sessions
from tsis.console.pages import PAGES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page
    from tests.console.running import RunningConsole
    from tests.console.tls import TlsConsole


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
        [sys.executable, "-P", str(WALK)],
        capture_output=True,
        text=True,
        cwd=tmp_path_factory.mktemp("walk"),
        check=True,
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


@pytest.mark.system
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


@pytest.mark.system
def test_nobody_without_a_key_opens_any_socket(console: RunningConsole, routes: list[Route]) -> None:
    paths = {path for path, _ in routes} | {PUSH}
    codes = {(path, upgraded(console.address, path, {})) for path in paths}
    for headers in without_a_key(console).values():
        codes |= {(path, upgraded(console.address, path, headers)) for path in (LIVE, PUSH)}
    codes |= {(path, upgraded(console.address, f"{path}?token={console.token}", {})) for path in (LIVE,)}
    assert {code for _, code in codes} == {401}


@pytest.mark.system
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


@pytest.mark.system
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


@pytest.mark.system
def test_who_has_the_key_is_refused_nowhere(console: RunningConsole, routes: list[Route]) -> None:
    own = {"Origin": console.address}
    for headers in ({**console.key, **own}, {**cookie(console, console.token), **own}, console.key):
        with httpx.Client(base_url=console.address, headers=headers, timeout=HANGS_S) as user:
            for path, method in of_http(routes):
                answer = user.request(method, path)
                assert not answer.text.startswith(REFUSALS), (method, path)
                assert answer.status_code not in (401, 403, 421, 500), (method, path)
        assert {upgraded(console.address, path, headers) for path in (LIVE, PUSH)} == {101}


@pytest.mark.system
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


@pytest.mark.system
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


@pytest.mark.system
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


@pytest.mark.system
@pytest.mark.parametrize("path", TRICKS)
def test_tricks_with_paths_get_round_nothing_and_read_no_file(console: RunningConsole, path: str) -> None:
    head = f"GET {path} HTTP/1.1\r\nHost: {console.address.removeprefix('http://')}\r\n"
    assert status_of(answer_to(console.address, f"{head}\r\n".encode("latin-1"))) in (400, 401)
    remaining = answer_to(console.address, f"{head}Authorization: Bearer {console.token}\r\n\r\n".encode("latin-1"))
    assert b"root:" not in remaining
    assert b"serve_console" not in remaining
    assert status_of(remaining) != 500


@pytest.mark.system
def test_large_bodies_are_refused_before_they_are_read(console: RunningConsole) -> None:
    answer = answer_to(
        console.address,
        f"PUT /api/v1/calibration HTTP/1.1\r\nHost: {console.address.removeprefix('http://')}\r\n"
        f"Authorization: Bearer {console.token}\r\nContent-Length: {2**35}\r\n\r\n".encode(),
    )
    assert status_of(answer) == 413


@pytest.mark.system
def test_lies_of_a_proxy_change_no_page(console: RunningConsole) -> None:
    lies = {"X-Forwarded-Prefix": "/evil", "X-Forwarded-Host": "evil.example", "X-Forwarded-Proto": "https"}
    for path in ("/", "/records", "/static"):
        page = httpx.get(console.address + path, headers={**console.key, **lies}, timeout=HANGS_S)
        assert "evil" not in page.text
        assert "evil" not in page.headers.get("location", "")


@pytest.mark.system
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


NOTED = """
window.violations = [];
document.addEventListener("securitypolicyviolation",
    event => window.violations.push(`${event.violatedDirective} ${event.blockedURI}`));
"""
ADDRESSES = [re.sub(r"\{[^}]*\}", "1", address) for address in PAGES]


@pytest.fixture(scope="module")
def page(console: RunningConsole, browser: Browser) -> Iterator[Page]:
    """A page that was let in, and notes what its browser refuses."""
    context = browser.new_context()
    context.add_init_script(NOTED)
    page = context.new_page()
    page.goto(console.entrance)
    yield page
    context.close()


def violations(page: Page) -> list[str]:
    result: list[str] = page.evaluate("window.violations")
    return result


@pytest.mark.system
@needs_browser
@pytest.mark.parametrize("address", [*ADDRESSES, "/nowhere"])
def test_every_page_works_under_the_policy(console: RunningConsole, page: Page, address: str) -> None:
    complaints: list[str] = []
    requested: set[str] = set()
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: requested.add(request.url))
    page.goto(console.address + address)
    page.get_by_role("navigation", name="Groups of pages").wait_for()
    page.locator("main").locator("*").first.wait_for()
    assert violations(page) == []
    assert complaints == []
    assert [item for item in requested if not item.startswith((console.address, "data:", "blob:"))] == []


@pytest.mark.system
@needs_browser
def test_scripts_of_others_do_not_run(console: RunningConsole, page: Page) -> None:
    page.goto(console.address + "/about")
    page.get_by_role("navigation", name="Groups of pages").wait_for()
    page.evaluate(
        """() => {
        const inline = document.createElement("script");
        inline.textContent = "window.ran = 1";
        document.body.append(inline);
        const handler = document.createElement("div");
        handler.innerHTML = `<img src="/none" onerror="window.ran = 2">`;
        document.body.append(handler);
        const far = document.createElement("script");
        far.src = "http://localhost:9/far.js";
        document.body.append(far);
        const frame = document.createElement("iframe");
        frame.src = "http://localhost:9/";
        document.body.append(frame);
        new Image().src = "http://localhost:9/picture.png";
        fetch("http://localhost:9/").catch(() => 0);
        }"""
    )
    page.wait_for_function("window.violations.length >= 6")
    directives = {item.split()[0] for item in violations(page)}
    assert directives == {"script-src-elem", "script-src-attr", "frame-src", "img-src", "connect-src"}
    assert page.evaluate("window.ran") is None


@pytest.mark.system
@needs_browser
def test_no_page_can_be_framed(console: RunningConsole, browser: Browser) -> None:
    context = browser.new_context()
    page = context.new_page()
    page.goto(console.entrance)
    page.get_by_role("navigation", name="Groups of pages").wait_for()
    outside = context.new_page()
    reported: list[str] = []
    outside.on("console", lambda message: reported.append(message.text))
    with outside.expect_event("console"):
        outside.set_content(f'<iframe src="{console.address}/about"></iframe>')
    assert any("frame" in item.lower() for item in reported)
    context.close()


def named(tls: TlsConsole) -> str:
    """Its address by the machine's name."""
    return tls.console.address.replace("lab.example", "localhost")


def client(tls: TlsConsole) -> httpx.Client:
    return httpx.Client(
        base_url=named(tls), verify=ssl.create_default_context(cafile=str(tls.certificate)), timeout=HANGS_S
    )


@pytest.mark.system
def test_the_printed_address_is_by_the_name_that_was_allowed(tls: TlsConsole) -> None:
    assert tls.console.address.startswith("https://lab.example:")


@pytest.mark.system
def test_tls_is_real_and_nothing_else_is_answered(tls: TlsConsole) -> None:
    port = httpx.URL(tls.console.address).port
    context = ssl.create_default_context(cafile=str(tls.certificate))
    with (
        socket.create_connection(("127.0.0.1", port)) as plain,
        context.wrap_socket(plain, server_hostname="lab.example") as wrapped,
    ):
        assert wrapped.version() in ("TLSv1.2", "TLSv1.3")
    with pytest.raises(httpx.TransportError):
        httpx.get(f"http://127.0.0.1:{port}/", timeout=HANGS_S)


@pytest.mark.system
def test_a_script_comes_in_with_the_key_and_a_login_with_its_cookie(tls: TlsConsole) -> None:
    with client(tls) as user:
        assert user.get("/records").status_code == 401
        assert user.get("/records", headers=tls.console.key).status_code == 200
        into = user.post("/login", data={"name": "anna", "password": PASSWORD, "then": "/records"})
        assert (into.status_code, into.headers["location"]) == (303, "/records")
        cookie = into.headers["set-cookie"]
        assert cookie.startswith("__Host-tsis-console-")
        assert {"Secure", "HttpOnly", "SameSite=Strict", "Path=/"} <= set(cookie.split("; "))
        headers = {"Cookie": cookie.partition(";")[0], "Origin": named(tls)}
        assert upgraded(named(tls), "/live", headers) == 101
        unsafe = {**headers, "Origin": named(tls).replace("https", "http")}
        assert upgraded(named(tls), "/live", unsafe) == 403
        named_so = user.get("/about", headers={**tls.console.key, "Host": "lab.example"})
        assert "max-age" in named_so.headers["strict-transport-security"]
        assert "strict-transport-security" not in user.get("/about", headers=tls.console.key).headers


def complaints_of(page: Page) -> list[str]:
    result: list[str] = []
    page.on("console", lambda message: result.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: result.append(str(error)))
    return result


@pytest.mark.system
@needs_browser
def test_somebody_logs_in_works_and_logs_out(tls: TlsConsole, browser: Browser) -> None:
    context = browser.new_context(ignore_https_errors=True, viewport={"width": 1280, "height": 800})
    page = context.new_page()
    complaints = complaints_of(page)
    page.goto(named(tls) + "/records?sort=name")
    page.get_by_role("heading", name="Log in to the console").wait_for()
    picture(page, "login")
    page.get_by_label("Name").fill("anna")
    page.get_by_label("Password").fill("not the password")
    page.get_by_role("button", name="Log in").click()
    page.get_by_role("alert").wait_for()
    picture(page, "login-wrong")
    assert all("401" in item for item in complaints)
    complaints.clear()
    page.get_by_label("Name").fill("anna")
    page.get_by_label("Password").fill(PASSWORD)
    page.keyboard.press("Enter")
    page.wait_for_url("**/records?sort=name")
    page.get_by_role("navigation", name="Groups of pages").wait_for()
    page.goto(named(tls) + "/")
    page.get_by_role("button", name="Release the camera").wait_for()
    watcher = context.new_page()
    watcher.goto(named(tls) + "/")
    watcher.get_by_text("anna controls the camera; you are watching.").wait_for()
    assert not complaints
    picture(page, "logged-in")
    watcher.goto(named(tls) + "/logout")
    watcher.get_by_text("Logged in as anna").wait_for()
    picture(watcher, "logout")
    page.get_by_role("button", name="Log out").click()
    page.get_by_role("heading", name="You are logged out").wait_for()
    picture(page, "logged-out")
    page.goto(named(tls) + "/")
    page.get_by_role("heading", name="Log in to the console").wait_for()
    context.close()


@pytest.mark.system
@needs_browser
@pytest.mark.parametrize(("width", "height", "scheme"), [(1024, 768, "light"), (1280, 800, "dark"), (390, 700, "dark")])
def test_the_login_can_be_read_everywhere(
    tls: TlsConsole, browser: Browser, width: int, height: int, scheme: str
) -> None:
    context = browser.new_context(
        ignore_https_errors=True,
        viewport={"width": width, "height": height},
        color_scheme="dark" if scheme == "dark" else "light",
    )
    page = context.new_page()
    complaints = complaints_of(page)
    page.goto(named(tls) + "/")
    page.get_by_label("Name").wait_for()
    assert page.evaluate("document.activeElement.name") == "name"
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    picture(page, f"login-{scheme}-{width}")
    assert not complaints
    context.close()


@pytest.mark.system
@needs_browser
def test_a_login_that_is_taken_away_closes_the_open_page(tls: TlsConsole, browser: Browser) -> None:
    tls.logins.add("bert", PASSWORD)
    context = browser.new_context(ignore_https_errors=True)
    page = context.new_page()
    page.goto(named(tls) + "/login")
    page.get_by_label("Name").fill("bert")
    page.get_by_label("Password").fill(PASSWORD)
    with page.expect_websocket(lambda socket: "_nicegui_ws" in socket.url) as opened:
        page.get_by_role("button", name="Log in").click()
    page.get_by_role("button", name="Release the camera").wait_for()  # the page has its WebSocket
    if not opened.value.is_closed():
        with opened.value.expect_event("close"):
            tls.logins.remove("bert")
    page.reload()
    page.get_by_role("heading", name="Log in to the console").wait_for()
    context.close()

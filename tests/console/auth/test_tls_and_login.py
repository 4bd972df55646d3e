"""A console as on a network: TLS by a certificate, people by a name and a password, in a real browser."""

from __future__ import annotations

import socket
import ssl
from typing import TYPE_CHECKING

import httpx
import pytest
from tests.console.auth.conftest import PASSWORD
from tests.console.auth.plain_requests import upgraded
from tests.console.browser import needs_browser, picture
from tests.waiting import HANGS_S

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page
    from tests.console.auth.conftest import TlsConsole

pytestmark = pytest.mark.system


def named(tls: TlsConsole) -> str:
    """Its address by the machine's name."""
    return tls.console.address.replace("lab.example", "localhost")


def client(tls: TlsConsole) -> httpx.Client:
    return httpx.Client(
        base_url=named(tls), verify=ssl.create_default_context(cafile=str(tls.certificate)), timeout=HANGS_S
    )


def test_the_printed_address_is_by_the_name_that_was_allowed(tls: TlsConsole) -> None:
    assert tls.console.address.startswith("https://lab.example:")


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
    page.get_by_role("navigation", name="Pages").wait_for()
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

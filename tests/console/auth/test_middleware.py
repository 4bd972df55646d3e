"""The gate around an application of the test's own: what reaches it, what does not, and what comes back."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import httpx
import pytest
from tests.console.auth.guarded import KEY, METHODS, TOKEN, answered, guarded_app

from tsis.console.auth import FAILED, LARGEST_BYTES, TOO_LARGE, Access, AuthMiddleware

if TYPE_CHECKING:
    from collections.abc import AsyncIterator


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

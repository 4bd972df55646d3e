"""Logging in and out at the gate: what is asked, what is refused, and where it leads."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import pytest
from argon2 import PasswordHasher
from tests.console.auth.guarded import TOKEN, Clock, answered, client, guarded_app

from tsis.console.auth import A_MINUTE, Logins

if TYPE_CHECKING:
    from pathlib import Path

PASSWORD = "a long enough password"


@pytest.fixture(autouse=True)
def _cheap_passwords(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hash at the least cost; `test_logins` checks the real one."""
    cheap = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
    monkeypatch.setattr("tsis.console.auth.ARGON2ID", cheap)
    monkeypatch.setattr("tsis.console.auth.NOBODY", cheap.hash("nobody's password"))


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
def test_the_login_leads_nowhere_else_and_writes_nothing_foreign_into_its_page(tmp_path: Path, then: str) -> None:
    logins = Logins(tmp_path)
    logins.add("anna", PASSWORD)
    form = answered("GET", "/login", around=guarded_app(logins=logins), params={"then": then})
    assert "evil" not in form.text
    assert "<script" not in form.text
    data = {"name": "anna", "password": PASSWORD, "then": then}
    assert answered("POST", "/login", around=guarded_app(logins=logins), data=data).headers["location"] == "/"


def test_a_console_without_logins_has_no_login() -> None:
    assert answered("GET", "/login").status_code == 401
    assert answered("POST", "/login", data={"name": "anna", "password": "x"}).status_code == 401
    assert answered("PUT", "/login").status_code == 405


def test_who_came_with_the_key_may_log_out_too() -> None:
    async def tried() -> None:
        async with client(guarded_app()) as user:
            await user.get(f"/?token={TOKEN}")
            assert (await user.get("/x")).status_code == 200
            assert "key" in (await user.post("/logout")).text
            assert (await user.get("/x")).status_code == 401

    asyncio.run(tried())

"""A gate around an application that tells what reaches it, and how to ask it without a server."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

import httpx
from starlette.applications import Starlette
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse
from starlette.routing import Route

from tsis.console.auth import Access, AuthMiddleware, LoginBound, client_name

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from tsis.console.auth import Logins

TOKEN = "t" * 43
KEY = {"authorization": f"Bearer {TOKEN}"}
METHODS = ["GET", "POST", "PUT", "PATCH", "DELETE", "HEAD", "OPTIONS"]


async def reported(request: Request) -> Response:
    """What the application sees of a request."""
    observed = {name: request.headers[name] for name in request.headers if name.startswith(("x-", "forwarded"))}
    return JSONResponse({"path": request.url.path, "visitor": client_name(request), "headers": observed})


async def counted(request: Request) -> Response:
    """How much was sent."""
    return PlainTextResponse(str(len(await request.body())))


async def broken(_: Request) -> Response:
    raise RuntimeError("secret detail")


async def page(_: Request) -> Response:
    return HTMLResponse("<script>a()</script><script src=/x.js></script>", headers={"X-Frame-Options": "ALLOW"})


ROUTES = [
    Route("/counted", counted, methods=["POST"]),
    Route("/broken", broken),
    Route("/page", page),
    Route("/{rest:path}", reported, methods=METHODS),
]


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def client(guarded_app: AuthMiddleware, **options: Any) -> httpx.AsyncClient:
    return httpx.AsyncClient(transport=httpx.ASGITransport(guarded_app), base_url="http://127.0.0.1:8642", **options)


def guarded_app(*, logins: Logins | None = None, clock: Clock | None = None, secure: bool = False) -> AuthMiddleware:
    access = Access(TOKEN, logins=logins, port=8642, secure=secure)
    attempts = LoginBound(clock=clock or Clock())
    return AuthMiddleware(Starlette(routes=ROUTES), access=access, hosts=("127.0.0.1", "localhost"), tries=attempts)


def answered(method: str, path: str, *, around: AuthMiddleware | None = None, **options: Any) -> httpx.Response:
    async def requested() -> httpx.Response:
        async with client(around or guarded_app()) as user:
            return await user.request(method, path, **options)

    return asyncio.run(requested())

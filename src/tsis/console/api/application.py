"""The calls as one application, mounted beside the pages at ``/api``."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from fastapi import APIRouter, Depends, FastAPI
from fastapi.security import HTTPBearer

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.console.api import PLACE
from tsis.console.api.responses import CONTROL, OF_CALLS, description, install_error_handlers
from tsis.console.api.routes import (
    about_router,
    calibration_router,
    camera_router,
    cameras_router,
    control_router,
    estimates_router,
    frames_router,
    jobs_router,
    press_router,
    state_router,
    targets_router,
)

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

    from tsis.console.files import Reports
    from tsis.console.services.instrument import Instrument


VERSION = "/v1"
HEADERS = ((b"tsis-notice", RESEARCH_USE_ONLY.encode()), (b"cache-control", b"no-store"))
ROUTERS = (
    state_router,
    control_router,
    cameras_router,
    camera_router,
    press_router,
    frames_router,
    calibration_router,
    jobs_router,
    targets_router,
    estimates_router,
    about_router,
)
DESCRIPTION = f"""Calls for scripts beside the pages of `tsis console`. {RESEARCH_USE_ONLY}

Every call needs `Authorization: Bearer TOKEN` with the token of the address that the console printed. Commands of
the camera need the header `{CONTROL}` as well, which `POST {VERSION}/control` gives: one client owns the camera, others
watch. Numbers are finite; null stands for unknown or unbounded values. Names carry units.
"""


def api_app(instrument: Instrument, reports: Reports) -> FastAPI:
    """The calls of an instrument as an application; ``reports`` builds the reports of its store."""
    application = FastAPI(
        title="tsis console",
        version=__version__,
        description=DESCRIPTION,
        servers=[{"url": PLACE, "description": "this console"}],
        root_path_in_servers=False,
        openapi_url="/openapi.json",
        docs_url=None,  # both would load scripts from elsewhere
        redoc_url=None,
        redirect_slashes=False,
        dependencies=[Depends(HTTPBearer(auto_error=False, description="token of the printed address"))],
    )
    application.state.instrument, application.state.reports = instrument, reports
    version = APIRouter(prefix=VERSION, responses=OF_CALLS)
    for router in ROUTERS:
        version.include_router(router)
    application.include_router(version)
    install_error_handlers(application)
    application.openapi = partial(description, application)  # type: ignore[method-assign]
    application.add_middleware(NoticeMiddleware)
    return application


class NoticeMiddleware:
    """Adds the notice of use to every response, and forbids intermediate copies."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a call on, and mark its answer."""

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *HEADERS]
            await send(message)

        await self._app(scope, receive, sent)

"""The console as one web application: gate, live view, calls for scripts, pages."""

from __future__ import annotations

from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from fastapi import FastAPI
from nicegui import app as pages
from nicegui import ui
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket  # noqa: TC002 - FastAPI reads the annotation

from tsis.__about__ import __version__
from tsis.console.api import PLACE, api_app
from tsis.console.files import files_router
from tsis.console.files.reports import Reports
from tsis.console.live.element import ADDRESS
from tsis.console.live.hub import LiveHub
from tsis.console.live.socket import live_view
from tsis.console.pages.shell import Shell
from tsis.console.pages.shell.lost import LANGUAGE, say_lost
from tsis.console.pages.shell.theme import AT_ONCE
from tsis.console.security.door import failed
from tsis.console.security.gate import Gate
from tsis.console.studies import StudyShelf

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Collection

    from starlette.types import ASGIApp

    from tsis.console.bench import Bench
    from tsis.console.security.access import Access

STATIC = Path(__file__).parent / "static"


def console_app(bench: Bench, *, access: Access, hosts: Collection[str]) -> ASGIApp:
    """The console of a bench, behind its gate; one a process, for the pages' library keeps them process-wide.

    Parameters
    ----------
    bench
        What it shows and moves.
    access
        Who is let in.
    hosts
        Names by which it may be called.
    """
    hub = LiveHub(lambda: bench.desk.acquisition)
    reports = Reports(bench.store, database=bench.terms.database)

    @asynccontextmanager
    async def living(_: FastAPI) -> AsyncIterator[None]:
        yield
        reports.close()
        hub.close()

    application = FastAPI(title="tsis console", version=__version__, openapi_url=None, lifespan=living)
    for each in (application, pages):
        each.add_exception_handler(Exception, failed)
    application.mount("/static", StaticFiles(directory=STATIC))

    @application.websocket(ADDRESS)
    async def live(socket: WebSocket) -> None:
        await live_view(socket, bench=bench, hub=hub)

    application.include_router(files_router(bench.store, reports, StudyShelf(bench.terms.workspace)))
    application.mount(PLACE, api_app(bench, reports))
    for sheet in sorted(STATIC.glob("*.css")):  # console.css, then one for each page that needs more
        ui.add_css(sheet, shared=True)
    ui.add_head_html(AT_ONCE, shared=True)
    say_lost()
    ui.run_with(
        application,
        root=Shell(bench).build,
        title="tsis console",
        favicon=(STATIC / "favicon.svg").read_text(encoding="utf-8"),
        language=LANGUAGE,
        dark=None,
        tailwind=False,
        show_welcome_message=False,
        reconnect_timeout=5.0,
        gzip_middleware_factory=None,  # pages are marked on their way out, and files are local
    )
    return Gate(application, access=access, hosts=hosts)

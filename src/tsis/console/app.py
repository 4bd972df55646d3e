"""The console as one application, and its address opened in the browser."""

from __future__ import annotations

import json
import logging
import threading
import webbrowser
from contextlib import asynccontextmanager, contextmanager, suppress
from html import escape
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from fastapi import FastAPI
from nicegui import Client, ui
from nicegui import app as pages
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket  # noqa: TC002 - FastAPI reads the annotation

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.console.api import PLACE, Calls
from tsis.console.auth import AuthMiddleware, console_folder, failed, write_private
from tsis.console.files import Reports, files_router
from tsis.console.live.hub import LiveHub, live_view
from tsis.console.live.view import ADDRESS
from tsis.console.pages.shell import AT_ONCE, LANGUAGE, Shell, set_lost_connection_text
from tsis.console.studies import StudyRepository
from tsis.errors import FileInputError

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Collection, Iterator

    from starlette.types import ASGIApp

    from tsis.console.auth import Access
    from tsis.console.services.instrument import Instrument
    from tsis.console.worker import WorkerProcess


_PAGE = Template("""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>tsis console</title>
<script>location.replace($script)</script>
<p><a href="$link">Open the console</a></p>
<p>$notice</p>
</html>
""")
_log = logging.getLogger(__name__)


@contextmanager
def opened_in_browser(address: str, *, folder: Path | None = None) -> Iterator[None]:
    """Open an address with the key in a browser; the server may start later.

    The browser opens a file that only this user may read and that redirects to the address. The file is
    removed when the block ends. Where there is no browser, or it cannot be started, nothing happens: the address was
    printed.

    Parameters
    ----------
    address
        As `serve_console` reports it.
    folder
        Folder of the file; by default `console_folder`.
    """
    page = (folder or console_folder()) / f"open-{urlsplit(address).port}.html"
    link = _PAGE.substitute(
        script=json.dumps(address).replace("<", r"\u003c"), link=escape(address), notice=RESEARCH_USE_ONLY
    )
    try:
        write_private(page, link.encode())
    except FileInputError as error:
        _log.warning("no browser is opened: %s", error)
        yield
        return
    # Browsers of the terminal return only when they are closed.
    threading.Thread(target=_open, args=(page,), name="browser", daemon=True).start()
    try:
        yield
    finally:
        with suppress(OSError):
            page.unlink()


def _open(page: Path) -> None:
    try:
        webbrowser.open(page.absolute().as_uri())
    except (webbrowser.Error, OSError) as error:
        _log.warning("no browser could be opened: %s", error)


STATIC = Path(__file__).parent / "static"


def console_app(
    instrument: Instrument, *, access: Access, hosts: Collection[str], worker: WorkerProcess | None = None
) -> ASGIApp:
    """The console of an instrument behind the authentication; one per process, since NiceGUI's pages are process-wide.

    ``hosts`` are the names by which it may be called; ``worker`` builds the reports, a new one when None.
    """
    hub = LiveHub(lambda: instrument.camera_controller.acquisition)
    reports = Reports(instrument.store, database=instrument.terms.database, worker=worker)
    calls, shell = Calls(instrument, reports), Shell(instrument)

    @asynccontextmanager
    async def living(_: FastAPI) -> AsyncIterator[None]:
        with calls.built_soon(), shell.loaded_ahead():
            yield
        for client in Client.instances.values():
            client.outbox.stop()  # its loop can miss that it is cancelled, and the end would wait for it
        reports.close()
        hub.close()

    application = FastAPI(title="tsis console", version=__version__, openapi_url=None, lifespan=living)
    for item in (application, pages):
        item.add_exception_handler(Exception, failed)
    application.mount("/static", StaticFiles(directory=STATIC))

    @application.websocket(ADDRESS)
    async def live(socket: WebSocket) -> None:
        await live_view(socket, instrument=instrument, hub=hub)

    workspace = instrument.terms.workspace
    application.include_router(files_router(instrument.store, reports, StudyRepository(workspace), workspace=workspace))
    application.mount(PLACE, calls)
    for sheet in ("console.css", "pages.css"):  # what all pages have, then what some have beside it
        ui.add_css(STATIC / sheet, shared=True)
    ui.add_head_html(AT_ONCE, shared=True)
    set_lost_connection_text()
    ui.run_with(
        application,
        root=shell.build,
        title="tsis console",
        favicon=(STATIC / "favicon.svg").read_text(encoding="utf-8"),
        language=LANGUAGE,
        dark=None,
        tailwind=False,
        show_welcome_message=False,
        reconnect_timeout=20.0,  # a shorter silence, of a busy machine or a weak radio link, loses no page and no click
        gzip_middleware_factory=None,  # pages are marked on their way out, and files are local
    )
    pages.config.quasar_config["loadingBar"]["skipHijack"] = True  # a bar that readers of the screen have no name for
    return AuthMiddleware(application, access=access, hosts=hosts)

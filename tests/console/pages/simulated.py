"""The whole console in this process, and an operator at it: no browser, no server, no port.

Pages are built by the console's own application behind its authentication; NiceGUI's simulated user opens them. What
the operator sees is what a browser would show: nothing of a closed dialog, a folded part or another tab.
"""

from __future__ import annotations

import asyncio
import gc
import json
import logging.handlers
import selectors
import time
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import httpx
from nicegui import ui
from nicegui.element import Element
from nicegui.elements.choice_element import ChoiceElement
from nicegui.elements.upload import Upload
from nicegui.testing import User
from nicegui.testing.general import nicegui_reset_globals
from nicegui.testing.user_notify import UserNotify
from tests.waiting import HANGS_S

from tsis.console.app import console_app
from tsis.console.auth import Access

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Awaitable, Callable, Iterator

    from starlette.types import ASGIApp

    from tsis.console.services.instrument import Instrument

TOKEN = "t" * 43
HOST = "console.test"
API = "/api/v1"
FIELDS = (ui.input, ui.textarea, ChoiceElement, ui.checkbox, ui.switch)
CONTROLS = (ui.button, ui.link, ui.tab, ui.checkbox, ui.switch, ui.expansion, Upload)
PAUSE_S, LONGEST_PAUSE_S = 0.05, 0.5  # of the loop's clock
SPEED = 10.0  # of the loop's clock: what pages and the library repeat every so many seconds costs no test that time
UPDATED = ("update:value", "update:modelValue")  # what a browser sends of a field that was changed


def at_console(instrument: Instrument, script: Callable[[Operator], Awaitable[None]], address: str = "/") -> None:
    """Open a page of the console of an instrument, and run what an operator does there."""

    async def done() -> None:
        async with _console(instrument) as application:
            operator = Operator(application)
            await operator.open(address)
            if instrument.control.owner() is None:
                await operator.sees("Release the camera")  # a page takes what nobody holds
            with _no_errors():
                await script(operator)

    with asyncio.Runner(loop_factory=_FastLoop) as runner:
        runner.run(done())


class _FastSelector(selectors.DefaultSelector):
    """Waits as many times shorter as the loop's clock is faster."""

    def select(self, timeout: float | None = None) -> Any:
        return super().select(timeout and timeout / SPEED)


class _FastLoop(asyncio.SelectorEventLoop):
    """An event loop with a fast clock; threads have the real one."""

    def __init__(self) -> None:
        super().__init__(_FastSelector())

    def time(self) -> float:
        return super().time() * SPEED


@contextmanager
def _no_errors() -> Iterator[None]:
    """Fail where a page logged an error: a page that fails says so in the log, and goes on."""
    handler = logging.handlers.BufferingHandler(1000)
    handler.setLevel(logging.ERROR)
    logging.getLogger().addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(handler)
    assert [record.getMessage() for record in handler.buffer] == []


@asynccontextmanager
async def _console(instrument: Instrument) -> AsyncIterator[ASGIApp]:
    replaced = ui.navigate, ui.notify, ui.download  # which the simulated user takes the place of
    gc.freeze()  # the library looks through all objects at each start and end; what was there before is exempt
    with nicegui_reset_globals():
        application = console_app(instrument, access=Access(TOKEN), hosts=(HOST,))
        try:
            async with _alive(application):
                yield application
        finally:
            ui.navigate, ui.notify, ui.download = replaced


@asynccontextmanager
async def _alive(application: ASGIApp) -> AsyncIterator[None]:
    """Start the application, and end it, as a server does."""
    orders: asyncio.Queue[dict[str, str]] = asyncio.Queue()
    reports: asyncio.Queue[Any] = asyncio.Queue()

    async def order(what: str) -> None:
        await orders.put({"type": f"lifespan.{what}"})
        report = await reports.get()
        assert report["type"] == f"lifespan.{what}.complete", report

    life = asyncio.ensure_future(application({"type": "lifespan"}, orders.get, reports.put))
    await order("startup")
    try:
        yield
    finally:
        await order("shutdown")
        await life


class Notices(UserNotify):
    """The messages that came up, of each open page apart."""

    of_pages: ClassVar[dict[str, list[str]]] = {}

    def __call__(self, message: str, **_: Any) -> None:
        self.of_pages.setdefault(ui.context.client.id, []).append(message)


class Operator:
    """Who sits before a tab of the console."""

    def __init__(self, application: ASGIApp) -> None:
        self._application = application
        self.http = httpx.AsyncClient(
            transport=httpx.ASGITransport(application, client=("127.0.0.1", 1)),
            base_url=f"http://{HOST}",
            headers={"Authorization": f"Bearer {TOKEN}"},
            follow_redirects=True,
        )
        self.user = User(self.http)
        self.user.notify = Notices()

    async def open(self, address: str) -> None:
        """Open a page."""
        await self.user.open(address)

    async def other(self, address: str = "/") -> Operator:
        """Another operator, at a tab of a browser of their own."""
        result = Operator(self._application)
        await result.open(address)
        return result

    async def requested(self, path: str) -> Any:
        """What a script reads of the console: another path to the same instrument."""
        return (await self.http.get(API + path)).raise_for_status().json()

    # what is seen

    @property
    def texts(self) -> list[str]:
        """All texts on the page."""
        return [
            text
            for element in self._shown()
            for text in (_text(element), *_options(element), getattr(element, "error", None))
            if text
        ]

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """Rows of the page's table that can be sorted, as it shows them; none while there is no table."""
        tables = (element for element in self._shown() if isinstance(element, ui.table))
        return [tuple(str(row[item["field"]]) for item in table.columns) for table in tables for row in table.rows]

    @property
    def messages(self) -> list[str]:
        """All messages that came up so far, the newest last."""
        return Notices.of_pages.setdefault(self._client.id, [])

    async def until(self, happened: Callable[[], bool], what: str) -> None:
        """Wait until something is so."""
        hangs_s, pause_s = time.monotonic() + HANGS_S, PAUSE_S
        while time.monotonic() < hangs_s:
            if happened():
                return
            await asyncio.sleep(pause_s)
            pause_s = min(1.3 * pause_s, LONGEST_PAUSE_S)  # looking over the page takes time from what it waits for
        raise AssertionError(f"{what}; the page has {self.texts} and said {self.messages}")

    async def pause(self) -> None:
        """Wait a moment, in a loop of a test."""
        await asyncio.sleep(PAUSE_S)

    async def sees(self, *texts: str) -> None:
        """Wait until each text is part of what the page shows."""
        for text in texts:
            await self.until(partial(self._is_seen, text), f"nobody sees {text!r}")

    async def misses(self, text: str) -> None:
        """Wait until no part of the page shows the text."""
        await self.until(lambda: not self._is_seen(text), f"{text!r} is still seen")

    def _is_seen(self, text: str) -> bool:
        return any(text in item for item in self.texts)

    async def hears(self, text: str) -> None:
        """Wait until a new message has this text, in whatever case; earlier messages are forgotten."""
        await self.until(
            lambda: any(text.lower() in item.lower() for item in self.messages), f"no message says {text!r}"
        )
        self.messages.clear()

    async def beside(self, name: str, text: str) -> None:
        """Wait until the error of a field has this text."""
        (field,) = self._fields(name)
        await self.until(lambda: text in (field.error or ""), f"no error of {name} says {text!r}")

    @property
    def alerts(self) -> list[str]:
        """Texts on the page that a screen reader interrupts with, apart from the banner's."""
        return [_text(element) for element in self._shown() if element.props.get("role") == "alert" and _text(element)]

    def named(self, beginning: str) -> list[str]:
        """Names of the controls that begin so, in their order."""
        return [name for element in self._within_reach() if (name := _name(element)).startswith(beginning)]

    # what is done; each waits until it can be done

    def field(self, name: str) -> Any:
        """Contents of a field."""
        (found,) = self._fields(name)
        return found.value

    def enabled(self, name: str) -> bool:
        """Whether a button can be used."""
        (found,) = self._controls(name, ui.button)
        return not found.is_ignoring_events

    async def types(self, name: str, text: str, *, enter: bool = True) -> None:
        """Replace the contents of a field, and press Enter."""
        field = await self._usable(name, self._fields)
        self._send(field, *UPDATED, value=text)
        if enter:
            self._send(field, "keydown.enter")

    async def clicks(self, name: str, kind: type[Element] = Element) -> None:
        """Click on a button, a link, a tab, a box or a switch; ``kind`` tells those of one name apart."""
        element = await self._usable(name, partial(self._controls, kind=kind))
        if isinstance(element, (ui.checkbox, ui.switch, ui.expansion)):
            self._send(element, *UPDATED, value=not element.value)
        elif isinstance(element, ui.tab):
            (tabs,) = (item for item in element.ancestors() if isinstance(item, ui.tabs))
            self._send(tabs, *UPDATED, value=element.props["name"])
        elif isinstance(element, ui.link):
            self.user.navigate.to(element.props["href"])
        else:
            self._send(element, "click")
            for menu in element:
                if isinstance(menu, ui.menu):
                    menu.open()

    async def chooses(self, name: str, option: str) -> None:
        """Choose an option, by its text, of a select, a toggle or a radio button."""
        field = await self._usable(name, self._fields)
        options = field.options if isinstance(field.options, dict) else {item: item for item in field.options}
        (key,) = (key for key, text in options.items() if text == option)
        with self._client:
            field.set_value(key)

    async def uploads(self, name: str, file: str, content: bytes) -> None:
        """Upload a file in a field, as the browser does when it was chosen."""
        field = await self._usable(name, partial(self._controls, kind=Upload))
        response = await self.http.post(field.props["url"], files={"file": (file, content)})
        assert response.status_code == 200, response.text

    def presses_escape(self, name: str) -> None:
        """Press Escape in a field."""
        (field,) = self._fields(name)
        self._send(field, "keydown.esc")

    def orders(self, **pagination: Any) -> None:
        """Order the table, as a click on its headings and below it does."""
        (table,) = (element for element in self._shown() if isinstance(element, ui.table))
        self._send(table, "request", value={"pagination": pagination})

    def chooses_rows(self, *keys: Any, chosen: bool = True) -> None:
        """Tick rows of the table by their keys, or clear their ticks."""
        (table,) = (element for element in self._shown() if isinstance(element, ui.table))
        rows = [row for row in table.rows if row[table.row_key] in keys]
        self._send(table, "selection", value={"added": chosen, "rows": rows, "keys": list(keys)})

    def presses_key(self, does: str, value: Any = None) -> None:
        """Press a key of the page, which its script reports by what the key does."""
        for element in list(self._shown()):
            self._send(element, does, value=value)

    # how it is found

    @property
    def _client(self) -> Any:
        assert self.user.client is not None
        return self.user.client

    def _shown(self, under: Element | None = None) -> Iterator[Element]:
        for element in self._client.layout if under is None else under:
            if not element.visible or isinstance(element, ui.tooltip):
                continue
            if _is_open(element) or isinstance(element, ui.expansion | ui.tab_panel):  # which have a head
                yield element
            if _is_open(element):
                yield from self._shown(element)

    def _within_reach(self) -> Iterator[Element]:
        """What can be used: of an open dialog alone, which lies over the page."""
        dialogs = [element for element in self._shown() if isinstance(element, ui.dialog) and element.value]
        return self._shown(dialogs[-1] if dialogs else None)

    def _fields(self, name: str) -> list[Any]:
        return [element for element in self._within_reach() if isinstance(element, FIELDS) and _name(element) == name]

    def _controls(self, name: str, kind: type[Element]) -> list[Any]:
        return [
            element
            for element in self._within_reach()
            if isinstance(element, kind)
            and _name(element) == name
            and (isinstance(element, CONTROLS) or any(event.type == "click" for event in _listeners(element)))
        ]

    async def _usable(self, name: str, find: Callable[[str], list[Any]]) -> Any:
        def is_one() -> bool:
            found = find(name)
            return len(found) == 1 and not found[0].is_ignoring_events

        await self.until(is_one, f"no single control is named {name!r} and enabled")
        (found,) = find(name)
        return found

    def _send(self, element: Element, *events: str, value: Any = None) -> None:
        for listener in _listeners(element):
            if listener.type in events:
                message = {"id": listener.element_id, "listener_id": listener.id, "args": [json.dumps(value)]}
                self._client.handle_event(message)


def _listeners(element: Element) -> list[Any]:
    return list(element._event_listeners.values())


def _is_open(element: Element) -> bool:
    """Whether what lies in an element is shown."""
    if isinstance(element, (ui.dialog, ui.menu, ui.expansion)):
        return bool(element.value)
    if isinstance(element, ui.tab_panel):
        (panels,) = (item for item in element.ancestors() if isinstance(item, ui.tab_panels))
        chosen = panels.value
        return bool((chosen.props["name"] if isinstance(chosen, ui.tab) else chosen) == element.props["name"])
    return True


def _text(element: Element) -> str:
    return str(getattr(element, "text", "") or element.props.get("label") or element.props.get("alt") or "")


def _options(element: Element) -> tuple[str, ...]:
    """Options that lie open on the page."""
    if not isinstance(element, (ui.radio, ui.toggle)):
        return ()
    return tuple(element.options.values() if isinstance(element.options, dict) else element.options)


def _name(element: Element) -> str:
    """What a control is called: its name for screen readers, else the text on it or its label."""
    return str(element.props.get("aria-label") or _text(element))

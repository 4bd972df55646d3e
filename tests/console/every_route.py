"""Print every route of the console's application, by the application itself; run as a program of its own."""

from __future__ import annotations

import json
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

from tsis.console.api import Calls
from tsis.console.app import console_app
from tsis.console.auth import Access
from tsis.console.pages import PAGES
from tsis.console.services.choice import InstrumentSettings
from tsis.console.services.instrument import Instrument

BELOW_A_MOUNT = ("", "/", "/x", "/console.css", "/socket.io/?EIO=4&transport=polling")
# Added while the console runs, or when it starts: uploads of a page, and the picture of the tab.
LATER = (("/_nicegui/client/x/upload/1", "POST"), ("/favicon.ico", "GET"), ("/docs", "GET"), ("/openapi.json", "GET"))


def filled(path: str) -> str:
    """A path of a pattern, with something in place of each parameter."""
    return re.sub(r"\{[^}]*\}", "1", path)


def routes_of(application: Any, prefix: str) -> list[tuple[str, str]]:
    """Address and method of each route, also of applications that are mounted; WebSockets have the method WEBSOCKET."""
    result: list[tuple[str, str]] = []
    inner = getattr(application, "routes", None)
    if inner is None:  # files, or another protocol: whatever is asked for below it
        below = [prefix + ending for ending in BELOW_A_MOUNT]
        return [(path, method) for path in below for method in ("GET", "POST", "WEBSOCKET")]
    for route in inner:
        result += routes_of_one(route, prefix)
    return result


def routes_of_one(route: Any, prefix: str) -> list[tuple[str, str]]:
    """The same, of one entry of a list of routes."""
    included = getattr(route, "effective_candidates", None)
    if included is not None:  # a router within an application
        return [item for candidate in included() for item in routes_of_one(candidate, prefix)]
    mounted = getattr(route, "app", None)
    if isinstance(mounted, Calls):
        mounted = mounted.application  # which the first call would build
    methods = getattr(route, "methods", None)
    path = prefix + filled(route.path)
    if hasattr(mounted, "routes") or (methods is None and "WebSocket" not in type(route).__name__):
        return routes_of(mounted, path)
    return [(path, method) for method in methods or ("WEBSOCKET",)]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        terms = InstrumentSettings(workspace=Path(folder) / "workspace", store=Path(folder) / "store")
        with Instrument(terms) as instrument:
            guarded_app: Any = console_app(instrument, access=Access("t" * 43), hosts=())
            every = routes_of(guarded_app._inner, "") + [(filled(page), "GET") for page in PAGES] + list(LATER)
    json.dump(sorted(set(every)), sys.stdout)

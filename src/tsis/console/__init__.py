"""The instrument in a browser, on this machine or on a network."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tsis.console._app import opened_in_browser
    from tsis.console._serving import Certificate, ConsoleTerms, serve_console
    from tsis.console.auth import Logins
    from tsis.console.services import Bench, BenchTerms

__all__ = ["Bench", "BenchTerms", "Certificate", "ConsoleTerms", "Logins", "opened_in_browser", "serve_console"]

_HOMES = {
    "Bench": "services",
    "BenchTerms": "services",
    "Certificate": "_serving",
    "ConsoleTerms": "_serving",
    "Logins": "auth",
    "opened_in_browser": "_app",
    "serve_console": "_serving",
}


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    if name in _HOMES:  # NiceGUI loads when a console is wanted
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

"""The instrument in a browser, on this machine or on a network."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from tsis.errors import require_extra

if TYPE_CHECKING:
    from tsis.console.app import opened_in_browser
    from tsis.console.auth import Logins
    from tsis.console.services.choice import InstrumentSettings
    from tsis.console.services.instrument import Instrument
    from tsis.console.serving import Certificate, ConsoleSettings, serve_console
    from tsis.console.worker import solving_process

__all__ = [
    "Certificate",
    "ConsoleSettings",
    "Instrument",
    "InstrumentSettings",
    "Logins",
    "opened_in_browser",
    "serve_console",
    "solving_process",
]

require_extra("nicegui", "fastapi", "uvicorn", "argon2", "itsdangerous", feature="the console", extra="console")

_HOMES = {
    "Certificate": "serving",
    "ConsoleSettings": "serving",
    "Instrument": "services.instrument",
    "InstrumentSettings": "services.choice",
    "Logins": "auth",
    "opened_in_browser": "app",
    "serve_console": "serving",
    "solving_process": "worker",
}


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    if name in _HOMES:  # NiceGUI is loaded with the first use
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

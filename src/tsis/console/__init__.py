"""The instrument in a browser: pages, a live view and calls for scripts, behind a gate.

What stands here loads when it is first named: the library of the pages takes seconds, and ``tsis login`` needs none.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchTerms
    from tsis.console.security.logins import Logins
    from tsis.console.serving import ConsoleTerms, serve_console
    from tsis.console.tls import Certificate

__all__ = ["Bench", "BenchTerms", "Certificate", "ConsoleTerms", "Logins", "serve_console"]

_FROM = {
    "Bench": "bench",
    "BenchTerms": "bench",
    "Certificate": "tls",
    "ConsoleTerms": "serving",
    "Logins": "security.logins",
    "serve_console": "serving",
}


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    if name in _FROM:
        return getattr(import_module(f"{__name__}.{_FROM[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

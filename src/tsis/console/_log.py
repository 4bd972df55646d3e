"""Log of a running console: one line per error on the terminal, everything in a file."""

from __future__ import annotations

import asyncio
import logging
from contextlib import contextmanager
from logging.handlers import RotatingFileHandler
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


FILE = "console.log"
LARGEST_BYTES = 2**20
SOURCES = ("tsis", "nicegui", "uvicorn.error", "asyncio")
LOGINS = "tsis.console.auth"  # of it the file holds who came in, too
_NOT_LOGGED = (
    "timeout graceful shutdown exceeded",  # an open page was ended with the console
    "Invalid HTTP request received",  # anybody can send such, as often as he likes, and was answered
    "Unsupported upgrade request",
)


class OneLineFormatter(logging.Formatter):
    """The message and the error, without traceback."""

    def format(self, record: logging.LogRecord) -> str:
        """One line."""
        text = record.getMessage()
        error = record.exc_info[1] if record.exc_info else None
        if error is not None:
            text = f"{text}: {type(error).__name__}: {error}"
        return f"{record.levelname.capitalize()}: {' '.join(text.split())[:500]}"


class FullLogHandler(RotatingFileHandler):
    """The log file; write errors are ignored."""

    def handleError(self, _: logging.LogRecord) -> None:  # noqa: N802 - the library's name
        """Do nothing: on a full disk a message would repeat for each line."""


@contextmanager
def logging_to(folder: Path) -> Iterator[None]:
    """Log the console and its libraries inside the block: to `FILE` of the folder, and to the terminal."""
    whole = FullLogHandler(folder / FILE, maxBytes=LARGEST_BYTES, backupCount=2, encoding="utf-8", delay=True)
    whole.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    short = logging.StreamHandler()
    short.setFormatter(OneLineFormatter())
    for handler, level in ((whole, logging.INFO), (short, logging.WARNING)):
        handler.setLevel(level)
        handler.addFilter(_is_logged)
    sources = [logging.getLogger(name) for name in SOURCES]
    for source in sources:
        source.addHandler(whole)
        source.addHandler(short)
    logins = logging.getLogger(LOGINS)
    level = logins.level
    logins.setLevel(logging.INFO)
    try:
        yield
    finally:
        logins.setLevel(level)
        for source in sources:
            source.removeHandler(whole)
            source.removeHandler(short)
        whole.close()


def _is_logged(record: logging.LogRecord) -> bool:
    if record.levelno < logging.WARNING and not record.name.startswith(LOGINS):
        return False
    if record.exc_info and isinstance(record.exc_info[1], asyncio.CancelledError):  # what waited when the console ended
        return False
    return not any(item in record.getMessage() for item in _NOT_LOGGED)

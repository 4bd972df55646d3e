"""Open the console in this user's browser. Its key stands on no command line: those can be read by every user."""

from __future__ import annotations

import json
import logging
import threading
import webbrowser
from contextlib import contextmanager, suppress
from html import escape
from string import Template
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.console.security.private_files import console_folder, write_private
from tsis.model.errors import FileInputError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

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
    """Have a browser open an address that holds the key; it may begin to listen and to serve only later.

    The browser is told to open a file that this user alone may read, and that leads on to the address. The file is
    removed when the block ends. Where there is no browser, or it cannot be started, nothing happens: the address was
    printed.

    Parameters
    ----------
    address
        The one that `serve_console` tells.
    folder
        Where the file lies; by default `console_folder`.
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

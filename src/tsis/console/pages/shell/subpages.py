"""The present page, and what is said in its place when there is none or it cannot be built."""

from __future__ import annotations

import logging

from nicegui import ui

_log = logging.getLogger(__name__)


class Subpages(ui.sub_pages):
    """Pages by address; an address without a page, or a page that fails, gives a sentence and a way out."""

    def _render_404(self) -> None:
        _instead("There is no page at this address. The links above lead to all there are.")

    def _render_error(self, _: Exception) -> None:
        _log.exception("a page could not be built")
        _instead("This page could not be built. What was kept is safe; the other pages work. Try to load it anew.")


def _instead(sentence: str) -> None:
    with ui.element("section").classes("panel"):
        ui.label(sentence)
        ui.link("To the live image", "/")

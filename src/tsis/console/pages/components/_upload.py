"""An upload field for one file, with names for screen readers."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from nicegui.elements.upload import Upload

if TYPE_CHECKING:
    from tsis.console.pages.components._viewer import Viewer


_NAME = """
(function name(left) {
  const field = getHtmlElement(%d);
  const parts = field ? field.querySelectorAll("a.q-btn, input[type=file]") : [];
  parts.forEach((part) => part.setAttribute("aria-label", %s));
  if (!parts.length && left) setTimeout(() => name(left - 1), 100);
})(50);
"""  # the field may come a moment after this


def name_parts(upload: Upload, name: str) -> None:
    """Name the field's button and input for screen readers: its library gives them icons alone."""
    upload.client.run_javascript(_NAME % (upload.id, json.dumps(name)))


LARGEST_MIB = 31  # limit of the authentication for a request, less the parts around the file


class FileField(Upload):
    """As `nicegui.ui.upload`, but it releases its callbacks when it is deleted.

    FastAPI remembers the last few thousand functions that ever answered an address; through the callbacks of a deleted
    field they would keep the whole page of its browser tab in memory.
    """

    def _handle_delete(self) -> None:
        super()._handle_delete()
        for handlers in (self._begin_upload_handlers, self._upload_handlers, self._multi_upload_handlers):
            handlers.clear()


def one_file(
    viewer: Viewer, label: str, *, accept: str, refused: str, most_bytes: int = LARGEST_MIB * 2**20
) -> FileField:
    """A field that uploads one file as soon as it is chosen.

    ``accept`` are endings that the browser offers, as ``".csv,text/csv"``; ``refused`` is said of other files.
    """
    field = FileField(
        label=label,
        auto_upload=True,
        max_files=1,
        max_file_size=most_bytes,
        on_rejected=lambda: viewer.complain(refused),
    ).props("flat bordered")
    field.props["accept"] = accept
    name_parts(field, f"Choose: {label}")
    return field

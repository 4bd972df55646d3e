"""Names for the parts of an upload field: its library gives them icons alone."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nicegui.elements.upload import Upload

_NAME = """
(function name(left) {
  const field = getHtmlElement(%d);
  const parts = field ? field.querySelectorAll("a.q-btn, input[type=file]") : [];
  parts.forEach((part) => part.setAttribute("aria-label", %s));
  if (!parts.length && left) setTimeout(() => name(left - 1), 100);
})(50);
"""  # the field may come a moment after this


def name_parts(upload: Upload, words: str) -> None:
    """Give the field's button and input a name for readers of the screen.

    Parameters
    ----------
    upload
        The field.
    words
        What is chosen with it.
    """
    upload.client.run_javascript(_NAME % (upload.id, json.dumps(words)))

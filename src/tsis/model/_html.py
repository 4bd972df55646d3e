"""Small HTML summaries of values, which notebooks show."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.files import encode_picture

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray


THUMBNAIL_PX = 240  # longest side
CELL = "text-align:left;padding:1px 12px 1px 0"


def summary_html(
    title: str,
    rows: Iterable[tuple[str, ...]],
    *,
    headings: tuple[str, ...] = (),
    picture: str = "",
    result: bool = False,
) -> str:
    """A table in HTML without scripts and external resources; every text is escaped.

    Parameters
    ----------
    title
        The heading.
    rows
        The cells of each row.
    headings
        Headings of the columns, if any.
    picture
        Address of a picture beside the table, e.g. of `thumbnail`.
    result
        Whether the value is a result; then the notice of research use stands below.
    """
    head = "".join(f'<th style="{CELL}">{escape(item)}</th>' for item in headings)
    body = "".join(
        "<tr>" + "".join(f'<td style="{CELL}">{escape(cell)}</td>' for cell in row) + "</tr>" for row in rows
    )
    image = f'<img alt="{escape(title)}" src="{escape(picture)}">' if picture else ""
    notice = f"<p><strong>{RESEARCH_USE_ONLY}</strong></p>" if result else ""
    table = f"<table>{f'<tr>{head}</tr>' if head else ''}{body}</table>"
    return f"<div><p><strong>{escape(title)}</strong></p>{image}{table}{notice}</div>"


def thumbnail(grey: NDArray[np.float64], full_scale: float) -> str:
    """Grey levels as a small PNG file in a data address; black is 0 and white the full scale."""
    step = -(-max(grey.shape) // THUMBNAIL_PX)
    levels = np.clip(grey[::step, ::step] * (255.0 / full_scale), 0.0, 255.0).astype(np.uint8)
    return f"data:image/png;base64,{base64.b64encode(encode_picture(levels)).decode()}"

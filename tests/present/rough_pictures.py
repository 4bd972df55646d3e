"""Pictures of reports without layout and rendering, for tests that look at other things of a report."""

from __future__ import annotations

import io
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest
from matplotlib.figure import Figure
from PIL import Image

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.present.page import Picture


def png_of_one_pixel() -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", (1, 1)).save(buffer, format="PNG")
    return buffer.getvalue()


EMPTY_SVG = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
EMPTY_PNG = png_of_one_pixel()


@contextmanager
def rough_pictures() -> Iterator[None]:
    """Draw one picture of each title, and spare its layout and rendering."""
    titles = set[str]()

    def drawn(picture: Picture, size: tuple[float, float], *, kind: str, dpi: float) -> bytes:
        if picture.title not in titles:
            picture.draw(Figure(figsize=size))
            titles.add(picture.title)
        return EMPTY_SVG if kind == "svg" else EMPTY_PNG

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tsis.present.page._drawn", drawn)
        yield

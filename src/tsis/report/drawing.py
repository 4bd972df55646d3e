"""From a picture to bytes: a data address for a web page, pixels for paper; equal drawings give equal bytes."""

from __future__ import annotations

import base64
import io
import threading
from typing import TYPE_CHECKING

import matplotlib as mpl
from matplotlib.figure import Figure
from PIL import Image

if TYPE_CHECKING:
    from tsis.report.page import Picture

DPI = 120
PAPER_DPI = 220  # at the size at which a picture stands on the paper
ONE_AT_A_TIME = threading.Lock()  # matplotlib has settings and a cache of letters for the whole program


def address(picture: Picture) -> str:
    """The picture as a data address: SVG, or PNG where it is no line drawing."""
    content = _drawn(picture, picture.size, kind="svg" if picture.vector else "png", dpi=DPI)
    kind = "image/svg+xml" if picture.vector else "image/png"
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def pixels(picture: Picture, *, size: tuple[float, float], dpi: float = PAPER_DPI) -> bytes:
    """The picture as an opaque PNG file, drawn on ``size`` inches: paper has no use for transparency."""
    buffer = io.BytesIO()
    with Image.open(io.BytesIO(_drawn(picture, size, kind="png", dpi=dpi))) as drawn:
        drawn.convert("RGB").save(buffer, format="PNG")
    return buffer.getvalue()


def _drawn(picture: Picture, size: tuple[float, float], *, kind: str, dpi: float) -> bytes:
    with ONE_AT_A_TIME, mpl.rc_context({"svg.hashsalt": "tsis", "font.size": 9.0}):
        figure = Figure(figsize=size, layout="constrained")
        picture.draw(figure)
        buffer = io.BytesIO()
        if kind == "svg":
            figure.savefig(buffer, format="svg", dpi=dpi, metadata={"Date": None})
        else:
            figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()

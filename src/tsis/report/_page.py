"""One self-contained HTML page: no script, no address outside itself."""

from __future__ import annotations

import base64
import io
import threading
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from matplotlib.figure import Figure
from PIL import Image

from tsis.__about__ import RESEARCH_USE_ONLY, __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


DPI = 120
PAPER_DPI = 220  # at the size at which a picture stands on the paper
FIGURE_LOCK = threading.Lock()  # matplotlib has settings and a cache of letters for the whole program


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
    with FIGURE_LOCK, mpl.rc_context({"svg.hashsalt": "tsis", "font.size": 9.0}):
        figure = Figure(figsize=size, layout="constrained")
        picture.draw(figure)
        buffer = io.BytesIO()
        if kind == "svg":
            figure.savefig(buffer, format="svg", dpi=dpi, metadata={"Date": None})
        else:
            figure.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """One number that the reader came for."""

    title: str
    value: str
    detail: str = ""
    doubtful: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure with a caption, and words for those who do not see it.

    Attributes
    ----------
    title
        Its heading.
    draw
        Draws it into an empty figure, the same each time; whoever shows the page calls it.
    size
        Width and height in inches at which letters have 9 points.
    alt
        What it shows, in words.
    caption
        What to know to read it.
    wide
        Whether it takes the page's whole width.
    vector
        Whether it is a line drawing; a relief of many facets is smaller as pixels.
    """

    title: str
    draw: Callable[[Figure], None]
    size: tuple[float, float]
    alt: str
    caption: str = ""
    wide: bool = False
    vector: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Rows of text under headings."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """What a page shows, from top to bottom; ``refused`` holds (estimate, reason)."""

    title: str
    subtitle: str
    cards: tuple[Card, ...] = ()
    notes: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    refused: tuple[tuple[str, str], ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)


def html(page: Page) -> bytes:
    """The page as UTF-8."""
    environment = Environment(
        loader=PackageLoader("tsis.report"),
        autoescape=select_autoescape(default=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    template = environment.get_template("page.html")
    return template.render(page=page, notice=RESEARCH_USE_ONLY, version=__version__, address=address).encode(
        errors="backslashreplace"
    )

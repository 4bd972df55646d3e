"""One self-contained HTML page: no script, no address outside itself."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from matplotlib.figure import Figure

from tsis.__about__ import RESEARCH_USE_ONLY, __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

DPI = 120


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """One number that the reader came for."""

    title: str
    value: str
    detail: str = ""
    doubtful: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure with a caption, and words for those who do not see it."""

    title: str
    source: str
    alt: str
    caption: str = ""
    wide: bool = False


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


def picture_source(draw: Callable[[Figure], None], *, size: tuple[float, float], vector: bool = True) -> str:
    """Draw a figure of ``size`` inches and return it as a data address; equal drawings give equal bytes."""
    with mpl.rc_context({"svg.hashsalt": "tsis", "font.size": 9.0}):
        figure = Figure(figsize=size, layout="constrained")
        draw(figure)
        buffer = io.BytesIO()
        if vector:
            figure.savefig(buffer, format="svg", dpi=DPI, metadata={"Date": None})
        else:
            figure.savefig(buffer, format="png", dpi=DPI)
    kind = "image/svg+xml" if vector else "image/png"
    return f"data:{kind};base64,{base64.b64encode(buffer.getvalue()).decode()}"


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
    return template.render(page=page, notice=RESEARCH_USE_ONLY, version=__version__).encode()

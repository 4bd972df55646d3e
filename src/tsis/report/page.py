"""One self-contained HTML page: no script, no address outside itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.report.drawing import address

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.figure import Figure


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

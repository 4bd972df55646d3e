"""Content of a report: a page of main results, texts, figures and tables, whatever shows it."""

from __future__ import annotations

import base64
import io
import threading
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tsis.model.flag import Flag

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from matplotlib.figure import Figure


DPI = 120
PAPER_DPI = 220  # at the size on paper
GROUND = "#fefefe"  # what lies on it follows light and dark, unlike white over an image
ON_IMAGE = "#010101"  # black that stays black in the dark: it lies over an image
DARK = {  # colours of drawings, and what they are in the dark
    "#000000": "#e8edf2",
    GROUND: "#1a2128",
    "#333333": "#c7d0d9",
    "#404040": "#c7d0d9",
    "#666666": "#9fb0bf",
    "#f0f0f0": "#2a333c",
    "#f3e3d3": "#463b31",  # tissue
    "#0072b2": "#56b4e9",
    "#1f77b4": "#6cb8f0",
    "#1f3b57": "#8fb4d9",
    "#d55e00": "#f0a35e",
}
FIGURE_LOCK = threading.Lock()  # matplotlib's settings and glyph cache are global


def address(picture: Picture) -> str:
    """The picture as a data URL of an SVG, whose colours are those of the page's ``color-scheme``, light or dark."""
    return f"data:image/svg+xml;base64,{base64.b64encode(_svg(picture)).decode()}"


def pixels(picture: Picture, *, size: tuple[float, float], dpi: float = PAPER_DPI, compress_level: int = 6) -> bytes:
    """The picture as an opaque PNG file of ``size`` inches; what reads it at once needs no compression."""
    import numpy as np  # all loaded with the first figure
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    buffer = io.BytesIO()
    with _figure(picture, size, dpi=dpi) as figure:
        canvas: Any = FigureCanvasAgg(figure)  # which has no types
        canvas.draw()  # once: ``savefig`` draws every figure twice, for its layout first
        drawn = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    drawn.save(buffer, format="PNG", compress_level=compress_level)
    return buffer.getvalue()


def _svg(picture: Picture) -> bytes:
    buffer = io.BytesIO()
    with _figure(picture, picture.size, dpi=DPI, **CLEAR) as figure:
        for ax in figure.axes:
            for drawn in () if picture.vector else ax.collections:
                drawn.set_rasterized(True)
        figure.savefig(buffer, format="svg", dpi=DPI, metadata={"Date": None})
    dark = "".join(
        f'[style*="{part}: {light}"]{{{part}:{colour}!important}}'
        for light, colour in DARK.items()
        for part in ("fill", "stroke")
    )  # text has no fill of its own
    sheet = f"<style>@media(prefers-color-scheme:dark){{svg{{fill:{DARK['#000000']}}}{dark}}}</style></defs>"
    return buffer.getvalue().replace(b"</defs>", sheet.encode(), 1)


CLEAR = {"figure.facecolor": "none", "axes.facecolor": "none", "savefig.facecolor": "none", "legend.facecolor": GROUND}


@contextmanager
def _figure(picture: Picture, size: tuple[float, float], *, dpi: float, **settings: str) -> Iterator[Figure]:
    """The picture drawn into a figure that nothing else changes meanwhile, under more settings of matplotlib."""
    import matplotlib as mpl  # loaded with the first figure
    from matplotlib.figure import Figure

    under: Any = {"svg.hashsalt": "tsis", "font.size": 9.0, **settings}
    with FIGURE_LOCK, mpl.rc_context(under):
        figure = Figure(figsize=size, dpi=dpi, layout="constrained")
        picture.draw(figure)
        yield figure


def on_axes(plot: Callable[..., object], *values: Any, **options: Any) -> Callable[[Figure], None]:
    """The drawing of ``plot(*values, ax, **options)`` into a figure with one axes."""

    def draw(figure: Figure) -> None:
        plot(*values, figure.subplots(), **options)

    return draw


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """A main result."""

    title: str
    value: str
    detail: str = ""
    doubtful: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure with a caption and an alternative text.

    Attributes
    ----------
    title
        The heading.
    draw
        Draws the figure into an empty one, reproducibly.
    size
        Width and height in inches for text of 9 points.
    alt
        Description of the content.
    caption
        Explanation below the figure.
    wide
        Whether it takes the whole width of the page.
    vector
        Whether it is a line drawing; of others the facets and cells become pixels, which are smaller.
    """

    title: str
    draw: Callable[[Figure], None]
    size: tuple[float, float]
    alt: str
    caption: str = ""
    wide: bool = False
    vector: bool = True


Value = str | float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of numbers: its label, their unit, and how they are rounded.

    ``form`` is a format specification, or a call that makes the text of a number.
    """

    label: str
    unit: str = ""
    form: str | Callable[[float], str] = "g"

    @property
    def heading(self) -> str:
        """The label over the unit."""
        return f"{self.label} / {self.unit}" if self.unit else self.label

    def text(self, value: Value) -> str:
        """A cell: a rounded number, a text as it is, or a dash where there is none."""
        if value is None:
            return "-"
        if isinstance(value, str):
            return value
        return self.form(value) if callable(self.form) else format(value, self.form)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Values in rows; a column is the heading of texts, or a `Column` of numbers."""

    title: str
    columns: tuple[str | Column, ...]
    values: tuple[tuple[Value, ...], ...]

    @property
    def headings(self) -> tuple[str, ...]:
        """What stands above the columns."""
        return tuple(column if isinstance(column, str) else column.heading for column in self.columns)

    @property
    def rows(self) -> tuple[tuple[str, ...], ...]:
        """The texts of the cells."""
        return tuple(self._texts(row) for row in self.values)

    def _texts(self, row: tuple[Value, ...]) -> tuple[str, ...]:
        columns = (*self.columns, *("",) * (len(row) - len(self.columns)))
        return tuple(
            column.text(value) if isinstance(column, Column) else "-" if value is None else str(value)
            for column, value in zip(columns, row, strict=False)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """The content of a page, from top to bottom; ``refused`` has (estimate, reason)."""

    title: str
    subtitle: str
    cards: tuple[Card, ...] = ()
    notes: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    refused: tuple[tuple[str, str], ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)


def flags_table(flags: Iterable[str], known: Mapping[str, Flag]) -> tuple[Table, ...]:
    """What each flag of a result says, what to do, and whether it withholds numbers; no table without flags."""
    rows = tuple(
        (name, item.means, item.cure, "withheld" if item.withholds else "shown")
        for name in flags
        for item in [known.get(name, Flag(name=name, means="unknown to this program"))]
    )
    columns = ("flag", "what it means", "what to do", "numbers")
    return (Table(title="Flags", columns=columns, values=rows),) if rows else ()

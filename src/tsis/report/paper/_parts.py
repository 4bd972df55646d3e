"""Cards, pictures and provenance on paper."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from reportlab.platypus import Image, Paragraph, Spacer, Table

from tsis.report._page import PAPER_DPI, pixels
from tsis.report.paper._table import table
from tsis.report.paper._text import (
    BLUE,
    BOLD,
    CODE,
    GAP,
    HEIGHT,
    INK,
    LINE,
    SANS,
    SMALL,
    SOFT,
    WARM,
    WIDTH,
    drawable_text,
    line,
    markup,
    paragraphs,
    style,
    width,
)

if TYPE_CHECKING:
    from tsis.report._page import Card, Picture


CARDS = 4  # in a row
LONG_CARD, LONG_CAPTION = 200, 400  # letters; longer texts are placed below
VALUE_SIZES = (14, 12, 10, 8.5)
EASE = 1.3  # pictures are drawn larger by this factor: text of 9 points becomes 7
TALLEST, TALLEST_WIDE = 0.32 * HEIGHT, 0.8 * HEIGHT
POINTS = 72.0  # an inch
LEAST_POINTS = 36.0  # a side of a picture
PADDING = 6.0


def cards(given: Sequence[Card]) -> list[Any]:
    """Cards in rows; cards with long texts follow as a table."""
    short = [card for card in given if _longest(card) <= LONG_CARD]
    long = [(card.title, card.value, card.detail) for card in given if _longest(card) > LONG_CARD]
    rows = [_card_row(short[start : start + CARDS], min(CARDS, len(short))) for start in range(0, len(short), CARDS)]
    return [*rows, *(table(("result", "value", "detail"), long) if long else [])]


def _longest(card: Card) -> int:
    return max(len(drawable_text(text)) for text in (card.title, card.value, card.detail))


def _card_row(given: Sequence[Card], count: int) -> Table:
    wide = (WIDTH - (count - 1) * GAP) / count
    cells: list[Any] = []
    looks: list[Any] = [("VALIGN", (0, 0), (-1, -1), "TOP"), *_no_padding()]
    for number, card in enumerate(given):
        position = 2 * number
        cells += [_card(card, wide - 2 * PADDING), ""]
        looks += [
            ("BOX", (position, 0), (position, 0), 0.5, LINE),
            ("LINEBEFORE", (position, 0), (position, 0), 2.5, WARM if card.doubtful else BLUE),
            ("LEFTPADDING", (position, 0), (position, 0), PADDING),
            ("RIGHTPADDING", (position, 0), (position, 0), PADDING),
            ("TOPPADDING", (position, 0), (position, 0), 4),
            ("BOTTOMPADDING", (position, 0), (position, 0), 5),
        ]
    cells = (cells + ["", ""] * count)[: 2 * count - 1]
    widths = [wide if index % 2 == 0 else GAP for index in range(2 * count - 1)]
    return Table([cells], colWidths=widths, style=looks, spaceAfter=GAP)


def _card(card: Card, wide: float) -> list[Paragraph]:
    drawn = drawable_text(_single_line(card.value), BOLD)
    size = next((size for size in VALUE_SIZES if width(drawn, BOLD, size) <= wide), VALUE_SIZES[-1])
    value = style(size, BOLD, textColor=WARM if card.doubtful else BLUE, spaceBefore=1, spaceAfter=2)
    detail = _single_line(card.detail)
    parts = [line(_single_line(card.title), style(8, SANS, textColor=INK)), line(_single_line(card.value), value)]
    return [*parts, *([line(detail, style(7, SANS, textColor=SOFT))] if detail else [])]


def _single_line(text: str) -> str:
    return " ".join(text.split())


def picture_rows(given: Sequence[Picture]) -> list[list[Any]]:
    """Rows of two pictures, or of a wide one, with long captions below the row."""
    rows: list[list[Picture]] = []
    for picture in given:
        if not picture.wide and rows and len(rows[-1]) == 1 and not rows[-1][0].wide:
            rows[-1].append(picture)
        else:
            rows.append([picture])
    return [_picture_row(row) for row in rows]


def _picture_row(row: Sequence[Picture]) -> list[Any]:
    wide = WIDTH if row[0].wide else (WIDTH - GAP) / 2
    drawn = [[_image(picture, wide), Spacer(1, 2), *_caption(picture)] for picture in row]
    spread: list[Any] = drawn if row[0].wide else [drawn[0], "", drawn[1] if len(drawn) > 1 else ""]
    widths = [wide] if row[0].wide else [wide, GAP, wide]
    looks = [("VALIGN", (0, 0), (-1, -1), "TOP"), *_no_padding()]
    below = [part for picture in row for part in _long_caption(picture)]
    return [Table([spread], colWidths=widths, style=looks, spaceAfter=8), *below]


def _image(picture: Picture, wide: float) -> Image:
    tall = TALLEST_WIDE if picture.wide else TALLEST
    size = picture.size[0] * POINTS, picture.size[1] * POINTS
    shrink = min(1.0, EASE * wide / size[0], EASE * tall / size[1])
    drawn = tuple(max(shrink * side, LEAST_POINTS) for side in size)
    position = min(wide / drawn[0], tall / drawn[1], 1.0)
    content = pixels(picture, size=(drawn[0] / POINTS, drawn[1] / POINTS), dpi=PAPER_DPI * position)
    return Image(io.BytesIO(content), width=position * drawn[0], height=position * drawn[1], hAlign="LEFT")


def _alternative_text(picture: Picture) -> str:
    """Caption and alternative text, which paper shows both."""
    parts = {_with_full_stop(part): None for part in (picture.caption, picture.alt) if part.strip()}
    return " ".join(part for part in parts if part != _with_full_stop(picture.title))


def _with_full_stop(text: str) -> str:
    message = _single_line(text)
    return message if message.endswith((".", "!", "?")) else f"{message}."


def _long(text: str) -> bool:
    return len(drawable_text(text)) > LONG_CAPTION


def _caption(picture: Picture) -> list[Paragraph]:
    title, text = _with_full_stop(picture.title), _alternative_text(picture)
    heading = "Named below." if _long(title) else title
    message = "Described below." if _long(text) else text
    return [Paragraph(f'<font name="{BOLD}" color="#1b1f24">{markup(heading, BOLD)}</font> {markup(message)}', SMALL)]


def _long_caption(picture: Picture) -> list[Paragraph]:
    messages = [text for text in (_with_full_stop(picture.title), _alternative_text(picture)) if _long(text)]
    return [part for text in messages for part in paragraphs(text, SMALL)]


def provenance(given: Mapping[str, Any]) -> list[Any]:
    """Names and values in small monospaced text, nested ones by path."""
    return table((), [(name, value) for name, value in leaves(given)], cell=CODE)


def leaves(value: Any, path: str = "") -> list[tuple[str, str]]:
    """Nested mappings and sequences as paths with their values; the plain values of a mapping share a text.

    Examples
    --------
    >>> leaves({"images": [{"name": "a", "force_n": 1.0, "settings": {"gain": 2}}], "forces": [1.0, 2.0]})
    [('images[0]', 'name: a; force_n: 1.0'), ('images[0].settings', 'gain: 2'), ('forces', '1.0, 2.0')]
    """
    if isinstance(value, Mapping):
        reference = {name: inner for name, inner in value.items() if path and not _nested(inner)}
        below = [(f"{path}.{name}" if path else str(name), value[name]) for name in value if name not in reference]
        own = [(path, _value_text(reference))] if reference or not below else []
        return [*own, *(leaf for name, inner in below for leaf in leaves(inner, name))]
    if _listed(value) and any(_nested(inner) or _listed(inner) for inner in value):
        return [leaf for index, inner in enumerate(value) for leaf in leaves(inner, f"{path}[{index}]")]
    return [(path, _value_text(value))]


def _value_text(value: Any) -> str:
    if isinstance(value, Mapping):
        return "; ".join(f"{name}: {_value_text(inner)}" for name, inner in value.items()) or "none"
    return (", ".join(str(inner) for inner in value) or "none") if _listed(value) else str(value)


def _listed(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _nested(value: Any) -> bool:
    """Whether a value contains nested values."""
    return isinstance(value, Mapping) or (_listed(value) and any(isinstance(x, Mapping) or _listed(x) for x in value))


def _no_padding() -> list[Any]:
    """Cells without a border, and an embedded font for empty cells, whose default is not in the file."""
    return [
        ("FONTNAME", (0, 0), (-1, -1), SANS),
        *((f"{side}PADDING", (0, 0), (-1, -1), 0) for side in ("LEFT", "RIGHT", "TOP", "BOTTOM")),
    ]

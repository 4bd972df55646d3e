from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.font_manager import findfont
from matplotlib.ft2font import FT2Font
from reportlab.platypus import Paragraph

from tsis.present.pdf import BOLD, CODE, MONO, NOTE, SANS, drawable_text, in_drawn_order, markup, pieces, width

TEXTS = st.text(alphabet=st.characters(), max_size=80)  # control characters and lone surrogates too
GLYPHS = {
    SANS: FT2Font(findfont("DejaVu Sans")).get_charmap(),
    BOLD: FT2Font(findfont("DejaVu Sans:bold")).get_charmap(),
    MONO: FT2Font(findfont("DejaVu Sans Mono")).get_charmap(),
}


@given(TEXTS, st.sampled_from([SANS, BOLD, MONO]))
def test_only_what_the_font_holds_is_drawn(text: str, font: str) -> None:
    assert all(ord(letter) in GLYPHS[font] for letter in drawable_text(text, font).replace("\n", ""))


@given(TEXTS)
def test_markup_says_the_text_and_nothing_else(text: str) -> None:
    read = ElementTree.fromstring(f"<p>{markup(text)}</p>")
    assert {each.tag for each in read.iter()} <= {"p", "br"}
    assert (read.text or "") + "".join("\n" + (each.tail or "") for each in read) == drawable_text(text)


@pytest.mark.parametrize("text", ["²", "± µ – × ° …", "Łukasz Ångström", "Ωμέγα", "Жук", "m² → mm"])
def test_letters_of_laboratories_are_drawn_as_they_are(text: str) -> None:
    assert drawable_text(text) == drawable_text(text, BOLD) == drawable_text(text, MONO) == text


@pytest.mark.parametrize(
    ("text", "drawn"),
    [
        ("a\x00b", "a[U+0000]b"),
        ("\u202etxt", "[U+202E]txt"),
        ("王 7", "[U+738B] 7"),
        ("\ud83d", "[U+D83D]"),
        ("e\u0301", "é"),
        ("one\r\ntwo\tthree", "one\ntwo three"),
    ],
)
def test_what_cannot_be_drawn_is_named(text: str, drawn: str) -> None:
    assert drawable_text(text) == drawn


@given(TEXTS, st.sampled_from([NOTE, CODE]), st.floats(30, 500), st.integers(1, 40))
def test_pieces_hold_the_whole_text_and_are_as_low_as_promised(
    text: str, kind: object, within: float, lines: int
) -> None:
    drawn = drawable_text(text, kind.fontName)  # type: ignore[attr-defined]
    cut = list(pieces(drawn, kind.fontName, kind.fontSize, within=within, lines=lines))  # type: ignore[attr-defined]
    assert "".join(cut) == drawn
    for piece in cut:
        _, height = Paragraph(markup(piece), kind).wrap(within, 1e6)
        assert height <= (2 * lines + 1) * kind.leading  # type: ignore[attr-defined]


def test_pieces_are_not_needlessly_small() -> None:
    whole = " ".join(["word"] * 5000)
    cut = list(pieces(whole, SANS, 9, within=400, lines=20))
    assert all(width(one, SANS, 9) > 0.9 * 400 * 20 for one in cut[:-1])
    assert all(one != other for one, other in pairwise(cut[-2:]))


def test_what_is_read_from_the_right_is_turned() -> None:
    alef, bet, gimel, qamats = "\u05d0", "\u05d1", "\u05d2", "\u05b8"
    assert in_drawn_order("plain") == "plain"
    assert in_drawn_order(alef + bet + gimel) == gimel + bet + alef
    assert in_drawn_order(f"site {alef}{bet} {gimel}, 1 N") == f"site {gimel} {bet}{alef}, 1 N"
    assert in_drawn_order(f"{alef}(12.5){bet}") == f"{bet}(12.5){alef}"
    assert in_drawn_order(alef + qamats + bet) == bet + alef + qamats


@given(TEXTS)
def test_no_letter_is_lost_when_lines_are_turned(text: str) -> None:
    mirrored = str.maketrans(")]}>", "([{<")
    assert sorted(in_drawn_order(text).translate(mirrored)) == sorted(text.translate(mirrored))

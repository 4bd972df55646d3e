from __future__ import annotations

import io
import json
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from tests.present.pdf_readers import poppler, sheet_count, sheets

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.present.html import html_bytes
from tsis.present.page import Card, Page, Picture, Table, pixels
from tsis.present.pdf import pdf_bytes

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

HOSTILE = "<b>bold</b> & </para> ]]> \x00\x07 \u202egnp.exe &amp; <font color='red'>"
LETTERS = "² ± µ – × ° é Ω Жук Łódź"
TEXTS = st.one_of(
    st.text(alphabet=st.characters(), max_size=60),
    st.builds(str.__mul__, st.sampled_from([HOSTILE, "x", "W ", "a\n", "\u05d0", "&"]), st.integers(0, 200)),
)


def a_line(figure: Figure) -> None:
    figure.subplots().plot([0.0, 1.0], [0.0, 1.0])


def a_picture(**more: object) -> Picture:
    given: dict[str, object] = {"title": "A line", "draw": a_line, "size": (4.0, 3.0), "alt": "A line that rises"}
    return Picture(**(given | more))  # type: ignore[arg-type]


def a_page(text: str, *, pictures: tuple[Picture, ...] = ()) -> Page:
    return Page(
        title=text,
        subtitle=text,
        cards=(Card(title=text, value=text, detail=text), Card(title="a", value="b", doubtful=True)),
        notes=(text, "plain"),
        pictures=pictures,
        tables=(Table(title=text, columns=("a", text), values=((text, "b"), ("c",))),),
        refused=((text, text),),
        provenance={"key": text, "nested": [{"value": text}]},
    )


@settings(max_examples=4, suppress_health_check=[HealthCheck.too_slow])
@given(TEXTS)
def test_any_text_makes_a_file(text: str) -> None:
    content = pdf_bytes(a_page(text))
    assert content.startswith(b"%PDF-1.")
    assert content.rstrip().endswith(b"%%EOF")
    assert sheet_count(content) >= 1
    assert html_bytes(a_page(text)).endswith(b"</html>"), "the same page for a browser"


@pytest.mark.parametrize("wide", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize("size", [(30.0, 4.0), (4.0, 30.0), (40.0, 40.0)])
def test_pictures_of_any_size_fit(size: tuple[float, float], wide: bool) -> None:
    content = pdf_bytes(Page(title="t", subtitle="", pictures=(a_picture(size=size, wide=wide, alt="w " * 900),) * 3))
    assert sheet_count(content) >= 1


def test_equal_pages_give_equal_files() -> None:
    one, other = (pdf_bytes(a_page(HOSTILE, pictures=(a_picture(), a_picture(wide=True)))) for _ in range(2))
    assert one == other
    assert one != pdf_bytes(a_page(HOSTILE, pictures=(a_picture(), a_picture(title="Another", wide=True))))


def test_a_longer_table_takes_more_sheets() -> None:
    counts = [
        sheet_count(
            pdf_bytes(Page(title="t", subtitle="", tables=(Table(title="", columns=("a",), values=(("b",),) * rows),)))
        )
        for rows in (1, 40, 400)
    ]
    assert counts[0] == counts[1] == 1
    assert 400 / 80 <= counts[2] <= 400 / 30


def test_pictures_on_paper_are_opaque_and_as_large_as_asked() -> None:
    with Image.open(io.BytesIO(pixels(a_picture(), size=(2.0, 1.5), dpi=100))) as drawn:
        assert (drawn.mode, drawn.size) == ("RGB", (200, 150))
        assert np.ptp(np.asarray(drawn)) > 200


@pytest.mark.system
def test_a_reader_sees_everything(tmp_path: Path) -> None:
    page = Page(
        title="Target 7",
        subtitle=LETTERS,
        cards=(Card(title="Diameter d", value="9.8 mm", detail="90 % interval"),),
        notes=(HOSTILE,),
        pictures=(a_picture(caption="It rises"), a_picture(title="Wide", wide=True)),
        tables=(Table(title="Rows", columns=("number", "word"), values=tuple((str(i), f"w{i}") for i in range(150))),),
        refused=(("force", "needs <b>something</b>"),),
        provenance={"sha": "0123456789abcdef" * 4, "json": json.dumps({"a": list(range(400))}).replace(" ", "")},
    )
    read = sheets(pdf_bytes(page), tmp_path)
    whole = " ".join(read)
    assert len(read) > 3
    for number, sheet in enumerate(read, 1):
        assert RESEARCH_USE_ONLY in sheet
        assert sheet.endswith(f"tsis {__version__}, page {number} of {len(read)}")
    for said in (
        "Target 7",
        LETTERS,
        "9.8 mm",
        "<b>bold</b> & </para> ]]> [U+0000][U+0007] [U+202E]gnp.exe &amp; <font color='red'>",
        "A line. It rises. A line that rises.",
        "Wide. A line that rises.",
        "needs <b>something</b>",
    ):
        assert said in whole
    assert re.findall(r"\bw(\d+)\b", whole) == [str(number) for number in range(150)]
    assert sum("number word" in sheet for sheet in read) > 1, "the headings are repeated"
    close = whole.replace(" ", "")
    assert "0123456789abcdef" * 4 in close
    assert "396,397,398,399]}" in close


@pytest.mark.system
def test_names_read_from_the_right_come_out_in_their_order(tmp_path: Path) -> None:
    name = "\u05d3\u05d5\u05d3 \u05db\u05d4\u05df"
    assert name in sheets(pdf_bytes(Page(title="t", subtitle=f"subject {name}")), tmp_path)[0]


@pytest.mark.system
def test_the_file_tells_what_it_is_and_holds_its_fonts(tmp_path: Path) -> None:
    path = tmp_path / "a.pdf"
    path.write_bytes(pdf_bytes(a_page("A <page> é")))
    result = poppler("pdfinfo", path)
    assert re.search(r"^Title: +A <page> é$", result, re.MULTILINE)
    assert RESEARCH_USE_ONLY in result
    assert f"tsis {__version__}" in result
    assert "(A4)" in result
    fonts = poppler("pdffonts", path).splitlines()[2:]
    assert len(fonts) >= 3
    assert all(re.search(r"DejaVuSans\S* +TrueType +\S+ +yes yes yes", font) for font in fonts)
    outline = poppler("pdftohtml", "-xml", "-i", "-stdout", path)
    assert ">Provenance</item>" in outline, "bookmarks"

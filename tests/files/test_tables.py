"""Tables of any program: one table in every dialect gives the same numbers; what has two meanings is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import FileInputError
from tsis.files.tables import parse_csv_rows, parse_heading, table_bytes

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

NEEDED = ("force_n", "radius_mm")
FORCES = {"N": 1.0, "mN": 1e3, "kN": 1e-3, "µN": 1e6, "cN": 100.0, "g": 1e3 / 9.80665, "kgf": 1 / 9.80665}
LENGTHS = {"mm": 1.0, "m": 1e-3, "µm": 1e3, "cm": 0.1, "in": 1 / 25.4}
HEADINGS = ("{} ({})", "{} [{}]", "{} / {}", "{}_{}", "{}/{}", "{} in {}", "{} {}", "{}, {}", "{} (z), {}", "{} ({}.)")


def numbers(content: bytes, needed: Sequence[str] = NEEDED, optional: Sequence[str] = ()) -> list[tuple[Any, ...]]:
    rows = parse_csv_rows(content, "'a.csv'", needed, optional, ignore_others=True)
    return [tuple(row.number(name) for name in (*needed, *optional)) for row in rows]


@given(
    rows=st.lists(st.tuples(st.floats(0.011, 90.0), st.floats(0.011, 90.0)), min_size=1, max_size=6),
    force=st.sampled_from(sorted(FORCES)),
    length=st.sampled_from(sorted(LENGTHS)),
    heading=st.sampled_from(HEADINGS),
    capital=st.booleans(),
    delimiter=st.sampled_from([",", ";", "\t", "|"]),
    comma=st.booleans(),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252"]),
    line_end=st.sampled_from(["\n", "\r\n"]),
    index=st.sampled_from([None, "", "Nr.", "index", "#"]),
    swapped=st.booleans(),
    preamble=st.sampled_from(["", "Test of 3 May\nOperator: none\n\n"]),
)
def test_every_dialect_gives_the_same_numbers(
    rows: list[tuple[float, float]],
    force: str,
    length: str,
    heading: str,
    capital: bool,
    delimiter: str,
    comma: bool,
    encoding: str,
    line_end: str,
    index: str | None,
    swapped: bool,
    preamble: str,
) -> None:
    columns = [(heading.format("force", force), FORCES[force]), (heading.format("radius", length), LENGTHS[length])]
    order = [1, 0] if swapped else [0, 1]
    quote = '"{}"' if comma and delimiter == "," else "{}"
    names = [name if delimiter not in name else f'"{name}"' for name, _ in columns]
    lines = [[names[place] for place in order]]
    if capital:
        lines[0] = [name.replace("force", "Force").replace("radius", "Radius") for name in lines[0]]
    for row in rows:
        cells = [f"{row[place] * columns[place][1]:.6e}" for place in order]
        lines.append([quote.format(cell.replace(".", ",") if comma else cell) for cell in cells])
    if index is not None:
        lines = [[index if at == 0 else str(at), *line] for at, line in enumerate(lines)]
    text = preamble + "".join(delimiter.join(line) + "\n" for line in lines)

    read = numbers(text.replace("\n", line_end).encode(encoding))

    assert len(read) == len(rows)
    for found, row in zip(read, rows, strict=True):
        assert found == pytest.approx(row, rel=2e-6)


def test_a_row_of_units_below_the_headings_gives_the_units() -> None:
    assert numbers(b"time;force;radius\ns;mN;mm\n0,5;250;1,5\n1;500;2\n") == [(0.25, 1.5), (0.5, 2.0)]


@pytest.mark.parametrize(
    "table",
    [
        "<INFO>\nTime:\t12:00\n<DATA>\nTime, s\tPosition (z), mm\tFz, gf\n0.1\t1.5\t50\n<END DATA>\n<DIVIDER>\n",
        "Reading,Load [cN],Travel [mm],Time [sec.]\n1,49.03325,1.5,0.1\n",
        "Prüfzeit;Standardweg;Standardkraft\ns;mm;N\n0,1;1,5;0,4903325\n",
        "Force (g),Distance (mm),Time (sec)\n50,1.5,0.1\n",
        '"Results"\n,"Load (N)"\n"1","0.9"\n\n"Time","Extension","Load"\n"(s)","(mm)","(N)"\n"0.1","1.5","0.4903325"\n',
        "z_um,F_mN,t_ms\n1500,490.3325,100\n",
        "Zeit [ms]\tWeg [mm]\tLast [g]\n100\t1,5\t50,0\n",
    ],
)
def test_exports_of_testing_machines_give_force_travel_and_time(table: str) -> None:
    assert numbers(table.encode(), ("force_n", "displacement_mm", "time_s")) == [pytest.approx((0.4903325, 1.5, 0.1))]


def test_white_space_separates_columns() -> None:
    assert numbers(b"force_n   radius_mm\n 0.5    1.5\n 1.0\t2.0\n") == [(0.5, 1.5), (1.0, 2.0)]


def test_marks_of_thousands_are_read_where_a_decimal_mark_follows() -> None:
    assert numbers(b"force_mN;radius_mm\n1.234,5;2\n250;1,5\n") == [(pytest.approx(1.2345), 2.0), (0.25, 1.5)]


def test_a_percentage_is_a_fraction() -> None:
    assert numbers(b"depth_mm,scale sd / %\n1,5\n", ("depth_mm",), ("scale_sd",)) == [(1.0, pytest.approx(0.05))]


def test_the_deviation_of_a_quantity_has_its_unit() -> None:
    table = b"Force (mN);Std force (mN);Radius sd (\xb5m)\n100;5;20\n"
    assert numbers(table, ("force_n", "force_sd_n", "radius_sd_mm")) == [(0.1, 0.005, pytest.approx(0.02))]


def test_its_own_name_comes_before_another_spelling_and_values_stay_exact() -> None:
    rows: list[list[Any]] = [["force_n", "radius_mm"], [0.1, 1 / 3]]
    assert numbers(table_bytes(rows)) == [(0.1, 1 / 3)]


def test_cells_behind_the_last_heading_may_be_empty() -> None:
    assert numbers(b"force_n,radius_mm,,\n1,2,,\n") == [(1.0, 2.0)]


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        (b"force,radius_mm\n1,2\n", "must name its unit"),
        (b"force_px,radius_mm\n1,2\n", "missing: force_n"),
        (b"0.5,1.5\n0.6,1.6\n", "write the headings in a line above"),
        (b"force (px),radius_mm\n1,2\n", "the unit 'px'"),
        (b"force (MN),radius_mm\n1,2\n", "the unit 'MN'"),
        (b"force_MN,radius_mm\n1,2\n", "the unit 'MN'"),
        (b"force (mm),radius_mm\n1,2\n", "the unit 'mm'"),
        (b"force_N,force_mN,radius_mm\n1,1000,2\n", "one of them twice"),
        (b"force_N\tradius_mm\n1,234\t2\n", "one decimal mark"),
        (b"force_N;radius_mm\n1,5;2.5\n", "one decimal mark"),
        (b"force_N;radius_mm\n1,5\n", "a row must have 2 cells"),
        (b"force_N;radius_mm\nnan;2\n", "a finite number"),
        (b"force_N;radius_mm\n1_0;2\n", "a finite number"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "a table"),
        (b"\n\n", "it is empty"),
    ],
)
def test_what_has_no_meaning_or_two_is_refused_in_a_sentence(table: bytes, sentence: str) -> None:
    with pytest.raises(FileInputError, match=sentence) as caught:
        numbers(table)
    assert "\n" not in str(caught.value)
    assert "a.csv" in str(caught.value)


def test_an_index_of_pandas_is_allowed_where_other_columns_are_not() -> None:
    rows = list(parse_csv_rows(b",force_n,radius_mm\n0,1,2\n", "a", NEEDED))
    assert rows[0].number("force_n") == 1.0
    with pytest.raises(FileInputError, match="got 'colour'"):
        list(parse_csv_rows(b"colour,force_n,radius_mm\nred,1,2\n", "a", NEEDED))


@pytest.mark.parametrize("name", ["force_n", "depth_mm_sd", "force (N)", "pixel size x (mm)", "area_sd_mm2", "code"])
def test_a_heading_and_its_words_with_its_unit_are_the_same(name: str) -> None:
    heading = parse_heading(name)
    again = f"{heading.words} ({heading.unit})" if heading.unit else heading.words
    assert parse_heading(again) == heading

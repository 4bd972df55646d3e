from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reportlab.platypus import LongTable

from tsis.present.pdf import MOST_COLUMNS, WIDTH, column_widths, leaves, table

COLUMNS = st.lists(st.tuples(st.floats(0, 600), st.floats(0, 600)), min_size=1, max_size=12)


@given(COLUMNS, st.floats(100, 600))
def test_columns_fill_the_width_and_words_fit_if_they_can(pairs: list[tuple[float, float]], available: float) -> None:
    least, expected = [low for low, _ in pairs], [low + more for low, more in pairs]
    widths = column_widths(least, expected, available)
    assert sum(widths) == pytest.approx(available)
    assert all(each >= 0 for each in widths)
    if sum(least) <= available:
        assert all(each >= low - 1e-6 for each, low in zip(widths, least, strict=True))
    if sum(expected) <= available:
        assert all(each >= high - 1e-6 for each, high in zip(widths, expected, strict=True))


def test_one_endless_word_does_not_squeeze_short_ones() -> None:
    widths = column_widths([20, 30, 5000], [40, 60, 5000], 500)
    assert widths[:2] == [20, 30]


def test_many_columns_are_cut_and_each_part_begins_with_the_first() -> None:
    parts = table([f"h{place}" for place in range(25)], [[f"c{place}" for place in range(25)]])
    assert all(isinstance(part, LongTable) for part in parts)
    heads = [[cell.getPlainText() for cell in part._cellvalues[0]] for part in parts]
    assert all(head[0] == "h0" and len(head) <= MOST_COLUMNS for head in heads)
    assert [name for head in heads for name in head[1:]] == [f"h{place}" for place in range(1, 25)]
    for part in parts:
        assert part.wrap(WIDTH, 1e6)[0] == pytest.approx(WIDTH)


def test_short_rows_are_filled_and_long_cells_go_on_in_rows_of_their_own() -> None:
    (part,) = table(("a", "b"), [("only",), ("x", "y " * 3000)])
    rows = [[getattr(cell, "getPlainText", str)() for cell in row] for row in part._cellvalues]
    assert rows[1] == ["only", ""]
    assert len(rows) > 5
    assert [row[0] for row in rows[3:]] == [""] * len(rows[3:])
    assert " ".join(row[1] for row in rows[2:]).split() == ["y"] * 3000
    assert part.repeatRows == 1


def test_nested_values_are_told_by_their_paths() -> None:
    result = leaves(
        {"a": {"b": [{"c": 1, "d": None}, {"c": "x", "h": [1, 2]}], "e": []}, "f": (1.5, 2), "g": {}, 3: [[1, 2], [3]]}
    )
    assert result == [
        ("a", "e: none"),
        ("a.b[0]", "c: 1; d: None"),
        ("a.b[1]", "c: x; h: 1, 2"),
        ("f", "1.5, 2"),
        ("g", "none"),
        ("3[0]", "1, 2"),
        ("3[1]", "3"),
    ]

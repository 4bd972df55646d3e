"""Which targets a list shows: all of them on its sheets together, each once, in the order that was asked for."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.console.pages.records import ESTIMATED, KINDS, NOT_ESTIMATED, SHEETS, Order, sheet_of
from tsis.records.reader import TargetState, TargetSummary
from tsis.records.values import Target

BEGUN = datetime(2026, 1, 1, tzinfo=UTC)
COLUMNS = ("number", "name", "presses", "estimates", "last")


def summary(
    number: int, *, name: str = "", presses: int = 0, estimates: int = 0, day: int | None = None, state: str = ""
) -> TargetSummary:
    return TargetSummary(
        target=Target(number=number, kind="phantom", name=name, made=BEGUN, id=f"{number}"),
        presses=presses,
        estimates=estimates,
        last=None if day is None else BEGUN + timedelta(days=day),
        state=TargetState(name=state, since=BEGUN) if state else None,
    )


summaries = st.lists(
    st.builds(
        summary,
        st.integers(1, 99_999),
        name=st.sampled_from(["", "size-10", "Size-2", "ß", "hard 5"]),
        presses=st.integers(0, 4),
        estimates=st.integers(0, 2),
        day=st.none() | st.integers(0, 3),
        state=st.sampled_from(["", "", "archived", "deleted"]),
    ),
    max_size=120,
    unique_by=lambda item: item.target.number,
)


def value(item: TargetSummary, column: str) -> Any:
    return {
        "number": item.target.number,
        "name": item.target.name.casefold(),
        "presses": item.presses,
        "estimates": item.estimates,
        "last": (item.last is not None, item.last or BEGUN),
    }[column]


@given(result=summaries, column=st.sampled_from(COLUMNS), descending=st.booleans(), kind=st.sampled_from(KINDS))
def test_all_sheets_together_are_the_sorted_list(
    result: list[TargetSummary], column: str, descending: bool, kind: str
) -> None:
    order = Order(column=column, descending=descending, kind=kind, rows=SHEETS[0])
    first = sheet_of(result, order)
    sheets = -(-first.total // SHEETS[0])
    shown = [
        item
        for number in range(1, sheets + 1)
        for item in sheet_of(
            result, Order(column=column, descending=descending, kind=kind, rows=SHEETS[0], sheet=number)
        ).targets
    ]
    present = [item for item in result if item.state is None]
    expected = {
        "all": present,
        "estimated": [item for item in present if item.estimates > 0],
        "not estimated": [item for item in present if item.estimates == 0],
        "archived": [item for item in result if item.state is not None and item.state.name == "archived"],
        "deleted": [item for item in result if item.state is not None and item.state.name == "deleted"],
    }[kind]
    assert len(shown) == len(expected)
    assert {item.target.number for item in shown} == {item.target.number for item in expected}
    pairs = list(pairwise(shown))
    assert all(
        (value(b, column) <= value(a, column)) if descending else (value(a, column) <= value(b, column))
        for a, b in pairs
    )
    assert all(a.target.number < b.target.number for a, b in pairs if value(a, column) == value(b, column))


@pytest.mark.parametrize(
    ("search", "numbers"),
    [("", [1, 2, 12]), ("1", [1, 12]), ("SIZE", [2]), (" size ", [2]), ("ss", [12]), ("3", []), ("2", [2])],
)
def test_a_search_finds_parts_of_names_and_beginnings_of_numbers(search: str, numbers: list[int]) -> None:
    result = [summary(12, name="straße"), summary(2, name="Size"), summary(1)]
    assert [item.target.number for item in sheet_of(result, Order(search=search)).targets] == numbers


def test_a_sheet_behind_the_last_is_the_last() -> None:
    result = [summary(number, estimates=number % 2) for number in range(1, 61)]
    last = sheet_of(result, Order(sheet=9, rows=25))
    assert ([item.target.number for item in last.targets], last.sheet, last.total) == (list(range(51, 61)), 3, 60)
    assert sheet_of([], Order(sheet=5)).sheet == 1
    assert sheet_of(result, Order(kind=NOT_ESTIMATED)).total == 30


@given(
    st.dictionaries(
        st.sampled_from(["sortBy", "descending", "page", "rowsPerPage", "other"]),
        st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.lists(st.integers()),
    ),
    st.text(),
)
def test_whatever_a_browser_sends_is_an_order(pagination: dict[str, Any], kind: str) -> None:
    order = Order.requested(pagination, search="", kind=kind)
    assert order.column in COLUMNS
    assert order.rows in SHEETS
    assert order.kind in KINDS
    assert len(sheet_of([summary(1)], order).targets) == (0 if order.kind == ESTIMATED else 1)

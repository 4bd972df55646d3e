"""The estimate in force supersedes what it was made from, whatever the clock said."""

from __future__ import annotations

import itertools
from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING

import pytest
from tests.records.sample import WHEN, sample_record

from tsis.records.reader import in_lineage

if TYPE_CHECKING:
    from tsis.records.values import StoredEstimate


def made(name: str, minutes: int, supersedes: str | None = None) -> StoredEstimate:
    (stored,) = sample_record().estimates
    return replace(stored, id=name, made=WHEN + timedelta(minutes=minutes), supersedes=supersedes)


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ([made("a", 3), made("b", 1), made("c", 2)], "bca"),
        ([made("a", 0), made("b", -60, "a")], "ab"),
        ([made("a", 0), made("b", -60, "a"), made("c", -120, "b"), made("d", 1)], "abcd"),
        ([made("b", 0, "of another store"), made("a", 0)], "ab"),
        ([made("a", 0, "b"), made("b", 1, "a")], "ab"),  # nobody but a forger makes it so
    ],
)
def test_each_comes_after_what_it_supersedes(given: list[StoredEstimate], wanted: str) -> None:
    for some in itertools.permutations(given):
        assert "".join(stored.id for stored in in_lineage(some)) == wanted

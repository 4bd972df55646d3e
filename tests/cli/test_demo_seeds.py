"""``tsis demo --seeds``: the counts as a table and as JSON, and the stored run that the plain demo cites."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

import tsis
from tsis.cli.demo import stored_note
from tsis.virtual.examinations import coverage_counts

if TYPE_CHECKING:
    from tests.cli.conftest import RunTsis

SMALL = ("demo", "--seeds", "1", "--seed", "5", "--strain", "small")


def test_the_counts_are_those_of_the_cases(run_tsis: RunTsis) -> None:
    finished = run_tsis(*SMALL, "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert document["counts"] == coverage_counts(document["examinations"])
    assert [case["seed"] for case in document["examinations"]] == [5]
    assert document["protocol"]["prior"] == "phantom-2011"
    people = run_tsis(*SMALL)
    assert "90 %, all 1" in " ".join(people.out.split()).replace("90%", "90 %")
    assert "Research use only" in people.out + people.err


@pytest.mark.parametrize(
    "typed",
    [["--diameter-mm", "9"], ["--phantom", "size-8"], ["--out", "folder"], ["--save"], ["--target", "3"]],
    ids=" ".join,
)
def test_options_of_one_examination_are_refused(run_tsis: RunTsis, typed: list[str]) -> None:
    finished = run_tsis(*SMALL, *typed)
    assert finished.code == 2
    assert f"leave out {typed[0]}" in " ".join(finished.err.split())


def test_the_note_names_the_stored_counts_and_their_command() -> None:
    stored = tsis.virtual.examinations.stored_coverage()
    held = stored["counts"]["held"]["0.9"]
    note = stored_note()
    assert f"diameter_mm {held['diameter_mm']}, depth_mm {held['depth_mm']}, young_kpa {held['young_kpa']}" in note
    assert stored["protocol"]["command"] in note

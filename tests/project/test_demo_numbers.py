"""The documents print the demo's stored counts."""

from __future__ import annotations

from pathlib import Path

import pytest

from tsis.virtual.examinations import stored_coverage

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("page", ["README.md", "docs/explanation/what-a-press-can-tell.md"])
def test_the_counts_of_a_page_are_the_stored_ones(page: str) -> None:
    counts = stored_coverage()["counts"]
    diameter, depth, young = counts["held"]["0.9"].values()
    text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
    answers = f"{diameter}, the depth in {depth} and the modulus in {young} of {counts['answered']} answers"
    assert f"held the diameter in {answers}" in text

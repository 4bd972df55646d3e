"""Each requirement has tests that exist, and each known limit belongs to a requirement."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import pytest
from release.traceability import faults, limits, limits_of, page, read

ROOT = Path(__file__).parents[2]
HERE = "tests/project/test_requirements.py"
GOOD: dict[str, Any] = {
    "id": "R-001",
    "requirement": "It holds.",
    "hazard": "Something is lost.",
    "tests": [f"{HERE}::test_the_list_is_sound", f"{HERE}::test_a_list_that_is_wrong_is_told"],
    "limits": ["files"],
}


def test_the_list_is_sound() -> None:
    assert faults(read(ROOT), ROOT) == []


def test_every_known_limit_belongs_to_a_requirement() -> None:
    named = {name for entry in read(ROOT) for name in limits_of(entry)}
    free = sorted(set(limits(ROOT)) - named)
    assert not free, f"docs/requirements.yaml must name the known limits {free} where they belong"


def test_a_good_entry_has_no_fault() -> None:
    assert faults([GOOD], ROOT) == []
    assert faults([GOOD | {"limits": "finite-strain"}, GOOD | {"id": "R-002"}], ROOT) == []


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"id": "R-1"}, "three digits"),
        ({"id": "r-001"}, "three digits"),
        ({"requirement": ""}, "requirement must be a sentence"),
        ({"hazard": " "}, "hazard must be a sentence"),
        ({"hazard": None}, "hazard must be a sentence"),
        ({"tests": []}, "at least one test"),
        ({"tests": f"{HERE}::test_the_list_is_sound"}, "at least one test"),
        ({"tests": [f"{HERE}::test_nobody_wrote"]}, "test_nobody_wrote"),
        ({"tests": ["tests/project/test_of_nothing.py::test_the_list_is_sound"]}, "test_of_nothing"),
        ({"tests": [HERE]}, HERE),
        ({"tests": ["release/traceability.py::read"]}, "traceability"),
        ({"tests": [f"{HERE}::test_the_list_is_sound"] * 2}, "named 2 times"),
        ({"limits": ["nowhere"]}, "nowhere"),
        ({"severity": "high"}, "['severity'] are unknown"),
    ],
)
def test_a_list_that_is_wrong_is_told(changed: dict[str, Any], said: str) -> None:
    (fault,) = faults([copy.deepcopy(GOOD) | changed], ROOT)
    assert said in fault


def test_what_is_absent_twice_or_no_list_is_told() -> None:
    bare = {name: value for name, value in GOOD.items() if name != "hazard"}
    assert "['hazard'] are absent" in faults([bare], ROOT)[0]
    assert "it is that of 2" in faults([GOOD, GOOD], ROOT)[0]
    assert faults({"R-001": GOOD}, ROOT) == ["docs/requirements.yaml must be a list of mappings"]


def test_the_page_shows_everything_and_links_the_limits() -> None:
    shown = page([GOOD], ROOT)
    for part in ("**R-001** It holds.", "Something is lost.", *GOOD["tests"]):
        assert part in shown
    assert "[Files](../explanation/known-limits.md#files)" in shown

"""Domed contact at small strain against another code; how the values were made is in benchmarks/domed_second_code.py.

That code's own two meshes differ by 0.15 % of the largest value in the plain displacement (at the rim), 0.02 % in what
inclusions change about it, 0.02 % in pressures, and by 0.3 and 0.9 % in pressures where the contact ends on the face.
"""

from __future__ import annotations

import json
from typing import Any

import pytest
from benchmarks.domed_second_code import FORCES_N, SPHERES, STORED, deviations, kernel

STORED_CASES: list[dict[str, Any]] = json.loads(STORED.read_text(encoding="utf-8"))["small_strain"]["cases"]


def test_every_case_is_stored() -> None:
    found = [(case["diameter_mm"], case["depth_mm"], case["young_kpa"], case["force_n"]) for case in STORED_CASES]
    assert found == [(*sphere, force) for sphere in SPHERES for force in FORCES_N]


@pytest.mark.parametrize("case", STORED_CASES)
def test_another_code_finds_the_same(case: dict[str, Any]) -> None:
    apart = deviations(kernel(case), case)
    assert max(apart["plain_approach_mm"], apart["approach_mm"]) < 5e-4
    assert max(apart["plain_w_mm"], apart["plain_p_kpa"], apart["dw_mm"]) < 5e-3
    assert apart["dp_kpa"] < (0.01 if case["force_n"] < 0.5 else 5e-3)

"""Scan plans beside brute force: every place of the area, every number of strips, every size."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial import cKDTree

from tsis.errors import FileInputError, InputError
from tsis.study.search import (
    DetectionRangeTable,
    ScanPlan,
    detection_range_of_trials,
    read_detection_range,
    scan_plan,
    smallest_found_mm,
    widest_plan,
)

if TYPE_CHECKING:
    from pathlib import Path


LENGTHS = st.floats(5.0, 150.0)
TABLE = DetectionRangeTable(
    diameter_mm=np.array([2.0, 5.0, 10.0, 15.0]),
    depth_mm=np.array([4.0, 8.0, 12.0]),
    reach_mm=np.array([[1.0, 0.0, 0.0], [4.0, 2.0, 0.0], [6.0, 5.0, 2.0], [8.0, 7.0, 5.0]]),
    probability=0.9,
)


@given(LENGTHS, LENGTHS, st.integers(1, 12), st.integers(1, 12))
def test_no_place_is_farther_from_a_press_than_the_worst_distance(
    width: float, height: float, strips: int, along: int
) -> None:
    plan = ScanPlan(width_mm=width, height_mm=height, strips=strips, presses_a_strip=along, radius_mm=12.0)
    places = np.stack(np.meshgrid(np.linspace(0, width, 24 * strips + 1), np.linspace(0, height, 24 * along + 1)), -1)
    nearest, _ = cKDTree(plan.positions_mm).query(places.reshape(-1, 2))
    assert np.max(nearest) == pytest.approx(plan.worst_distance_mm)  # cells' corners are among the places


@given(LENGTHS, LENGTHS, st.integers(1, 9), st.integers(1, 9))
def test_strips_are_walked_up_and_down_by_the_shortest_steps(
    width: float, height: float, strips: int, along: int
) -> None:
    plan = ScanPlan(width_mm=width, height_mm=height, strips=strips, presses_a_strip=along, radius_mm=12.0)
    places = plan.positions_mm
    assert len(places) == plan.presses == len(np.unique(places.round(9), axis=0))
    steps = np.diff(places, axis=0)
    assert (np.count_nonzero(np.abs(steps) > 1e-9, axis=1) == 1).all()  # never aslant
    assert np.hypot(*steps.T).sum() == pytest.approx(plan.travel_mm)
    assert plan.duration_s(press_s=3.0, speed_mm_s=10.0) == pytest.approx(3 * plan.presses + plan.travel_mm / 10)
    low, high = places.min(axis=0), places.max(axis=0)
    assert (low[0] - plan.radius_mm, high[1] + plan.radius_mm - height) == pytest.approx(
        (-plan.overhang_mm[0], plan.overhang_mm[1])
    )


@given(LENGTHS, LENGTHS, st.floats(2.0, 40.0))
def test_the_widest_plan_has_the_fewest_presses_of_all(width: float, height: float, reach: float) -> None:
    plan = widest_plan(width, height, radius_mm=12.0, extent_mm=reach)
    assert plan.worst_distance_mm <= reach * (1 + 1e-9)
    enough = (
        strips * along
        for strips, along in itertools.product(range(1, 90), repeat=2)
        if math.hypot(width / strips, height / along) <= 2 * reach * (1 - 1e-9)
    )
    assert plan.presses <= min(enough)


def test_a_square_grid_of_the_widest_spacing_just_reaches() -> None:
    spacing = math.sqrt(2) * 6.0
    plan = scan_plan(10 * spacing, 10 * spacing, radius_mm=12.0, spacing_mm=spacing * (1 + 1e-12))
    assert plan.presses == 100
    assert plan.worst_distance_mm == pytest.approx(6.0)
    rounded = widest_plan(10 * spacing, 10 * spacing, radius_mm=12.0, extent_mm=6.0)
    assert rounded.presses <= 100


@given(LENGTHS, LENGTHS, st.floats(0.0, 0.9))
def test_a_plan_overlaps_at_least_as_wanted_and_with_one_strip_less_it_would_not(
    width: float, height: float, overlap: float
) -> None:
    plan = scan_plan(width, height, radius_mm=12.0, overlap=overlap)
    assert min(plan.overlap) >= overlap - 1e-9
    assert plan.strips == 1 or 1 - width / (plan.strips - 1) / 24 < overlap
    assert plan.presses_a_strip == 1 or 1 - height / (plan.presses_a_strip - 1) / 24 < overlap


@settings(max_examples=25)
@given(st.floats(4.0, 12.0), st.integers(1, 12))
def test_the_smallest_that_cannot_be_missed_by_trying_every_size(depth: float, strips: int) -> None:
    plan = ScanPlan(width_mm=60.0, height_mm=50.0, strips=strips, presses_a_strip=strips, radius_mm=12.0)
    found = smallest_found_mm(plan, TABLE, depth)
    sizes = np.linspace(0.5, 15.0, 3001)
    enough = np.array([TABLE(size, depth) >= plan.worst_distance_mm - 1e-9 for size in sizes.tolist()])
    if not enough[-1]:
        assert found is None
    else:
        assert found == pytest.approx(sizes[enough][0], abs=0.006)


def test_a_size_that_is_missed_between_others_is_not_hidden() -> None:
    plan = ScanPlan(width_mm=10.0, height_mm=10.0, strips=2, presses_a_strip=2, radius_mm=12.0)

    def reach(diameter_mm: float, _: float) -> float:
        return 0.0 if 7.0 < diameter_mm < 8.0 else 9.0

    assert smallest_found_mm(plan, reach, 5.0) == pytest.approx(8.0)
    assert smallest_found_mm(plan, lambda *_: 9.0, 5.0) == 0.5
    with pytest.raises(InputError, match="the detection range must"):
        smallest_found_mm(plan, lambda *_: float("nan"), 5.0)


def test_plan_and_limit_are_each_others_converse() -> None:
    for depth, size in itertools.product((4.0, 6.0, 10.0), (6.0, 9.0, 14.0)):
        reach = TABLE(size, depth)
        if reach > 0:
            plan = widest_plan(90.0, 70.0, radius_mm=12.0, extent_mm=reach)
            smallest = smallest_found_mm(plan, TABLE, depth)
            assert smallest is not None
            assert smallest <= size + 1e-9


@given(st.floats(2.0, 15.0), st.floats(4.0, 12.0))
def test_reaches_between_are_scipys(size: float, depth: float) -> None:
    other = RegularGridInterpolator((TABLE.diameter_mm, TABLE.depth_mm), TABLE.reach_mm)
    assert TABLE(size, depth) == pytest.approx(float(other((size, depth))), abs=1e-12)


def test_outside_its_table_a_reach_is_never_too_long() -> None:
    assert TABLE(1.9, 4.0) == 0.0
    assert TABLE(15.0, 12.1) == 0.0
    assert TABLE(40.0, 8.0) == 7.0
    assert TABLE(5.0, 1.0) == 4.0


def test_a_reach_by_trials_is_where_the_share_falls() -> None:
    rng = np.random.default_rng(1)
    away = rng.uniform(0, 6, 20000)
    found = rng.random(20000) < 1 / (1 + np.exp((away - 4.0) / 0.5))
    for expected in (0.5, 0.9):
        true = 4.0 - 0.5 * math.log(expected / (1 - expected))
        assert detection_range_of_trials(away, found, probability=expected) == pytest.approx(true, abs=0.15)
    assert detection_range_of_trials(away, np.zeros(20000, dtype=bool)) == 0.0
    assert detection_range_of_trials(away, np.ones(20000, dtype=bool)) == away.max()


def test_a_table_is_read_from_text_and_bad_ones_are_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "reach.csv"
    head = "diameter_mm,depth_mm,reach_mm\n"
    path.write_text("\ufeff" + head + "8,12,2\n4,4,2\n8,4,6\n4,12,0\n")
    table = read_detection_range(path, probability=0.8)
    assert (table(6.0, 8.0), table.probability) == (2.5, 0.8)
    for content, said in (
        ("", "must hold data"),
        ("a,b,c\n1,2,3\n", "headings must hold diameter_mm, depth_mm, reach_mm"),
        (head, "at least one row"),
        (head + "4,4,2\n4,4,3\n", "once"),
        (head + "4,4,2\n8,4,6\n4,12,0\n", "once; got 3 rows"),
        (head + "4,4,2\n8,4,6\n", "two ascending"),
        (head + "4,4,nan\n", "line 2"),
        (head + "4,4\n", "line 2"),
        (head + "4,,4\n", "an empty cell .*line 2"),
        (head + "=cmd|' /C calc'!A0,4,2\n", "line 2"),
        (head + '"4', "comma-separated values; line 2"),
        (head + "4,4,-1\n8,4,1\n4,12,0\n8,12,0\n", "lie in"),
    ):
        path.write_text(content)
        with pytest.raises(FileInputError, match=said) as raised:
            read_detection_range(path)
        assert "\n" not in str(raised.value)
    for bare, said in ((b"\xff\xfe\x00", "table in UTF-8"), (b"\xef\xbb\xbf", "must begin with the headings")):
        path.write_bytes(bare)
        with pytest.raises(FileInputError, match=said):
            read_detection_range(path)


PLAN: dict[str, Any] = {"width_mm": 80.0, "height_mm": 60.0, "strips": 4, "presses_a_strip": 4, "radius_mm": 12.0}


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: ScanPlan(**PLAN | {"width_mm": 0}), "width_mm must lie"),
        (lambda: ScanPlan(**PLAN | {"strips": 0}), "strips must lie"),
        (lambda: ScanPlan(**PLAN | {"strips": 2.5}), "strips must be a whole"),
        (lambda: ScanPlan(**PLAN | {"strips": 400, "presses_a_strip": 400}), "at most 100000 presses"),
        (lambda: ScanPlan(**PLAN).duration_s(press_s=-1, speed_mm_s=5), "press_s must lie"),
        (lambda: ScanPlan(**PLAN).duration_s(press_s=1, speed_mm_s=0), "speed_mm_s must lie"),
        (lambda: scan_plan(80, 60, radius_mm=12), "either spacing_mm or overlap"),
        (lambda: scan_plan(80, 60, radius_mm=12, spacing_mm=5, overlap=0.5), "either spacing_mm or overlap"),
        (lambda: scan_plan(80, 60, radius_mm=12, overlap=1.0), "overlap must lie"),
        (lambda: widest_plan(80, 60, radius_mm=12, extent_mm=0), "extent_mm must lie"),
        (lambda: widest_plan(5000, 5000, radius_mm=12, extent_mm=0.05), "extent_mm must be larger"),
        (lambda: smallest_found_mm("plan", TABLE, 5.0), "plan must be a ScanPlan"),  # type: ignore[arg-type]
        (lambda: detection_range_of_trials([1.0, -1.0], [True, True]), "must not be negative"),
        (lambda: detection_range_of_trials([1.0], [True, False]), "equally long"),
        (lambda: TABLE(float("nan"), 5.0), "diameter_mm must"),
    ],
)
def test_bad_input_is_one_sentence(call: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        call()

"""The large virtual study: how targets are drawn and pressed, and how its lines are judged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from benchmarks.detection_study import DEPTHS_MM, DIAMETERS_MM, Searched, detection_limit, figure_of, reaches, report
from benchmarks.searched_presses import MovingProbe, draw
from benchmarks.uneven_tissue import FaceGrid, Site, uneven

import tsis
from tsis.imaging.sensor import Sensor
from tsis.inclusion.posterior.rings import off_axis_profile
from tsis.model.phantom import Inclusion, Phantom
from tsis.virtual.probe import VirtualProbe

FLAT = tsis.load_probe("tsis-2011")
TISSUE = Phantom(young_kpa=5.0, thickness_mm=30.0)


def test_blanks_are_drawn_as_the_others_are() -> None:
    targets = [draw(1, index, site_sd=0.03) for index in range(400)]
    assert [one.inclusion is not None for one in targets] == [True, False] * 200
    for name in ("young_kpa", "thickness_mm", "poisson"):
        values = np.array([getattr(one.site.phantom, name) for one in targets])
        inside, outside = values[::2], values[1::2]
        error = np.hypot(inside.std(), outside.std()) / np.sqrt(200)
        assert inside.mean() == pytest.approx(outside.mean(), abs=4 * error)
    sizes = np.array([one.drawn.diameter_mm for one in targets])
    assert (sizes.min(), sizes.max()) == (pytest.approx(2, abs=0.2), pytest.approx(15, abs=0.2))
    assert max(np.hypot(*one.drawn.offset_mm) for one in targets) <= 5.0
    assert draw(1, 7, site_sd=0.03) == targets[7]
    assert draw(2, 7, site_sd=0.03) != targets[7]


def test_lumps_keep_apart_and_differ_as_much_as_is_said() -> None:
    rng = np.random.default_rng(1)
    lump = Inclusion(diameter_mm=8.0, depth_mm=5.0, young_kpa=100.0)
    sites = [uneven(replace(TISSUE, inclusion=lump), 0.2, rng) for _ in range(150)]
    for site in sites:
        assert site.whole.inclusions == (lump, *site.lumps)  # a phantom refuses inclusions that meet
    logs = np.log([one.young_kpa / 5.0 for site in sites for one in site.lumps])
    assert logs.std() == pytest.approx(0.2, rel=0.1)
    assert logs.mean() == pytest.approx(0.0, abs=0.03)
    assert max(np.hypot(*one.offset_mm) for site in sites for one in site.lumps) <= 6.0


def test_around_the_axis_a_moved_change_is_what_the_estimate_takes_it_for() -> None:
    grid, radius = FaceGrid(FLAT), np.linspace(0.0, 12.0, 241)
    change = np.array([np.exp(-((radius / 4) ** 2)), 0.02 * np.exp(-((radius / 6) ** 2))])
    for offset in (0.0, 3.0, 5.0):
        over = grid.moved(radius, change, (offset * 0.6, -offset * 0.8))
        rings = off_axis_profile(radius, offset) @ change.T
        away = np.hypot(grid.x, grid.y)
        for low in (0.0, 2.0, 5.0, 8.0):
            ring = (away >= low) & (away < low + 1.0)
            expected = np.array([np.interp(away[ring], radius, one).mean() for one in rings.T])
            assert over[:, ring].mean(axis=1) == pytest.approx(expected, rel=0.02, abs=2e-4)


def test_without_lumps_on_the_axis_a_press_is_that_of_the_virtual_probe() -> None:
    lump = Inclusion(diameter_mm=9.0, depth_mm=5.0, young_kpa=100.0)
    phantom = replace(TISSUE, inclusion=lump)
    ours = MovingProbe(FLAT, rng=np.random.default_rng(3)).press_site(Site(phantom=phantom), force_n=1.0)
    theirs = VirtualProbe(FLAT, rng=np.random.default_rng(3), strain="small").press(phantom, force_n=1.0)
    apart = ours.grey.astype(float) - theirs.grey
    assert np.abs(apart).mean() < 0.1
    assert np.abs(apart).max() <= 3


def test_a_lump_beside_the_axis_brightens_the_frame_over_it(monkeypatch: pytest.MonkeyPatch) -> None:
    radius = np.linspace(0.0, 12.0, 241)
    change = np.array([np.exp(-((radius / 3) ** 2)), np.zeros(241)])

    class Changes:
        radius_mm = radius

        def __call__(self, *_: object) -> np.ndarray:
            return change

    monkeypatch.setattr("benchmarks.searched_presses.lump_changes", lambda *_: Changes())
    lump = Inclusion(diameter_mm=6.0, depth_mm=3.0, young_kpa=6.0, offset_mm=(4.0, 0.0))
    even, uneven_site = (Site(phantom=TISSUE, lumps=lumps) for lumps in ((), (lump,)))
    without, with_it = (
        MovingProbe(FLAT, rng=np.random.default_rng(3)).press_site(site, force_n=1.0).grey.astype(float)
        for site in (even, uneven_site)
    )
    row, column = np.unravel_index(np.argmax(with_it - without), without.shape)
    sensor = Sensor()
    assert (column - sensor.columns / 2) * sensor.mm_per_pixel[0] == pytest.approx(4.0, abs=1.5)
    assert (row - sensor.rows / 2) * sensor.mm_per_pixel[1] == pytest.approx(0.0, abs=1.5)
    assert (with_it - without).max() > 10


def _lines(rng: np.random.Generator, targets: int = 600) -> list[dict[str, Any]]:
    lines = []
    for index in range(targets):
        there, size, depth = index % 2 == 0, rng.uniform(2, 15), rng.uniform(4, 12)
        evidence = rng.normal(there * (size - depth / 2) - 1.0, 2.0)
        lines.append(
            {
                "index": index,
                "present": there,
                "truth": [size, depth, 80.0 + index % 30],
                "offset_mm": rng.uniform(0, 5),
                "presence": float(1 / (1 + np.exp(-evidence))),
                "evidence": evidence,
                "flags": ["no_inclusion"] if evidence < 0 else [],
            }
        )
    return lines


def test_a_limit_is_that_of_thresholds_found_by_hand() -> None:
    searched = Searched.of(_lines(np.random.default_rng(1)))
    limit = detection_limit(searched, 0.9)
    blanks = np.flatnonzero(~searched.present)
    inside = np.flatnonzero(searched.present)
    decided = np.zeros(600, dtype=bool)
    for part in (0, 1):
        chosen, judged = np.sort(searched.evidence[blanks[part::2]]), blanks[1 - part :: 2]
        cut = chosen[int(np.ceil(0.9 * len(chosen))) - 1]  # the highest that must stay below the threshold
        decided[judged] = searched.evidence[judged] > cut
        decided[inside[1 - part :: 2]] = searched.evidence[inside[1 - part :: 2]] > cut
    differ = np.flatnonzero(decided != limit.decided)
    assert len(differ) <= 4  # between a threshold midway and the blank below it
    assert limit.specificity.value == pytest.approx(0.9, abs=0.05)
    trials = sum(one.trials for row in limit.found for one in row if one is not None)
    assert trials == 300
    large, small = limit.found[-1][0], limit.found[0][-1]
    assert large is not None
    assert small is not None
    assert large.value > 0.95 > 0.5 > small.value
    rows = reaches(searched, limit, probability=0.9)
    assert {row[0] for row in rows} == set(DIAMETERS_MM[:-1])
    assert {row[1] for row in rows} == set(DEPTHS_MM[1:])
    assert all(0 <= row[2] <= 5 for row in rows)


def test_a_study_that_misses_its_area_ends_with_one(capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(2)
    good = _lines(rng)
    for line in good:
        line["evidence"] += 20.0 * line["present"]
        line["presence"] = float(1 / (1 + np.exp(-line["evidence"])))
    searched, limits, goals = report(good)
    assert all(goal.met for goal in goals)
    assert "all, by evidence" in capsys.readouterr().out
    assert len(figure_of(searched, limits).axes) == 6  # four panels and two scales
    poor = [line | {"evidence": rng.normal(), "presence": rng.random()} for line in good]
    (goal,) = report(poor)[2]
    assert (goal.met, goal.name) == (False, "area, d >= 5 mm, h <= 8 mm, by evidence")


def test_refused_targets_are_counted_and_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    lines = _lines(np.random.default_rng(3))
    searched, _, _ = report([{**line, "refused": "too soft"} for line in lines[:6]] + lines[6:])
    assert "refused: 6 of 600, 3 of them inclusions" in capsys.readouterr().out
    assert (len(searched.present), searched.curve().targets) == (594, 297)

"""The printed study: what its numbers can mean, by brute force, and what the repeated one is made of."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.simulated_presses import PROTOCOLS
from matplotlib.figure import Figure
from scipy.stats import binomtest
from sklearn.metrics import roc_auc_score
from studies.section_6_4 import (
    BLANK,
    PLACES,
    PRESENT,
    PRINTED,
    PRINTED_AREA,
    SHOWN,
    TABLE_2_1,
    TRUTH,
    PreparedProbe,
    Result,
    between,
    drawn,
    lines,
    printed_lines,
    run,
    scaled,
    table_2_1,
)

import tsis
from tsis.mechanics import press
from tsis.study.roc import newcombe_interval
from tsis.virtual.probe import FINE_RESOLUTION, VirtualProbe


def test_what_the_printed_numbers_can_mean_is_so_for_every_ranking_of_eight_and_eight() -> None:
    text = "\n".join(printed_lines())
    for found, trials in ((6, 8), (7, 8)):
        within = binomtest(found, trials).proportion_ci(method="wilson")
        assert f"{100 * within.low:.1f} to {100 * within.high:.1f} %" in text
    areas = []
    for first in itertools.combinations(range(7), 1):  # where the false alarm stands among the first seven
        for rest in itertools.combinations(range(9), 2):  # and the last two inclusions among the last nine
            order = [at not in first for at in range(7)] + [at in rest for at in range(9)]
            areas.append(roc_auc_score(order, -np.arange(16.0)))
    assert f"steps through it enclose {min(areas):.3f} to {max(areas):.3f}" in text
    assert "lines enclose 0.8125" in text
    every = np.arange(129) / 128  # ties count half
    assert np.abs(every - PRINTED_AREA).min() > 0.0005, "no area of 8 + 8 targets rounds to 0.735"
    assert f"{every[np.abs(every - PRINTED_AREA).argmin()]:.6f}" in text
    assert newcombe_interval(PRINTED_AREA, 8, 8).holds(0.5)
    assert "holds 0.5" in text
    assert PRINTED.sensitivity.value == 0.75


def test_table_2_1_is_as_printed() -> None:
    text = "\n".join(table_2_1())
    for value in ("57.14", "97.11", "68.60", "91.40", "68.10", "95.10", "88.20", "67.70", "96.40", "77.30", "97.30"):
        assert value in text
    assert "14.10" in text
    assert "Bluemke" in text


def test_table_2_1_is_drawn_and_its_index_is_youdens() -> None:
    """As the distance of a point from the diagonal of chance, times the root of two."""
    figure = Figure()
    assert SHOWN[0].draw is not None
    SHOWN[0].draw(TABLE_2_1, figure)
    points = np.array([np.ravel(line.get_xydata()) for line in figure.axes[0].lines[:6]])
    distances = (points[:, 1] - points[:, 0]) / np.sqrt(2)
    assert list(SHOWN[0].values(TABLE_2_1).values()) == pytest.approx(100 * np.sqrt(2) * distances)


@pytest.mark.parametrize(
    ("probe", "force"), [pytest.param("tsis-2011", 1.0, marks=pytest.mark.slow), ("tsis-domed", 0.5)]
)
def test_a_press_between_those_solved_is_as_one_solved_there(probe: str, force: float) -> None:
    name, log_softer, other = "detection-7", 0.083, 0.975 * force
    found = between(probe, name, nominal_n=force, log_softer=log_softer, force_n=other)
    phantom = scaled(tsis.load_phantom(name), np.exp(log_softer))
    direct = press(tsis.load_probe(probe), phantom, force_n=other, resolution=FINE_RESOLUTION)
    plain = press(tsis.load_probe(probe), phantom.without_inclusion(), force_n=other, resolution=FINE_RESOLUTION)
    change = np.abs(direct.pressure_kpa - plain.pressure_kpa)[:200].max()
    assert np.abs(found.pressure_kpa - direct.pressure_kpa)[:200].max() < 3e-4 * change
    moved = np.abs(direct.face_displacement_mm - plain.face_displacement_mm).max()
    assert np.abs(found.face_displacement_mm - direct.face_displacement_mm)[:200].max() < 1e-3 * moved


def test_a_prepared_press_is_that_of_the_virtual_probe() -> None:
    probe, rng = tsis.load_probe("tsis-2011"), np.random.default_rng
    site, nearby = drawn("detection-7", PLACES[0], 0.03, rng(5))
    ours, theirs = PreparedProbe(probe, rng=rng(3)), VirtualProbe(probe, rng=rng(3), strain="small")
    for name, one in (("detection-7", site), (BLANK, nearby)):
        apart = ours.press_prepared(name, one, 1.0).grey.astype(float)
        apart -= theirs.press(replace(one.phantom, name=""), force_n=1.0).grey
        assert np.abs(apart).mean() < 0.1
        assert np.abs(apart).max() <= 3
    assert nearby.phantom.young_kpa != tsis.load_phantom(BLANK).young_kpa


@pytest.mark.slow
def test_a_short_study_over_the_inclusion_finds_all_and_says_what_it_is() -> None:
    report: list[tuple[int, int]] = []
    result = run(np.random.default_rng(1), repetitions=1, progress=lambda *at: report.append(at))
    assert result.presence.shape == (1, 16)
    assert report == [(1, 1)]
    assert not np.isnan(result.presence).any()
    assert (result.presence[:, 4:8] > 0.99).all(), "7 and 10 mm are found on the axis"
    assert np.median(result.presence[:, 8:]) < 0.5


def test_lines_count_what_the_studies_gave() -> None:
    rng = np.random.default_rng(4)
    presence = np.clip(rng.normal(0.35 + 0.4 * TRUTH, 0.25, (30, 16)), 0, 1)
    presence[3, 0] = presence[4, 9] = np.nan
    result = Result(protocol=PROTOCOLS["flat"], place=PLACES[1], presence=presence)
    wrong = presence.copy()
    wrong[3, 0], wrong[4, 9] = 0.0, 1.0
    assert result.areas == pytest.approx([roc_auc_score(TRUTH, row) for row in wrong])
    hits = (wrong[:, :8] >= 0.5).sum(axis=1)
    text = "\n".join(lines(result))
    assert f"sensitivity: {hits.sum() / 240:.1%} of 240 targets" in text
    assert f"{(hits <= 6).sum()} of 30 studies have the printed 6 of 8 or less" in text
    empty = (wrong[:, 8:] < 0.5).sum(axis=1)
    assert f"{(empty <= 7).sum()} of 30 studies have the printed 7 of 8 or less" in text
    assert "refused: 2 of 480, counted as the wrong answer" in text
    assert len(PRESENT) == 8

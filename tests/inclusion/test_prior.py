"""The prior: what it refuses, the box that its surrogate must cover, and the chart that straightens its posterior."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import InputError
from tsis.inclusion import InclusionPrior
from tsis.inclusion.posterior.exploration import SignalChart
from tsis.mechanics.surrogate.polynomial import contrast_factor

BEND = np.zeros(2)
PRIOR = InclusionPrior()


def test_the_default_is_the_dissertations_range() -> None:
    assert PRIOR.low.tolist() == [1.0, 4.0, 40.0]
    assert PRIOR.high.tolist() == [15.0, 12.0, 120.0]
    assert PRIOR.sd["young_kpa"] == pytest.approx(80 / np.sqrt(12))


def test_the_box_covers_the_beliefs_about_the_tissue() -> None:
    box = PRIOR.box()
    assert (box.diameter_mm, box.depth_mm, box.young_kpa) == (PRIOR.diameter_mm, PRIOR.depth_mm, PRIOR.young_kpa)
    assert box.tissue_young_kpa[0] < 5.0 * 0.8 < 5.0 * 1.2 < box.tissue_young_kpa[1]
    assert box.thickness_mm[0] < 30.0 * 0.95 < 30.0 * 1.15 < box.thickness_mm[1]
    assert box.thickness_mm[0] > PRIOR.depth_mm[1] + PRIOR.diameter_mm[1]


@pytest.mark.parametrize(
    ("changes", "phrase"),
    [
        ({"diameter_mm": (5.0, 2.0)}, r"the high end of diameter_mm must lie in .* got 2 \(above the low end\)"),
        ({"depth_mm": (0.0, 2.0)}, "the low end of depth_mm must lie in .* got 0"),
        ({"young_kpa": (40.0, 60.0, 80.0)}, "young_kpa must hold two numbers"),
        ({"young_kpa": (40.0, np.nan)}, "young_kpa must be finite"),
        ({"tissue_young_kpa": 0.0}, "tissue_young_kpa must lie in"),
        ({"tissue_young_sd": 0.0}, r"tissue_young_sd must lie in .*\(a fraction\)"),
        ({"thickness_sd": 0.5}, "thickness_sd must lie in"),
        ({"thickness_mm": 27.0}, r"depth_mm \+ diameter_mm must be less than thickness_mm = 27 by 2 %; got 27"),
        ({"young_kpa": (5.0, 60.0)}, "young_kpa must lie above tissue_young_kpa"),
        ({"poisson": 0.5}, "poisson must lie in"),
    ],
)
def test_what_a_prior_refuses(changes: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        replace(PRIOR, **changes)


INCLUSIONS = st.tuples(st.floats(1.0, 15.0), st.floats(4.0, 12.0), st.floats(40.0, 120.0))


@given(inclusion=INCLUSIONS)
def test_points_of_the_chart_are_inclusions_of_equal_signal(inclusion: tuple[float, float, float]) -> None:
    chart = SignalChart(prior=PRIOR, bend_mm=BEND)
    diameter, depth, young = inclusion
    signal = diameter * np.cbrt(contrast_factor(young / 5.0))
    point = np.array([[signal, depth, young]])
    np.testing.assert_allclose(chart.inclusions(point), [inclusion], rtol=1e-12)
    assert (point >= chart.low * (1 - 1e-12)).all()
    assert (point <= chart.high * (1 + 1e-12)).all()


@given(inclusion=INCLUSIONS)
def test_the_chart_keeps_the_prior_uniform(inclusion: tuple[float, float, float]) -> None:
    """The volume factor is the determinant of the map, here by finite differences."""
    chart = SignalChart(prior=PRIOR, bend_mm=BEND)
    diameter, depth, young = inclusion
    point = np.array([diameter * np.cbrt(contrast_factor(young / 5.0)), depth, np.clip(young, 40.01, 119.99)])
    step = 1e-5
    rows = [(chart.inclusions((point + e)[None]) - chart.inclusions((point - e)[None]))[0] for e in step * np.eye(3)]
    determinant = np.linalg.det(np.array(rows) / (2 * step))
    assert np.exp(chart.log_volume(point[None])[0]) == pytest.approx(determinant, rel=1e-5)


@given(inclusion=INCLUSIONS, bend=st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)))
def test_a_bent_chart_is_undone_and_keeps_volumes(
    inclusion: tuple[float, float, float], bend: tuple[float, float]
) -> None:
    straight, bent = (SignalChart(prior=PRIOR, bend_mm=np.array(each)) for each in (BEND, bend))
    row = np.array([inclusion])
    np.testing.assert_allclose(bent.inclusions(bent.points(row)), row, rtol=1e-12)
    point = bent.points(row)
    assert (point >= bent.low - 1e-9).all()
    assert (point <= bent.high + 1e-9).all()
    assert bent.allows(point).all()
    assert bent.log_volume(point)[0] == pytest.approx(straight.log_volume(straight.points(row))[0], rel=1e-12)


def test_a_chart_straightens_a_parabola() -> None:
    """Points on a known parabola along the modulus come out on a line."""
    rng = np.random.default_rng(1)
    bent = SignalChart(prior=PRIOR, bend_mm=np.array([0.6, -0.4]))
    young = rng.uniform(40.0, 120.0, 200)
    line = np.column_stack([8.0 + 0.01 * young, 6.0 - 0.005 * young, young])
    found = SignalChart(prior=PRIOR, bend_mm=BEND).straightened(bent.inclusions(line), np.full(200, 1 / 200))
    np.testing.assert_allclose(found.bend_mm, bent.bend_mm, atol=1e-9)


def test_the_chart_knows_where_the_prior_ends() -> None:
    chart = SignalChart(prior=PRIOR, bend_mm=BEND)
    stretch = np.cbrt(contrast_factor(80.0 / 5.0))
    points = np.array(
        [[10 * stretch, 5.0, 80.0], [16 * stretch, 5.0, 80.0], [10 * stretch, 3.9, 80.0], [9.0, 5.0, 121.0]]
    )
    assert chart.allows(points).tolist() == [True, False, False, False]

"""What the study says of the light out of a pressed guide."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from studies.figures_3_4_to_3_6 import SHOWN, Result, behind_the_dent_um, leaving_values, run

pytestmark = pytest.mark.slow  # the gallery's tests see the same numbers in every run


@pytest.fixture(scope="module")
def result() -> Result:
    return run()


def test_what_the_study_says(result: Result) -> None:
    both = result.top + result.bottom
    assert result.growth(result.top) == pytest.approx(1.23, abs=0.01)
    assert result.growth(both) == pytest.approx(0.73, abs=0.01)
    assert 0.15 < result.off_proportion(result.top) < 0.205
    assert (result.bottom[1:] > result.top[1:]).all()
    assert result.falling_modes == 2
    assert result.top[0] == pytest.approx(0.0, abs=1e-9)


def test_the_mean_out_of_the_top_grows_with_every_depth(result: Result) -> None:
    assert (np.diff(result.top) > 0.01).all()
    assert (np.diff(result.guided) < 0).all()
    np.testing.assert_allclose(result.guided + result.top + result.bottom, 1.0, atol=1e-4)  # the rest goes back


def test_light_leaves_behind_the_dent_where_it_is_counted(result: Result) -> None:
    """Half of it has left before the mean distance or shortly behind it, by adding up what leaves along the guide."""
    light = result.at(5.0)
    leaving = np.cumsum(light.top_per_um[1:-1].mean(axis=1))
    half = light.z_um[1:-1][np.searchsorted(leaving, leaving[-1] / 2)]
    assert behind_the_dent_um(light) == pytest.approx(half, abs=0.2 * float(np.ptp(light.z_um)))
    assert light.z_um[0] < behind_the_dent_um(light) < light.z_um[-1]


def test_the_figures_show_what_was_found(result: Result) -> None:
    pictures = {shown.name: Figure() for shown in SHOWN}
    for shown in SHOWN:
        assert shown.draw is not None
        shown.draw(result, pictures[shown.name])
    for name, depth in (("figure-3-4", 0.0), ("figure-3-5", 5.0)):
        light = result.at(depth)
        assert pictures[name].axes[0].get_title() == f"dent of {depth:g} µm"
        np.testing.assert_array_equal(pictures[name].axes[0].images[0].get_array(), light.index.T)
    totals = pictures["figure-3-6"].axes[1]
    curves = {line.get_label(): np.asarray(line.get_ydata()) for line in totals.lines}
    assert list(curves["out of the top, mean (modes grey)"]) == pytest.approx(100 * result.top)
    assert leaving_values(result)["light out of the top, dent of 4 µm"] == pytest.approx(100 * result.top[4])

"""The measured sheet: the edge against its closed form, the force and the loops against what the machine is."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from studies.table_4_1 import PROBE, SHOWN, Result, run, short, values

from tsis.imaging.sensor import Sensor
from tsis.virtual.loading_machine import VirtualLoadingMachine

TEN_TO_NINETY = 2 * 1.2815515655446004  # standard deviations between 10 and 90 % of a normal distribution
SMALL = Sensor(columns=256, rows=216)


@pytest.fixture(scope="module")
def result() -> Result:
    return run(np.random.default_rng(1), sensor=SMALL)


def test_the_edge_is_as_wide_as_lens_and_pixels_blur_it() -> None:
    found = values(short(np.random.default_rng(2)))
    width = 1000 * TEN_TO_NINETY * np.hypot(0.05, 0.0336 / np.sqrt(12))
    assert found == {"width of an edge of contact, 10 to 90 %": pytest.approx(width, rel=0.02)}


@pytest.mark.slow
def test_the_loops_are_what_the_machine_remembers(result: Result) -> None:
    found = result.value("hysteresis")
    assert found is not None
    machine = VirtualLoadingMachine(PROBE, rng=np.random.default_rng(1), sensor=SMALL)  # the same machine
    share = 0.6
    low, high = found.interval(0.999)
    assert low < -4 * share**2 * (1 - share) * machine.truth.hysteresis_fraction < high


def test_the_smallest_force_is_that_of_the_noise_of_untouched_frames(result: Result) -> None:
    """5 % of normal noise lie beyond 1.645 standard deviations: of no contact above, of the force below."""
    found = result.value("smallest detectable force")
    assert found is not None
    noise = np.concatenate([one.field_grey[~one.touched] for one in result.loadings]).std(ddof=1)
    slopes = [np.polyfit(one.load_n, one.field_grey, 1)[0] for one in result.loadings]
    assert found.value == pytest.approx(2 * 1.645 * noise / np.mean(slopes), rel=0.3)


@pytest.mark.parametrize("whole", [True, False])
def test_the_figure_shows_what_was_measured(result: Result, whole: bool) -> None:
    figure = Figure()
    assert SHOWN[0].draw is not None
    shown = result if whole else Result(edge_mm=result.edge_mm)
    SHOWN[0].draw(shown, figure)
    names = [tick.get_text() for tick in figure.axes[1].get_yticklabels()]
    assert ("this probe" in names) == whole
    assert figure.axes[0].get_yticklabels()[-1].get_text() == "this probe"

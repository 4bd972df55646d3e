"""The picture over the inclusion: what the inclusion adds, and where its bell comes from."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from studies.figure_4_7 import FORCE_N, PHANTOM, PROBE, SHOWN, Result, run, values

from tsis.imaging.corrections import signal
from tsis.model.calibration import LightMap
from tsis.virtual.probe import VirtualProbe


@pytest.fixture(scope="module")
def result() -> Result:
    return run(np.random.default_rng(1))


def test_the_bell_is_that_of_the_lamps(result: Result) -> None:
    even = VirtualProbe(PROBE, rng=np.random.default_rng(1), light=LightMap.uniform(), strain="small")
    _, under_even = result.row(even.light(PHANTOM.without_inclusion(), force_n=FORCE_N))
    x, under_lamps = result.row(result.plain)
    half_way, middle = np.abs(np.abs(x) - 6.0) < 0.1, np.abs(x) < 0.1
    assert under_lamps[half_way].mean() < 0.5 * under_lamps[middle].mean()
    assert under_even[half_way].mean() > 0.95 * under_even[middle].mean()


def test_the_inclusion_adds_most_over_itself(result: Result) -> None:
    change = result.expected - result.plain
    row, column = np.unravel_index(int(change.argmax()), change.shape)
    across, down = result.raw.scale()
    centre = (np.array(change.shape) - 1) / 2
    assert np.hypot(across * (column - centre[1]), down * (row - centre[0])) < 1.0
    assert 0.0 < result.added < 0.05 * result.plain.max()
    assert change.sum() * across * down == pytest.approx(0.0, abs=0.05 * result.plain.sum() * across * down)


def test_the_numbers_are_those_of_the_frame(result: Result) -> None:
    found = values(result)
    lit = signal(result.raw, result.untouched).grey[result.seen.patch.mask]
    across, down = result.raw.scale()
    assert found["area of the bright patch"] == pytest.approx(lit.size * across * down)
    assert found["sum of grey levels of the bright patch, in millions"] == pytest.approx(lit.sum() / 1e6, rel=1e-6)
    assert lit.mean() < found["brightest grey level above the untouched probe"] <= lit.max()
    assert found["brightest place, distance from the centroid"] < 0.1


def test_the_figure_shows_the_frame(result: Result) -> None:
    figure = Figure()
    assert SHOWN[0].draw is not None
    SHOWN[0].draw(result, figure)
    np.testing.assert_array_equal(figure.axes[0].images[0].get_array(), result.raw.grey)

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from tsis.optics.propagation import Dent, Propagation, propagate, thin_guide
from tsis.present.figures import guide_index, guide_light, light_out_of_the_top


@pytest.fixture(scope="module")
def results() -> list[Propagation]:
    return [propagate(thin_guide("dissertation"), Dent(depth_um=depth), modes=4) for depth in (0.0, 4.0)]


def test_the_index_is_drawn_with_the_pressed_face_on_top(results: list[Propagation]) -> None:
    ax = Figure().subplots()
    assert guide_index(results[1], ax) is ax
    (shown,) = ax.images
    np.testing.assert_array_equal(shown.get_array(), results[1].index.T)
    left, right, bottom, top = shown.get_extent()
    assert (left, right) == (results[1].z_um[0], results[1].z_um[-1])
    assert top < 0 < bottom, "depth grows downwards"


def test_light_is_drawn_in_decibels_with_the_layers(results: list[Propagation]) -> None:
    ax = guide_light(results[1], Figure().subplots())
    (shown,) = ax.images
    drawn = np.asarray(shown.get_array())
    z, x = np.unravel_index(results[1].intensity.argmax(), results[1].intensity.shape)
    assert drawn[x, z] == drawn.max() == 0.0
    assert drawn.min() == pytest.approx(-30.0)
    assert len(ax.lines) == 5
    assert np.max(np.asarray(ax.lines[0].get_ydata())) == pytest.approx(4.0, abs=0.01)


def test_each_dent_has_its_curve_of_lost_light(results: list[Propagation]) -> None:
    ax = light_out_of_the_top(results, Figure().subplots())
    for line, result in zip(ax.lines, results, strict=True):
        lost = np.asarray(line.get_ydata()).sum() * np.diff(result.z_um[:2])[0] / 100
        assert lost == pytest.approx(result.top_per_um.mean(axis=1).sum() * np.diff(result.z_um[:2])[0], abs=1e-3)
    legend = ax.get_legend()
    assert legend is not None
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts[0] == "0 µm deep: 0.0 % in all"
    assert f"{100 * results[1].powers.top.mean():.1f} %" in texts[1]

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from tsis.catalog.probes import load_probe
from tsis.model.probe import Led
from tsis.present.figures import probe_section

PROBE = load_probe("tsis-domed")


def test_a_probe_is_drawn_with_what_its_layers_are_made_of() -> None:
    ax = probe_section(PROBE, Figure().subplots())
    said = [text.get_text() for text in ax.texts]
    assert [text for text in said if text.endswith("kPa")] == ["140 kPa", "80 kPa", "34 kPa"]
    heights = [text.get_position()[1] for text in ax.texts if text.get_text().endswith("kPa")]
    assert heights == pytest.approx([1.0, 3.5, 7.5])
    assert ax.get_ylim() == pytest.approx((-1.0, 14.0))


@pytest.mark.parametrize("aim_deg", [-10.0, 0.0, 25.0])
def test_a_beam_leaves_its_lamp_along_its_aim(aim_deg: float) -> None:
    probe = replace(PROBE, leds=(Led(azimuth_deg=30.0, height_mm=4.0, aim_deg=aim_deg, half_angle_deg=20.0),))
    ax = probe_section(probe, Figure().subplots())
    (aim,) = [line for line in ax.lines if line.get_linestyle() == "--"]
    x, y = (np.asarray(values, dtype=float) for values in (aim.get_xdata(), aim.get_ydata()))
    assert (x[0], y[0]) == pytest.approx((12.0, 4.0)), "the first lit lamp stands at the right"
    assert np.degrees(np.arctan2(y[1] - y[0], x[0] - x[1])) == pytest.approx(aim_deg)
    beam = next(patch for patch in ax.patches if patch.get_alpha() == pytest.approx(0.3))
    vertices = np.asarray(beam.get_path().vertices)[1:3]
    angles = np.degrees(np.arctan2(vertices[:, 1] - 4.0, 12.0 - vertices[:, 0]))
    assert (angles.min(), angles.max()) == pytest.approx((aim_deg - 20.0, aim_deg + 20.0))


def test_lamps_beside_the_plane_and_unlit_ones_are_left_out() -> None:
    leds = (Led(azimuth_deg=0.0), Led(azimuth_deg=90.0), Led(azimuth_deg=180.0, power=0.0))
    ax = probe_section(replace(PROBE, leds=leds), Figure().subplots())
    assert sum(line.get_linestyle() == "--" for line in ax.lines) == 1

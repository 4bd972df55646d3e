from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from tsis.catalog.probes import load_probe
from tsis.model.press import PressField
from tsis.model.probe import FOUR_LEDS
from tsis.optics.rays.tracing import trace_paths, trace_rays
from tsis.present.figures import light_on_face, ray_picture

PROBE = replace(load_probe("tsis-2011"), leds=FOUR_LEDS)  # level lamps at half height


def test_rays_are_drawn_from_the_first_lamp_with_layers_glass_and_lamps() -> None:
    radius = np.linspace(0.0, 12.0, 25)
    dent = PressField(
        radius_mm=radius,
        face_displacement_mm=np.exp(-(radius**2) / 8),
        pressure_kpa=np.zeros(25),
        approach_mm=1.0,
        force_n=0.0,
    )
    paths = trace_paths(PROBE, dent, rays=5)
    ax = ray_picture(PROBE, paths, Figure().subplots(), pressed=dent)
    assert len(ax.collections) == 5
    starts = [np.asarray(collection.get_paths()[0].vertices)[0] for collection in ax.collections]
    for start, path in zip(starts, paths, strict=True):
        np.testing.assert_allclose(start, [path[0, 0], path[0, 2]])
        assert start[0] == pytest.approx(12.0, abs=0.1), "the first lamp stands at the right"
    lamps = [patch for patch in ax.patches if patch.get_facecolor()[:3] == pytest.approx((0.941, 0.706, 0.0), abs=1e-3)]
    assert len(lamps) == 2, "those beside the plane of the picture are left out"
    (face,) = ax.lines
    assert np.max(np.asarray(face.get_ydata())) == pytest.approx(1.0)
    assert {text.get_text() for text in ax.texts} == {"n = 1.41", "glass, n = 1.515"}


@pytest.mark.parametrize("what", ["arriving", "lost", "coupled"])
def test_a_map_holds_the_light_of_its_bins_per_area(what: str) -> None:
    even = PressField(
        radius_mm=np.array([0.0, 12.0]),
        face_displacement_mm=np.zeros(2),
        pressure_kpa=np.full(2, 5.0),
        approach_mm=0.0,
        force_n=2.0,
    )
    found = trace_rays(PROBE, even, rays=5000, bins=12)
    figure = Figure()
    ax = light_on_face(found, figure.subplots(), what=what)
    (shown,) = ax.images
    drawn: Any = np.ma.filled(np.ma.asarray(shown.get_array()), np.nan)
    inside = np.isfinite(drawn)
    assert np.count_nonzero(~inside) > 4, "corners beyond the face are empty"
    np.testing.assert_allclose(drawn[inside] * 4.0 / 1e6, getattr(found, what)[inside])
    assert ax.get_xlim() == pytest.approx((-12.0, 12.0))
    assert "per mm²" in figure.axes[1].get_ylabel()

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from tsis.present.figures import draw_scan_plan
from tsis.study.search import ScanPlan

PLAN = ScanPlan(width_mm=60.0, height_mm=40.0, strips=3, presses_a_strip=4, radius_mm=12.0)


def test_each_press_has_its_face_and_its_reach() -> None:
    ax = Figure().subplots()
    assert draw_scan_plan(PLAN, ax, extent_mm=5.0) is ax
    discs = [one for one in ax.collections if isinstance(one, EllipseCollection)]
    assert np.concatenate([np.atleast_1d(one.get_widths()) for one in discs]).tolist() == [10.0, 24.0]
    for one in discs:
        assert np.asarray(one.get_offsets()) == pytest.approx(PLAN.positions_mm)
    assert len(draw_scan_plan(PLAN, Figure().subplots()).collections) == 1


def test_the_marked_place_is_farthest_from_every_press() -> None:
    ax = draw_scan_plan(PLAN, Figure().subplots())
    (mark,) = (line for line in ax.lines if line.get_marker() == "x")
    at = np.array([mark.get_xdata(), mark.get_ydata()]).ravel()
    distances = np.hypot(*(PLAN.positions_mm - at).T)
    assert distances.min() == pytest.approx(PLAN.worst_distance_mm)
    (way,) = (line for line in ax.lines if line.get_marker() == ".")
    assert np.asarray(way.get_xydata()) == pytest.approx(PLAN.positions_mm)

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from tests.hardness.stand_ins import by_table

import tsis
from tsis.catalog.phantoms import load_sphere
from tsis.hardness import estimate
from tsis.hardness.table import build_contact_table
from tsis.present.figures import contact_growth, modulus
from tsis.virtual.direct_contact import DirectContactRig

if TYPE_CHECKING:
    from tsis.model.estimate import Estimate

PROBE = tsis.load_probe("tsis-direct")


@pytest.fixture(scope="module")
def found() -> Estimate:
    rig = DirectContactRig(PROBE, rng=np.random.default_rng(1), solve=by_table)
    images = rig.press_path(load_sphere("cl2000x"), forces_n=[0.7, 1.2])
    return estimate(images, probe=PROBE, calibration=rig.calibration)


def test_the_modulus_is_shown_with_its_truth(found: Estimate) -> None:
    ax = Figure().subplots()
    assert modulus(found, ax, truth_kpa=103.0) is ax
    assert [line.get_xdata() for line in ax.lines] == [[103.0, 103.0]]
    outline: Any = ax.patches[0]
    x, y = outline.get_xy().T
    assert abs(np.trapezoid(y, x)) == pytest.approx(1.0)


def test_the_curve_of_the_estimate_passes_through_the_frames(found: Estimate) -> None:
    ax = contact_growth(found, Figure().subplots(), table=build_contact_table(PROBE))
    frames, curve = ax.lines
    np.testing.assert_allclose(np.asarray(frames.get_xdata()), [0.7, 1.2])
    between = np.interp([0.7, 1.2], np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata()))
    np.testing.assert_allclose(np.asarray(frames.get_ydata()), between, rtol=0.02)

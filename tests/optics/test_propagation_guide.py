"""Shape of the dent and of the layers under it, and what the cells of a grid hold of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import InputError, UnknownNameError
from tsis.optics.propagation import Dent, ThinGuide, axis, interfaces_um, permittivity, thin_guide

GUIDE = thin_guide("dissertation")


@given(sunk=st.floats(0.001, 1.0), radius=st.floats(0.5, 50.0), share=st.floats(-1.0, 1.0))
def test_the_face_lies_on_the_tip(sunk: float, radius: float, share: float) -> None:
    depth = sunk * radius
    dent = Dent(depth_um=depth, tip_radius_um=radius)
    place = share * dent.half_width_um
    below_the_axis = dent.at(place) - (depth - radius)
    assert np.hypot(place, below_the_axis) == pytest.approx(radius, rel=1e-6)
    assert dent.at(1.000001 * dent.half_width_um) == 0.0
    assert dent.at(0.0) == pytest.approx(depth)


def test_a_tip_sunk_deeper_than_its_radius_leaves_upright_walls() -> None:
    dent = Dent(depth_um=3.0, tip_radius_um=1.0)
    np.testing.assert_allclose(dent.at([-1.001, -0.999999, 0.0, 0.999999, 1.001]), [0, 2, 3, 2, 0], atol=2e-3)


@given(depth=st.floats(0.0, 8.5), place=st.floats(-20.0, 20.0))
def test_soft_layers_keep_their_proportion_and_the_plate_its_place(depth: float, place: float) -> None:
    (found,) = interfaces_um(GUIDE, Dent(depth_um=depth), [place])
    left = np.diff(found)
    np.testing.assert_allclose(left[:3] / left[:3].sum(), GUIDE.thickness_um[:3] / 9.0, rtol=1e-9)
    np.testing.assert_allclose(found[3:], [9.0, 10.0], rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"depth_um": -1.0}, "depth_um must lie in"),
        ({"depth_um": float("nan")}, "depth_um must lie in"),
        ({"tip_radius_um": 0.0}, "tip_radius_um must lie in"),
        ({"depth_um": "2"}, "depth_um must be a number"),
    ],
)
def test_a_dent_that_is_none_is_refused(change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        Dent(**change)


def test_a_dent_into_the_plate_is_refused() -> None:
    with pytest.raises(InputError, match=r"depth_um must be at most 8.55, because the soft layers are 9 um thick"):
        interfaces_um(GUIDE, Dent(depth_um=9.5), [0.0])


@pytest.mark.parametrize("rigid", [4, -1, 1.5, None])
def test_a_guide_without_a_soft_layer_is_refused(rigid: Any) -> None:
    with pytest.raises(InputError, match="for a layer must yield"):
        ThinGuide(index=GUIDE.index, thickness_um=GUIDE.thickness_um, rigid_layers=rigid)


def test_a_misspelt_guide_is_named() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'dissertation'"):
        thin_guide("disertation")


def test_a_cell_holds_the_mean_of_what_is_in_it() -> None:
    """Against counting points that fall into each layer."""
    dent = Dent(depth_um=5.0, tip_radius_um=6.0)
    across = axis(-1.0, 11.0, step_um=0.4, absorber_um=0.0).nodes_um
    along = axis(-8.0, 8.0, step_um=0.4, absorber_um=0.0).nodes_um
    found = permittivity(GUIDE, dent, across, along)
    fine = 40
    x = across[0] + (np.arange((len(across) - 1) * fine) + 0.5) * 0.4 / fine
    z = along[0] + (np.arange((len(along) - 1) * fine) + 0.5) * 0.4 / fine
    squares = np.concatenate(([1.0], GUIDE.index**2, [1.0]))
    counted = [squares[np.searchsorted(places, x)] for places in interfaces_um(GUIDE, dent, z)]
    means = np.array(counted).reshape(len(along) - 1, fine, len(across) - 1, fine).mean(axis=(1, 3))
    # an upright edge passes a cell at one of four sections, each of which weighs a quarter of the step in the index
    assert np.abs(found - means).max() < 0.35 / 4
    assert np.abs(found - means).mean() < 1e-3
    assert found.sum() == pytest.approx(means.sum(), rel=1e-4)

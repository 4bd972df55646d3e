"""Where the power goes: conservation, reciprocity, perturbation theory, and the march against the referee."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.errors import InputError
from tsis.optics import guided_modes
from tsis.optics.propagation import (
    CELLS_A_WAVE,
    COARSEST,
    Axis,
    Dent,
    SectionModes,
    ThinGuide,
    axis,
    outward,
    permittivity,
    propagate,
    section_modes,
    solve_launched,
    thin_guide,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

GUIDE = thin_guide("dissertation")
SMALL = ThinGuide(index=np.array([1.3, 1.2, 1.25]), thickness_um=np.array([1.0, 0.8, 0.4]))
COARSE: dict[str, Any] = {"method": "fdfd", "step_um": 0.1}
K0 = 2 * np.pi / 0.55
SHARES = ("guided", "reflected", "top", "bottom")


@pytest.mark.parametrize("name", ["dissertation", "realistic"])
def test_a_flat_guide_lets_every_mode_pass(name: str) -> None:
    powers = propagate(thin_guide(name), length_um=12.0, **{**COARSE, "step_um": 0.08}).powers
    np.testing.assert_allclose(powers.guided, 1.0, atol=1e-6)
    for none in (powers.reflected, powers.top, powers.bottom):
        np.testing.assert_allclose(none, 0.0, atol=1e-6)


def test_no_power_is_lost_but_near_cut_off() -> None:
    result = propagate(GUIDE, Dent(depth_um=6.0), modes=21, **COARSE)
    assert result.powers.balance_error[result.clear].max() < 1e-6
    assert result.powers.balance_error[~result.clear].max() < 1e-4
    assert np.count_nonzero(result.clear) == 16


def test_what_leaves_along_the_guide_adds_up_to_what_leaves_it() -> None:
    """What the dent turns out leaves on both sides, a part of it beyond the ends of the grid."""
    result = propagate(
        SMALL, Dent(depth_um=1.0, tip_radius_um=2.0), method="fdfd", modes=2, step_um=0.08, length_um=16.0
    )
    step = float(result.z_um[1] - result.z_um[0])
    for along, whole in (
        (result.top_per_um, result.powers.top),
        (result.bottom_per_um, result.powers.bottom),
    ):
        assert whole.min() > 0.01
        here = along.sum(axis=0) * step
        assert (0.3 * whole < here).all()
        assert (here < whole).all()


def test_the_march_takes_steps_that_a_user_may_ask_for() -> None:
    assert min(CELLS_A_WAVE.values()) >= COARSEST


@settings(max_examples=15)
@given(
    depth=st.floats(0.0, 1.6),
    radius=st.floats(0.5, 20.0),
    index=st.lists(st.floats(1.2, 1.6), min_size=3, max_size=3),
)
def test_power_is_conserved_in_any_guide_and_dent(depth: float, radius: float, index: list[float]) -> None:
    guide = ThinGuide(index=np.array(index), thickness_um=SMALL.thickness_um)
    dent = Dent(depth_um=depth, tip_radius_um=radius)
    length = 2 * dent.half_width_um + 5.0
    result = propagate(guide, dent, method="fdfd", step_um=0.08, length_um=length, modes=1)
    assert result.powers.balance_error[0] < (1e-6 if result.clear[0] else 1e-4)
    powers = result.powers
    for share in (powers.guided, powers.reflected, powers.top, powers.bottom):
        assert -1e-6 < share[0] < 1 + 1e-6


def scattering(
    squared: NDArray[np.float64], across: Axis, along: Axis, flat: SectionModes
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Amplitudes (to, from), for unit power, that pass on to the right end and are thrown back to the left.

    Both ends are the second node between the absorbers, so a guide turned round has the same ends.
    """
    field = solve_launched(across, along, squared, flat, flat.guided)
    first, last = along.inner.start, along.inner.stop - 1
    step, kept = along.step_um, slice(flat.guided)
    one_node = flat.onward(step)[kept, np.newaxis]
    root = np.sqrt(flat.flow(np.eye(len(flat.separation), flat.guided, dtype=complex), step, slice(None)))
    passed = outward(flat, step, field[last], field[last + 1])[kept] / one_node
    back = outward(flat, step, field[first], field[first - 1])[kept] / one_node
    return root[:, np.newaxis] * passed / root, root[:, np.newaxis] * back / root


def irregular_guide(seed: int) -> tuple[Axis, Axis, NDArray[np.float64], SectionModes]:
    """A small guide with lumps of other indices in it, without any symmetry."""
    across = axis(-2.0, 4.2, step_um=0.08, absorber_um=2.0)
    along = axis(-3.0, 3.0, step_um=0.08, absorber_um=2.0)
    squared = K0**2 * permittivity(SMALL, Dent(depth_um=0.7, tip_radius_um=1.0), across.nodes_um, along.nodes_um)
    rng = np.random.default_rng(seed)
    lumps = rng.uniform(0.0, 40.0, (8, 10))
    middle_z, middle_x = along.cells // 2 + 3, across.cells // 2 - 2
    squared[middle_z : middle_z + 8, middle_x : middle_x + 10] += lumps
    return across, along, squared, section_modes(across, squared[0], faded_um=2.0)


def test_what_goes_from_one_mode_to_another_goes_back_the_same() -> None:
    """Reciprocity: the same guide turned round passes the transpose, and what it throws back is symmetric."""
    across, along, squared, flat = irregular_guide(3)
    passed, back = scattering(squared, across, along, flat)
    turned, _ = scattering(squared[::-1], across, along, flat)
    clear = np.ix_(flat.clear, flat.clear)
    assert np.abs(passed - passed.T).max() > 0.05, "the guide is not its own mirror image"
    assert np.abs(back).max() > 1e-3
    np.testing.assert_allclose(turned[clear], passed.T[clear], atol=1e-7)
    np.testing.assert_allclose(back[clear], back.T[clear], atol=1e-7)


def test_weak_lumps_scatter_as_perturbation_theory_says() -> None:
    """Coupled modes: ``k0**2 / (2 sqrt(b_m b_n))`` times the integral of both profiles and the change, on and back.

    Light thrown straight back turns twice a cell, so it errs by a share of the squared phase a cell.
    """
    across = axis(-1.5, 3.7, step_um=0.025, absorber_um=1.5)
    along = axis(-1.0, 1.0, step_um=0.025, absorber_um=1.5)
    x, z = _middles(across.nodes_um), _middles(along.nodes_um)
    squared = K0**2 * permittivity(SMALL, Dent(), across.nodes_um, along.nodes_um)
    flat = section_modes(across, squared[0], faded_um=1.5)
    weak = 1e-3 * np.outer(np.exp(-((z - 0.1) ** 2) / 0.005), np.where((x > 0) & (x < 2.2), x, 0.0))
    still, silent = scattering(squared, across, along, flat)
    passed, back = scattering(squared + K0**2 * weak, across, along, flat)
    exact = guided_modes(SMALL.index, SMALL.thickness_um, wavelength_um=0.55)
    beta = K0 * exact.n_eff
    shape = np.array([exact.profile(mode, x) for mode in range(len(beta))])
    shape /= np.sqrt((shape**2).sum(axis=1, keepdims=True) * across.step_um)
    clear = np.ix_(flat.clear, flat.clear)
    for direction, found, bound in ((-1, passed - still, 0.02), (1, back - silent, 0.05)):
        turns = np.exp(1j * np.multiply.outer(direction * beta[:, np.newaxis] + beta, z))
        overlap = np.einsum("mx,nx,zx,mnz->mn", shape, shape, weak, turns) * across.step_um * along.step_um
        expected = K0**2 / (2 * np.sqrt(np.outer(beta, beta))) * np.abs(overlap)
        np.testing.assert_allclose(np.abs(found)[clear], expected[clear], atol=bound * expected.max())


def _middles(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    return (nodes[1:] + nodes[:-1]) / 2


@pytest.mark.slow
def test_the_march_finds_what_the_referee_finds_and_more_leaves_a_deeper_dent() -> None:
    tops, off = [], []
    for depth in (0.0, 2.0, 4.0, 6.0):
        dent = Dent(depth_um=depth)
        marched = propagate(GUIDE, dent)
        refereed = propagate(GUIDE, dent, method="fdfd", step_um=0.08)
        tops.append([marched.powers.top.mean(), refereed.powers.top.mean()])
        first, second = ([getattr(one.powers, name).mean() for name in SHARES] for one in (marched, refereed))
        off.append(max(abs(one - other) for one, other in zip(first, second, strict=True)))
    assert max(off) < 0.015
    assert (np.diff(tops, axis=0) > 0.01).all()
    assert np.abs(tops[0]).max() < 1e-6


def test_a_single_mode_need_not_lose_more_under_a_deeper_dent() -> None:
    lost = np.array([propagate(GUIDE, Dent(depth_um=depth)).powers.top for depth in np.arange(1.0, 7.0)])
    assert (np.diff(lost.mean(axis=1)) > 0).all()
    assert (np.diff(lost, axis=0) < 0).any()


@pytest.mark.slow
def test_powers_do_not_depend_on_where_the_grid_ends() -> None:
    """What leaves the sides beyond the ends is a geometric series: a longer grid moves light from it to the sides."""
    dent = Dent(depth_um=4.0)
    short, long = (propagate(GUIDE, dent, length_um=length, **COARSE) for length in (22.0, 60.0))
    for name in ("guided", "top", "bottom"):
        np.testing.assert_allclose(getattr(short.powers, name), getattr(long.powers, name), atol=2e-4)
    here = [result.top_per_um.sum(axis=0).mean() * np.diff(result.z_um[:2])[0] for result in (short, long)]
    assert here[0] < 0.8 * here[1] < 0.99 * long.powers.top.mean()


@pytest.mark.slow
def test_refining_the_grid_changes_less_and_less() -> None:
    dent = Dent(depth_um=0.4, tip_radius_um=4.0)
    found = [
        propagate(SMALL, dent, method="fdfd", modes=2, length_um=9.0, step_um=step).powers
        for step in (0.1, 0.05, 0.025)
    ]
    first, second = np.abs(np.diff([np.append(one.guided, one.top) for one in found], axis=0)).max(axis=1)
    assert second < 5e-3
    assert first / second > 2.0


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"wavelength_um": 550.0}, "looks like nanometres; give 0.55"),
        ({"modes": 22}, r"modes must lie in \[1, 21\]"),
        ({"modes": 0}, r"modes must lie in \[1, 2000\]"),
        ({"modes": 2.5}, "modes must be a whole number"),
        ({"length_um": 10.0}, "length_um must lie in .*the dent must fit"),
        ({"step_um": 0.3}, "step_um must lie in .*4 cells a wavelength"),
        ({"method": "fdtd"}, "did you mean 'fdfd'"),
        ({"method": "fdfd", "step_um": 0.02}, "must fit in 2 GiB; it needs about .*choose a larger step_um"),
        ({"length_um": 1e4, "step_um": 0.02}, "must fit in 2 GiB"),
        ({"step_um": 0.005}, "at most 2000 nodes"),
        ({"dent": Dent(depth_um=9.0)}, "because the soft layers are 9 um thick"),
        ({"dent": 3.0}, "dent must be a Dent"),
        ({"guide": ThinGuide(index=np.array([1.2, 1.2]), thickness_um=np.ones(2), index_outside=1.3)}, "guided mode"),
    ],
)
def test_what_cannot_be_computed_is_refused_in_a_sentence(change: dict[str, Any], sentence: str) -> None:
    call = {"guide": GUIDE, "dent": Dent(depth_um=2.0), **change}
    with pytest.raises(InputError, match=sentence):
        propagate(call.pop("guide"), **call)

"""Waves through a dented guide: its shape, closed forms in a uniform medium, modes of a section, conserved power."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.linalg import splu
from scipy.special import hankel1

from tsis.errors import InputError, UnknownNameError
from tsis.optics import guided_modes
from tsis.optics.propagation import (
    CELLS_A_WAVE,
    COARSEST,
    MASS,
    Axis,
    Dent,
    SectionModes,
    ThinGuide,
    axis,
    helmholtz_matrix,
    interfaces_um,
    links,
    march,
    memory_bytes,
    outward,
    permittivity,
    propagate,
    section_modes,
    solve,
    solve_launched,
    thin_guide,
    times,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


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


K = 2 * np.pi  # a wavelength of 1 um


def point_source(step: float) -> tuple[Axis, NDArray[np.complex128], float]:
    """A square of 4 um with a source in its middle: its sides, the field, and the power that it gives."""
    line = axis(-2.0, 2.0, step_um=step, absorber_um=1.5)
    nodes, middle = line.cells + 1, line.cells // 2
    source = np.zeros((nodes, nodes), dtype=complex)
    weights = np.array([MASS[0, 1], 2 * MASS[0, 0], MASS[0, 1]])  # a source is weighed as the elements weigh a field
    source[middle - 1 : middle + 2, middle - 1 : middle + 2] = np.outer(weights, weights)
    matrix = helmholtz_matrix(line, line, np.full((line.cells, line.cells), K**2))
    field = solve(matrix, source.reshape(-1, 1)).reshape(nodes, nodes)
    return line, field, float(np.vdot(source, field).imag)


def test_a_point_source_sends_a_hankel_function_into_all_directions() -> None:
    errors = []
    for step in (0.1, 0.05):
        line, field, _ = point_source(step)
        x = line.nodes_um[line.inner]
        distance = np.hypot(x, x[:, np.newaxis])
        far = distance > 0.5
        exact = 0.25j * hankel1(0, K * distance[far])
        errors.append(np.abs(field[line.inner, line.inner][far] - exact).max() / np.abs(exact).max())
    assert errors[1] < 1e-3, "nothing comes back from the absorbers, at any angle"
    assert errors[0] / errors[1] > 2**3.5, "its speed is good to fourth order"


def test_the_flow_through_any_closed_border_is_the_power_of_the_source() -> None:
    line, field, power = point_source(0.1)
    assert power == pytest.approx(0.25, rel=(0.1 * K) ** 2 / 10), "the imaginary part of i H0 / 4 at its source"
    straight, aslant = links(line.step_um, line.step_um, K**2)
    for half in (5, 12, 19):
        edge = line.cells // 2 - half
        near, before, after = (slice(edge + by, edge + by + 2 * half + 1) for by in (0, -1, 1))
        beyond = straight * field[edge - 1, near] + aslant * (field[edge - 1, before] + field[edge - 1, after])
        side = -np.imag(field[edge, near].conj() * beyond).sum()
        shared = -np.imag(field[edge, edge].conj() * aslant * field[edge - 1, edge - 1])  # by two sides
        assert 4 * (side - shared) == pytest.approx(power, rel=1e-9)


def exact_root(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.sqrt(1 + x)


def pade_root(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1 + (x / 2) / (1 + x / 4)


def paraxial_root(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1 + x / 2


def tilted_beam(
    x: NDArray[np.float64], z: float, tilt: float, root: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> NDArray[np.complex128]:
    """A Gaussian beam by its plane waves; at z = 0 it is ``exp(-((x + 3) / 2)**2 + i tilt x)``."""
    kx = np.linspace(tilt - 5.0, tilt + 5.0, 2001)
    kx = kx[np.abs(kx) < K]
    kz = K * root(-(kx**2) / K**2)
    spectrum = np.exp(-((kx - tilt) ** 2) + 3j * (kx - tilt) + 1j * z * kz) / np.sqrt(np.pi)
    return np.asarray(np.exp(1j * np.outer(x, kx)) @ spectrum * (kx[1] - kx[0]))


@pytest.mark.parametrize(("angle_deg", "bound"), [(0.0, 0.002), (10.0, 0.005), (20.0, 0.02), (25.0, 0.06)])
def test_a_marched_beam_goes_where_it_is_sent(angle_deg: float, bound: float) -> None:
    """Twelve wavelengths on: as the fraction says, and at 20 degrees still as the wave does, unlike a paraxial one."""
    across = axis(-16.0, 16.0, step_um=0.05, absorber_um=3.0)
    along = axis(0.0, 12.0, step_um=0.05, absorber_um=0.0)
    x, tilt = across.nodes_um, K * np.sin(np.radians(angle_deg))
    start = tilted_beam(x, 0.0, tilt, exact_root)[:, np.newaxis]
    found = march(across, along, np.full((along.cells, across.cells), K**2), start, K)[-1, :, 0]
    seen = np.abs(x) < 14.0
    fraction, exact, paraxial = (
        tilted_beam(x[seen], 12.0, tilt, root) for root in (pade_root, exact_root, paraxial_root)
    )
    size = np.linalg.norm(exact)
    assert np.linalg.norm(found[seen] - fraction) / size < 0.01
    error = np.linalg.norm(found[seen] - exact) / size
    assert error < bound
    assert 10 * error < np.linalg.norm(paraxial - exact) / size or angle_deg < 10.0


@pytest.mark.parametrize("step", [0.08, 0.05])
def test_the_memory_is_estimated_above_the_factors_and_not_far(step: float) -> None:
    across, along = (axis(-1.0, end, step_um=step, absorber_um=1.0) for end in (2.0, 9.0))
    matrix = helmholtz_matrix(across, along, np.full((along.cells, across.cells), K**2))
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    held = 20.0 * (factors.L.nnz + factors.U.nnz)  # a complex number and the number of its row
    assert 0.5 < held / memory_bytes(matrix.shape[0], 0) < 1.0


K0 = 2 * np.pi / 0.55


def flat_section(name: str, step: float) -> tuple[Axis, SectionModes]:
    across = axis(-2.0, 12.0, step_um=step, absorber_um=2.0)
    squared = K0**2 * permittivity(thin_guide(name), Dent(), across.nodes_um, np.array([0.0, 1.0]))
    return across, section_modes(across, squared[0], faded_um=2.0)


@pytest.mark.parametrize(("name", "bound"), [("dissertation", 1e-4), ("realistic", 1e-3)])
def test_indices_converge_to_those_of_the_slab(name: str, bound: float) -> None:
    """At second order, though no interface but the outer ones need lie on a node."""
    guide = thin_guide(name)
    exact = guided_modes(guide.index, guide.thickness_um, wavelength_um=0.55).n_eff
    errors = []
    for step in (0.09, 0.045):
        _, found = flat_section(name, step)
        assert found.guided == len(exact)
        errors.append(np.abs(found.effective_index(0.55) - exact)[:12].max())
    assert errors[1] < bound
    assert errors[0] / errors[1] > 3.0


def test_profiles_are_those_of_the_slab() -> None:
    guide = thin_guide("dissertation")
    across, found = flat_section("dissertation", 0.05)
    exact = guided_modes(guide.index, guide.thickness_um, wavelength_um=0.55)
    inner = across.inner
    for mode in (0, 4, 11):
        shape = exact.profile(mode, across.nodes_um[inner])
        likeness = (
            found.profile[inner, mode] @ shape / np.linalg.norm(found.profile[inner, mode]) / np.linalg.norm(shape)
        )
        assert abs(likeness) > 0.9999


def test_guided_modes_are_orthonormal_and_all_modes_make_up_any_field() -> None:
    across, found = flat_section("dissertation", 0.1)
    guided = found.profile[:, : found.guided]
    np.testing.assert_allclose(guided.T @ times(found.mass, guided), np.eye(found.guided), atol=1e-9)
    field = np.exp(-((across.nodes_um - 4.0) ** 2) + 3j * across.nodes_um)[:, np.newaxis]
    np.testing.assert_allclose(found.profile @ found.amplitudes(field), field, atol=1e-6)


def test_all_but_guided_modes_fade() -> None:
    _, found = flat_section("dissertation", 0.1)
    onward = np.abs(found.onward(0.1))
    assert onward[: found.guided].min() > 1 - 1e-6
    assert onward[found.guided :].max() < 1 - 1e-5


def test_modes_near_cut_off_are_named() -> None:
    """They reach the absorber, 3.6 wavelengths from the guide, with more than exp(-8)."""
    result = propagate(thin_guide("dissertation"), modes=21)
    exact = guided_modes(result.guide.index, result.guide.thickness_um, wavelength_um=0.55).n_eff
    reach = np.exp(-K0 * np.sqrt(exact**2 - 1) * 3.6 * 0.55)
    np.testing.assert_array_equal(result.clear, reach < np.exp(-8))
    assert np.count_nonzero(result.clear) == 16


SMALL = ThinGuide(index=np.array([1.3, 1.2, 1.25]), thickness_um=np.array([1.0, 0.8, 0.4]))
COARSE: dict[str, Any] = {"method": "fdfd", "step_um": 0.1}
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


def test_the_memory_limit_lies_between_one_and_four_fields() -> None:
    occupied = propagate(GUIDE, length_um=80.0).field.nbytes / 2**30
    propagate(GUIDE, length_um=80.0, memory_gib=4 * occupied)
    with pytest.raises(InputError, match=r"must fit in .* choose a larger step_um or memory_gib"):
        propagate(GUIDE, length_um=80.0, memory_gib=occupied)


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

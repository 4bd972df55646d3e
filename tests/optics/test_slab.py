"""Guided modes: effective indices against 60-digit values, closed forms and a plain solver; fields."""

from __future__ import annotations

import cmath
import json
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from tests.interpreted import assert_interpreted_alike

from tsis.errors import InputError
from tsis.optics import guided_modes, slab
from tsis.optics.propagation import thin_guide
from tsis.optics.slab import (
    EPSILON,
    _decay_length_um,
    effective_indices,
    mode_roots,
    modes_above,
    propagate_layer,
    thickness_factor,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.optics import GuidedModes


Polarization = Literal["TE", "TM"]
POLARIZATIONS: tuple[Polarization, ...] = ("TE", "TM")
CASES = ("thin dissertation", "thin PDMS on glass", "symmetric slab", "coupled wells", "millimetre guide")
STACKS = st.lists(st.tuples(st.floats(1.0, 2.0), st.floats(0.01, 3.0)), min_size=1, max_size=8).filter(
    lambda layers: max(n for n, _ in layers) > 1.05
)


@pytest.mark.parametrize("polarization", POLARIZATIONS)
@pytest.mark.parametrize("name", CASES)
def test_sixty_digit_values(shared_data: Path, name: str, polarization: Polarization) -> None:
    cases = {case["name"]: case for case in json.loads((shared_data / "oracle" / "slab_modes.json").read_text())}
    case = cases[name]
    exact = case["modes"][polarization]
    found = guided_modes(
        case["index"],
        case["thickness_um"],
        wavelength_um=case["wavelength_um"],
        index_below=case["index_below"],
        index_above=case["index_above"],
        polarization=polarization,
    ).n_eff
    assert len(found) == exact["count"]
    for number, value in exact["n_eff"].items():
        assert abs(found[int(number)] - value) <= 1e-14


def negative_eigenvalues(
    index: np.ndarray[Any, Any], thickness_um: np.ndarray[Any, Any], outside: tuple[float, float], tm: bool, wave: float
) -> int:
    """How many modes guide, by linear finite elements of about ``wave`` radians: never more than there are.

    Modes above N are the negative directions of ``int (u'**2 + (N**2 - n**2) u**2) / p`` plus what decays outside;
    here N is at cut-off. The matrix is tridiagonal, and its negative pivots count them (Sylvester).
    """
    cut_off, k0 = max(outside), 2 * np.pi / 0.55
    diagonal, beside = [0.0], []
    for n, thickness in zip(index, thickness_um, strict=True):
        pieces = max(4, int(np.ceil(k0 * thickness * np.sqrt(abs(n**2 - cut_off**2)) / wave)))
        p, h = n**2 if tm else 1.0, k0 * thickness / pieces
        stiff, mass = 1 / (h * p), (cut_off**2 - n**2) * h / (6 * p)
        diagonal[-1] += stiff + 2 * mass
        diagonal += [2 * (stiff + 2 * mass)] * (pieces - 1) + [stiff + 2 * mass]
        beside += [mass - stiff] * pieces
    for end, n in ((0, outside[0]), (-1, outside[1])):
        diagonal[end] += np.sqrt(cut_off**2 - n**2) / (n**2 if tm else 1.0)
    pivot, count = diagonal[0], int(diagonal[0] < 0)
    for d, e in zip(diagonal[1:], beside, strict=True):
        pivot = d - e * e / pivot
        count += pivot < 0
    return count


@pytest.mark.parametrize("stacks", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_none_is_missed_in_many_random_stacks(stacks: int) -> None:
    modes = 0
    for seed in range(stacks):
        rng = np.random.default_rng(seed)
        layers = 1 + seed % 8
        index, thickness = rng.uniform(1.0, 1.9, layers), 10 ** rng.uniform(-2, 0.6, layers)
        outside = (1.0, 1.0) if rng.random() < 0.5 else tuple(rng.uniform(1.0, 1.4, 2).tolist())
        if index.max() <= max(outside):
            index[0] = max(outside) + 0.1
        for polarization in POLARIZATIONS:
            found = guided_modes(
                index,
                thickness,
                wavelength_um=0.55,
                index_below=outside[0],
                index_above=outside[1],
                polarization=polarization,
            )
            count = negative_eigenvalues(index, thickness, outside, polarization == "TM", 0.005)
            if count < len(found):  # a mode so near to cut-off that the elements miss it
                count = negative_eigenvalues(index, thickness, outside, polarization == "TM", 0.0005)
            assert len(found) == count, (seed, polarization)
            inside = (found.n_eff > max(outside)) & (found.n_eff < index.max())
            assert inside.all()
            assert (np.diff(found.n_eff) <= 0).all()
            modes += len(found)
    assert modes > 10 * stacks


@settings(max_examples=60)
@given(layers=STACKS, polarization=st.sampled_from(POLARIZATIONS))
def test_the_plain_solver_agrees(layers: list[tuple[float, float]], polarization: Polarization) -> None:
    index, thickness = zip(*layers, strict=True)
    found = guided_modes(index, thickness, wavelength_um=0.55, polarization=polarization).n_eff
    plain = effective_indices(index, thickness, wavelength_um=0.55, polarization=polarization)
    above = np.array(plain) > 1 + 1e-13  # nearer to cut-off the plain way may lose a mode to rounding
    np.testing.assert_allclose(found[: int(above.sum())], np.array(plain)[above], rtol=0, atol=2e-14)
    assert (found[int(above.sum()) :] <= 1 + 2e-13).all()


@pytest.mark.parametrize("polarization", POLARIZATIONS)
def test_one_layer_obeys_its_dispersion_relation(polarization: Polarization) -> None:
    n, below, above, thickness = 1.5, 1.0, 1.33, 3.0
    found = guided_modes(
        [n], [thickness], wavelength_um=0.55, index_below=below, index_above=above, polarization=polarization
    ).n_eff

    def lacking(n_eff: float, mode: int) -> float:
        across = np.sqrt(n**2 - n_eff**2)
        outside = [
            np.arctan((1.0 if polarization == "TE" else (n / m) ** 2) * np.sqrt(max(n_eff**2 - m**2, 0)) / across)
            for m in (below, above)
        ]
        return float(2 * np.pi / 0.55 * thickness * across - mode * np.pi - sum(outside))

    exact: list[float] = []
    while lacking(above, len(exact)) > 0:
        exact.append(brentq(lacking, above, n - 1e-15, args=(len(exact),), xtol=1e-16, rtol=1e-15))
    assert len(found) == len(exact) >= 5
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-14)


def test_a_film_of_almost_no_thickness_guides_one_mode() -> None:
    found = guided_modes([1.5], [1e-4], wavelength_um=20.0)
    decay = np.pi / 20.0 * 1e-4 * (1.5**2 - 1)  # of a delta-shaped well: k0 d (n**2 - 1) / 2
    assert len(found) == 1
    assert float(found.offset[0]) == pytest.approx(decay**2, rel=1e-6)


@settings(max_examples=40)
@given(layers=STACKS, factor=st.floats(0.3, 3.0), polarization=st.sampled_from(POLARIZATIONS))
def test_only_lengths_over_the_wavelength_count(
    layers: list[tuple[float, float]], factor: float, polarization: Polarization
) -> None:
    index, thickness = (np.array(part) for part in zip(*layers, strict=True))
    one = guided_modes(index, thickness, wavelength_um=0.55, polarization=polarization).n_eff
    other = guided_modes(index, factor * thickness, wavelength_um=factor * 0.55, polarization=polarization).n_eff
    sure = min(len(one), len(other))
    assert abs(len(one) - len(other)) <= 1, "a mode at cut-off may go either way with the last digit"
    np.testing.assert_allclose(one[:sure], other[:sure], rtol=0, atol=1e-14)


@settings(max_examples=40)
@given(layers=STACKS, below=st.floats(1.0, 1.04), polarization=st.sampled_from(POLARIZATIONS))
def test_upside_down_it_guides_the_same(
    layers: list[tuple[float, float]], below: float, polarization: Polarization
) -> None:
    index, thickness = zip(*layers, strict=True)
    one = guided_modes(index, thickness, wavelength_um=0.55, index_below=below, polarization=polarization).n_eff
    other = guided_modes(
        index[::-1], thickness[::-1], wavelength_um=0.55, index_above=below, polarization=polarization
    ).n_eff
    sure = min(len(one), len(other))
    assert abs(len(one) - len(other)) <= 1
    np.testing.assert_allclose(one[:sure], other[:sure], rtol=0, atol=1e-14)


@settings(max_examples=40)
@given(layers=STACKS, factor=st.floats(1.001, 2.0))
def test_a_thicker_stack_guides_more_and_slower(layers: list[tuple[float, float]], factor: float) -> None:
    index, thickness = (np.array(part) for part in zip(*layers, strict=True))
    thin = guided_modes(index, thickness, wavelength_um=0.55).n_eff
    thick = guided_modes(index, factor * thickness, wavelength_um=0.55).n_eff
    assert len(thick) >= len(thin)
    assert (thick[: len(thin)] >= thin - 1e-14).all()


def test_a_layer_cut_in_pieces_is_one_layer() -> None:
    whole = guided_modes([1.41, 1.515], [9.0, 1.0], wavelength_um=0.55).n_eff
    np.testing.assert_allclose(
        guided_modes([1.41, 1.41, 1.41, 1.515], [2.0, 3.0, 4.0, 1.0], wavelength_um=0.55).n_eff, whole, atol=1e-15
    )


@pytest.mark.parametrize("polarization", POLARIZATIONS)
@pytest.mark.parametrize("gap", [3.0, 30.0, 3000.0])
def test_far_twins_guide_twice_what_one_well_guides(gap: float, polarization: Polarization) -> None:
    twins = guided_modes([1.5, 1.0, 1.5], [2.0, gap, 2.0], wavelength_um=0.55, polarization=polarization).n_eff
    alone = guided_modes([1.5], [2.0], wavelength_um=0.55, polarization=polarization).n_eff
    assert len(twins) == 2 * len(alone)
    assert (twins[0:4:2] - twins[1:4:2] < 1e-13).all()
    np.testing.assert_allclose(twins[0:4:2], alone[:2], rtol=0, atol=1e-14)
    np.testing.assert_allclose(twins[1:4:2], alone[:2], rtol=0, atol=1e-14)


def test_as_printed_no_mode_comes_out_and_corrected_all_do() -> None:
    guide = thin_guide("dissertation")
    found = guided_modes(guide.index, guide.thickness_um, wavelength_um=0.55).n_eff
    k0, faces = 2 * np.pi / 0.55, np.cumsum(guide.thickness_um)

    def mismatch(n_eff: float, *, printed: bool) -> float:
        """How far boundary 3 is from being met by (3.45)-(3.54), complex where a layer does not oscillate."""
        k1, k2, k3, k4 = (k0 * cmath.sqrt(n**2 - n_eff**2) for n in guide.index)
        outside = k0 * cmath.sqrt(n_eff**2 - 1)
        a1, a2, a3, a4 = faces
        phi1 = -cmath.atan(outside / k1)
        phi2 = cmath.atan(k1 / k2 * cmath.tan(k1 * a1 + phi1)) - k2 * (a2 if printed else a1)
        phi4 = cmath.atan(outside / k4) - k4 * a4
        phi3 = cmath.atan(k4 / k3 * cmath.tan(k4 * a3 + phi4)) - k3 * a3
        left, right = k2 * cmath.tan(k2 * a2 + phi2), k3 * cmath.tan(k3 * a2 + phi3)
        return abs(left - right) / (abs(left) + abs(right))

    assert len(found) == 21
    assert sum(mismatch(n, printed=False) < 1e-9 for n in found) == 21
    assert sum(mismatch(n, printed=True) < 1e-3 for n in found) == 0


def test_below_cut_off_nothing_is_guided() -> None:
    thin = guided_modes([1.5], [0.02], wavelength_um=0.55, index_below=1.4)
    assert len(thin) == 0
    phase = np.arctan(np.sqrt((1.4**2 - 1) / (1.5**2 - 1.4**2)))
    exact = phase / (2 * np.pi / 0.55 * np.sqrt(1.5**2 - 1.4**2)) / 0.02
    assert thickness_factor(thin.layers) == pytest.approx(exact, rel=2e-6)
    with pytest.raises(InputError, match="the stack guides none"):
        thin.profile(0, 0.0)


def test_glass_alone_guides_the_highest_indices() -> None:
    guide = thin_guide("realistic")
    found = guided_modes(guide.index, guide.thickness_um, wavelength_um=0.55)
    glass_on_pdms = guided_modes([1.515], [1.0], wavelength_um=0.55, index_below=1.41)
    assert found.above(1.41) == len(glass_on_pdms) > 0
    np.testing.assert_allclose(found.n_eff[: len(glass_on_pdms)], glass_on_pdms.n_eff, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"index_above": 1.41}, "exceed the surroundings' 1.41"),
        ({"index": [1.41 + 0.01j]}, "real"),
        ({"index": [-1.41]}, r"index\[0\]"),
        ({"index": [np.nan]}, "finite"),
        ({"thickness_um": [0.0]}, r"thickness_um\[0\]"),
        ({"thickness_um": [1.0, 2.0]}, "one length"),
        ({"wavelength_um": 550.0}, "nanometres"),
        ({"wavelength_um": 5.5e-7}, "metres"),
        ({"polarization": "te"}, "polarization"),
        ({"index": [5.0], "thickness_um": [1e6], "wavelength_um": 0.1}, "5,000,000 modes"),
    ],
)
def test_bad_input_is_one_sentence(change: dict[str, Any], message: str) -> None:
    good: dict[str, Any] = {"index": [1.41], "thickness_um": [10.0], "wavelength_um": 0.55}
    with pytest.raises(InputError, match=message):
        guided_modes(**{**good, **change})


def test_as_many_modes_as_the_limit_are_given(monkeypatch: pytest.MonkeyPatch) -> None:
    call: dict[str, Any] = {"index": [1.16, 1.15, 1.14, 1.13], "thickness_um": [2.0, 3.0, 4.0, 1.0]}
    monkeypatch.setattr(slab, "MOST_MODES", 21)
    assert len(guided_modes(**call, wavelength_um=0.55)) == 21
    monkeypatch.setattr(slab, "MOST_MODES", 20)
    with pytest.raises(InputError, match="at most 20 modes"):
        guided_modes(**call, wavelength_um=0.55)


BOTH = pytest.mark.parametrize("polarization", ["TE", "TM"])
FIELD_STACKS = [
    ([1.16, 1.15, 1.14, 1.13], [2.0, 3.0, 4.0, 1.0], 1.0),
    ([1.41, 1.41, 1.41, 1.515], [2.0, 3.0, 4.0, 1.0], 1.0),
    ([1.5], [0.05], 1.0),
    ([1.41, 1.5, 1.0], [0.01, 0.7, 0.02], 1.4),
    ([1.5, 1.0, 1.5], [2.0, 1.0, 2.0], 1.0),
    ([1.5, 1.0, 1.5], [2.0, 2.5, 2.0], 1.0),  # twins 1e-16 to 1e-4 apart
    ([1.5, 1.0, 1.5], [2.0, 25.0, 2.0], 1.0),  # twins that nothing but their place tells apart
    ([1.5, 1.0, 1.5, 1.0, 1.5, 1.0, 1.5], [2.0, 2.6, 2.0, 2.6, 2.0, 2.6, 2.0], 1.2),
    ([1.5, 1.0, 1.5, 1.3, 1.0, 1.5], [2.0, 3.0, 2.0000001, 0.2, 2.5, 2.0], 1.0),
]


def nodes(modes: GuidedModes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Heights and weights of Gauss's rule on short panels in the layers and on growing ones outside."""
    x, w = np.polynomial.legendre.leggauss(20)
    faces, wavelength = modes.layers.faces_um, modes.layers.wavelength_um
    tail = 0.2 * wavelength * 1.6 ** np.arange(50)
    inside = [np.linspace(a, b, 2 + int(5 * (b - a) / wavelength)) for a, b in pairwise(faces)]
    edges = np.unique(np.concatenate([faces[0] - tail, *inside, faces[-1] + tail]))
    half = np.diff(edges) / 2
    return (edges[:-1, None] + half[:, None] * (1 + x)).ravel(), (half[:, None] * w).ravel()


def power(modes: GuidedModes) -> NDArray[np.float64]:
    x, w = nodes(modes)
    e = np.array([modes.profile(mode, x) for mode in range(len(modes))])
    h = np.array([modes.magnetic(mode, x) for mode in range(len(modes))])
    return np.asarray((e * w) @ h.T)


@pytest.mark.parametrize(("phase", "polarization"), [(0.4, "TE"), (1.2, "TM"), (9.0, "TM")])
def test_a_slope_changes_a_field_by_no_more_than_its_length(phase: float, polarization: Polarization) -> None:
    """``u = v p sin(k x) / k`` for a unit ``v``, at most over the layer: at its end, or where the sine is one."""
    layers = guided_modes([1.5, 1.4], [1.0, 2.0], wavelength_um=0.55, polarization=polarization).layers
    scaled = float(layers.thickness_um[1] * layers.per_um)
    k = phase / scaled
    largest = (layers.weight[1] * np.sin(k * np.linspace(0.0, scaled, 20_001)) / k).max()
    found = _decay_length_um(layers, np.full(4, k**2), 1)
    assert largest <= found * (1 + 1e-9)
    assert found < 1.12 * largest


@BOTH
@pytest.mark.parametrize(("index", "thickness", "below"), FIELD_STACKS)
def test_modes_carry_unit_power_and_none_together(
    index: list[float], thickness: list[float], below: float, polarization: Polarization
) -> None:
    modes = guided_modes(index, thickness, wavelength_um=0.55, index_below=below, polarization=polarization)
    assert np.abs(power(modes) - np.eye(len(modes))).max() < 1e-8


@settings(max_examples=15)
@given(
    half=st.lists(st.tuples(st.floats(1.0, 1.6), st.floats(0.01, 4.0)), min_size=1, max_size=4).filter(
        lambda layers: max(n for n, _ in layers) > 1.1
    ),
    gap=st.floats(0.0001, 20.0),
    polarization=st.sampled_from(["TE", "TM"]),
)
def test_mirrored_stacks_have_orthogonal_twins(
    half: list[tuple[float, float]], gap: float, polarization: Polarization
) -> None:
    index, thickness = zip(*half, (1.0, gap), *half[::-1], strict=True)
    modes = guided_modes(index, thickness, wavelength_um=0.55, polarization=polarization)
    sure = modes.n_eff > 1 + 1e-9  # fields of those nearer to cut-off reach beyond this file's quadrature
    error = (power(modes) - np.eye(len(modes)))[np.ix_(sure, sure)]
    assert np.abs(error).max() < 1e-8


@BOTH
def test_twins_of_a_wide_gap_are_fields_of_one_well(polarization: Polarization) -> None:
    twins = guided_modes([1.5, 1.0, 1.5], [2.0, 30.0, 2.0], wavelength_um=0.55, polarization=polarization)
    alone = guided_modes([1.5], [2.0], wavelength_um=0.55, polarization=polarization)
    x = np.linspace(0.01, 1.99, 100)
    both = np.array([[twins.profile(mode, x + shift) for shift in (0.0, 32.0)] for mode in (0, 1)])
    # Any two orthonormal mixtures of the wells' modes will do: their squares add up to one in each well.
    np.testing.assert_allclose((both**2).sum(axis=0), np.array([alone.profile(0, x) ** 2] * 2), atol=1e-9)


@BOTH
@pytest.mark.parametrize(("index", "thickness", "below"), FIELD_STACKS[:5])
def test_fields_obey_their_equations(
    index: list[float], thickness: list[float], below: float, polarization: Polarization
) -> None:
    modes = guided_modes(index, thickness, wavelength_um=0.55, index_below=below, polarization=polarization)
    faces, k0, step = modes.layers.faces_um, 2 * np.pi / 0.55, 1e-4
    middles = np.concatenate([[faces[0] - 0.05], faces[:-1] + 0.37 * np.diff(faces), [faces[-1] + 0.05]])
    n = np.array([below, *index, 1.0])
    p = np.ones_like(n) if polarization == "TE" else n**2
    field = modes.profile if polarization == "TE" else modes.magnetic
    for mode, n_eff in enumerate(modes.n_eff):
        back, here, on = (field(mode, middles + shift) for shift in (-step, 0.0, step))
        along = modes.longitudinal(mode, middles)
        np.testing.assert_allclose((on - back) / (2 * step * k0 * p), along, atol=2e-6)
        np.testing.assert_allclose((on - 2 * here + back) / (step * k0) ** 2, -(n**2 - n_eff**2) * here, atol=2e-6)
        across = modes.magnetic(mode, middles) / n_eff if polarization == "TE" else here * n_eff / p
        np.testing.assert_allclose(modes.profile(mode, middles), across, rtol=1e-12)


@BOTH
@pytest.mark.parametrize(("index", "thickness", "below"), FIELD_STACKS)
def test_fields_are_continuous_between_layers(
    index: list[float], thickness: list[float], below: float, polarization: Polarization
) -> None:
    modes = guided_modes(index, thickness, wavelength_um=0.55, index_below=below, polarization=polarization)
    faces = modes.layers.faces_um
    for mode in range(len(modes)):
        for field in (modes.magnetic, modes.longitudinal):
            under, over = field(mode, faces - 1e-12), field(mode, faces + 1e-12)
            np.testing.assert_allclose(under, over, atol=1e-7)


@BOTH
def test_mode_j_has_j_zeros(polarization: Polarization) -> None:
    modes = guided_modes([1.16, 1.15, 1.14, 1.13], [2.0, 3.0, 4.0, 1.0], wavelength_um=0.55, polarization=polarization)
    x = np.linspace(-2.0, 12.0, 20001)
    zeros = [np.count_nonzero(np.diff(np.sign(modes.profile(mode, x)))) for mode in range(len(modes))]
    assert zeros == list(range(21))


@BOTH
def test_one_layer_has_even_and_odd_modes(polarization: Polarization) -> None:
    modes = guided_modes([1.5], [5.0], wavelength_um=0.55, polarization=polarization)
    x = np.linspace(2.5, 7.0, 300)
    for mode in range(len(modes)):
        parity = (-1) ** mode
        np.testing.assert_allclose(modes.profile(mode, x), parity * modes.profile(mode, 5.0 - x), atol=1e-11)


def test_outside_it_fades_at_the_rate_of_its_index() -> None:
    modes = guided_modes([1.41, 1.515], [9.0, 1.0], wavelength_um=0.55)
    gamma = 2 * np.pi / 0.55 * np.sqrt(modes.n_eff**2 - 1)
    for mode, rate in enumerate(gamma):
        near, far = modes.profile(mode, [10.0, 10.1])
        assert far / near == pytest.approx(np.exp(-0.1 * rate), rel=1e-12)
        assert modes.profile(mode, -1e6) == 0.0


def test_a_glass_mode_is_dark_at_the_face() -> None:
    modes = guided_modes([1.41, 1.515], [9.0, 1.0], wavelength_um=0.55)
    face = np.array([abs(float(modes.profile(mode, 0.0))) for mode in range(len(modes))])
    blind = modes.n_eff > 1.41
    assert blind.sum() == modes.above(1.41) > 0
    assert face[blind].max() < 1e-9
    assert face[~blind].min() > 1e-3


def test_a_thick_guide_has_exact_fields_too() -> None:
    modes = guided_modes([1.41, 1.515], [10_000.0, 1_000.0], wavelength_um=0.55)
    assert len(modes) > 39_000
    x = np.linspace(0.0, 11_000.0, 1_000_001)
    pair = [0, 1, 2, 20_000, 20_001]
    fields = np.array([modes.profile(mode, x) for mode in pair])
    shared = fields @ fields.T * (x[1] - x[0])
    np.testing.assert_allclose(shared * modes.n_eff[pair], np.eye(5), atol=1e-5)


def test_shape_and_refusals() -> None:
    modes = guided_modes([1.5], [1.0], wavelength_um=0.55)
    assert modes.profile(0, np.zeros((2, 3))).shape == (2, 3)
    assert modes.magnetic(np.int64(0), 0.5).shape == ()
    for mode in (-1, len(modes), 0.5):
        with pytest.raises(InputError, match="mode"):
            modes.profile(mode, 0.0)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="finite"):
        modes.profile(0, [0.0, np.nan])


@BOTH
@pytest.mark.parametrize(
    ("index", "thickness", "surroundings"),
    [
        ([1.000000000001], [0.003], (1.0, 1.0)),  # a mode at cut-off to within 1e-29
        ([1.5, 1.33], [10.9, 5665.7], (1.33, 1.33)),  # where it fades through a layer deep enough to underflow
        ([2.5, 1.0, 2.5], [0.65, 8447.0, 0.43], (1.0, 1.4)),
    ],
)
def test_extreme_stacks_have_finite_fields(
    index: list[float], thickness: list[float], surroundings: tuple[float, float], polarization: Polarization
) -> None:
    below, above = surroundings
    modes = guided_modes(
        index, thickness, wavelength_um=1.26, index_below=below, index_above=above, polarization=polarization
    )
    x = np.concatenate([[-1e6], modes.layers.faces_um, [1e7]])
    for mode in range(len(modes)):
        fields = np.array([modes.profile(mode, x), modes.magnetic(mode, x), modes.longitudinal(mode, x)])
        assert np.isfinite(fields).all()
        assert np.abs(fields).max() > 0


STEP = np.array([-1.0, -0.3, 0.0, -0.2, -0.01, -1.0])  # squared indices below that of the core, in layer 2
LENGTH = np.array([0.0, 4.0, 25.0, 8.0, 30.0, 0.0])


@pytest.mark.parametrize("weight", [np.ones(6), 1 / (2.0 + STEP)], ids=["te", "tm"])
def test_roots_equal_those_of_the_interpreter(weight: np.ndarray) -> None:
    low, high = -0.9, -EPSILON
    count = assert_interpreted_alike(modes_above, STEP, weight, LENGTH, low, 2)
    assert count > 10
    assert_interpreted_alike(mode_roots, STEP, weight, LENGTH, low, high, 2, 0, np.empty(count), rtol=1e-12)


@pytest.mark.parametrize("q", [2.0, -0.01, 0.0, -4.0])
@pytest.mark.parametrize("v", [0.3, -2.0])
def test_a_layer_equals_that_of_the_interpreter(q: float, v: float) -> None:
    assert_interpreted_alike(propagate_layer, 1.0, v, 1.0, q, 5.0, rtol=1e-13)

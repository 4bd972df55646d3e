"""Fields of guided modes: their power by a quadrature of this file, their equations, and twins."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.errors import InputError
from tsis.optics import guided_modes
from tsis.optics.slab import _decay_length_um

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.optics import GuidedModes

Polarization = Literal["TE", "TM"]
BOTH = pytest.mark.parametrize("polarization", ["TE", "TM"])
STACKS = [
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
@pytest.mark.parametrize(("index", "thickness", "below"), STACKS)
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
@pytest.mark.parametrize(("index", "thickness", "below"), STACKS[:5])
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
@pytest.mark.parametrize(("index", "thickness", "below"), STACKS)
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

"""The correction by finite strain: its limits, an independent solution, fresh presses, and building it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag

import tsis
from tsis.catalog.priors import inclusion_prior_toml, parse_prior
from tsis.errors import InputError, MechanicsError
from tsis.files.cache import read_cached_arrays
from tsis.inclusion import InclusionPrior
from tsis.inclusion.tissue import prior_on_tissue
from tsis.mechanics.finite_strain.neo_hookean_press import press_finite, press_pairs
from tsis.mechanics.finite_strain.patches import FiniteResolution
from tsis.mechanics.surrogate import correction_building as build
from tsis.mechanics.surrogate.correction_building import build_finite_correction
from tsis.mechanics.surrogate.finite_correction import (
    CorrectionBox,
    CorrectionProcess,
    FiniteCorrection,
    correction_box,
    fit_lengths,
    left_out,
    wide_box,
)
from tsis.mechanics.surrogate.polynomial import Box, signal_scale
from tsis.mechanics.surrogate.states import SlabPresses, design, row_of_field

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

COARSE = FiniteResolution(order=3, rim_mm=0.4, growth=3.0, largest=0.3, ray_layers=2)
NAMES = ("tsis-2011", "tsis-domed")
# Change of the face's displacement in micrometres by a sphere (10, 5 mm; 100 kPa in 5 kPa, 30 mm thick) under the flat
# probe with the same rim, at material radii in mm: another program, trusted to 1.5 %.
INDEPENDENT = {
    0.25: {0: 12.7511, 1: 12.3352, 2: 11.2099, 3: 9.52972, 4: 7.51518, 5: 5.33001, 6: 3.21661},
    0.75: {0: 40.247, 1: 38.9339, 2: 35.4243, 3: 30.1947, 4: 23.9036, 5: 17.1557, 6: 10.637},
}
WITHOUT_UM = {0.25: 41.0049, 0.75: 115.034}  # displacement at the centre without the sphere, to 0.5 %


@pytest.fixture(scope="module", params=NAMES)
def shipped(request: pytest.FixtureRequest) -> FiniteCorrection:
    return build_finite_correction(tsis.load_probe(request.param))


def solver(name: str, *, resolution: FiniteResolution | None = None) -> SlabPresses:
    probe = tsis.load_probe(name)
    return SlabPresses.of(probe, correction_box(probe), 0.49, resolution)


def test_an_independent_solution_under_the_flat_probe() -> None:
    """Small strain and the correction together are the finite-strain signal of another program."""
    correction, both = build_finite_correction(tsis.load_probe("tsis-2011")), solver("tsis-2011")
    factor = float((20 - 1) / (20 + 1.5))
    without, change = both.small(5.0, 30.0, (10.0, 5.0, factor))
    for force, expected in INDEPENDENT.items():
        state = np.array([[5.0, 30.0, force]])
        signal = signal_scale(10.0, 5.0, factor) * both.at_force(change, force)
        sphere = (np.array([10.0]), np.array([5.0]), np.array([20.0]))
        signal = signal + correction.change(*sphere, state, signal[None, None])[0, 0]
        found = np.interp(list(expected), correction.radius_mm, 1e3 * signal[121:])
        np.testing.assert_allclose(found, list(expected.values()), atol=0.03 * expected[0])
        plain = both.at_force(without, force) + correction.without_inclusion(state)[0]
        assert 1e3 * plain[121] == pytest.approx(WITHOUT_UM[force], rel=0.015)


@given(load=st.floats(1e-6, 1e-2), tissue=st.floats(3.5, 7.0), thickness=st.floats(27.0, 36.0))
def test_a_light_flat_press_has_a_correction_in_proportion_to_its_force(
    load: float, tissue: float, thickness: float
) -> None:
    correction = build_finite_correction(tsis.load_probe("tsis-2011"))
    states = np.array([[tissue, thickness, load], [tissue, thickness, 2 * load]])
    plain = correction.without_inclusion(states)
    np.testing.assert_allclose(2 * plain[0], plain[1], rtol=1e-9)
    signal = states[:, 2][:, None, None] * np.linspace(1.0, -0.1, 242)
    change = correction.change(np.array([8.0]), np.array([6.0]), np.array([12.0]), states, signal)
    np.testing.assert_allclose(2 * change[0], change[1], rtol=1e-9)


def test_without_contrast_there_is_no_correction_of_the_signal(shipped: FiniteCorrection) -> None:
    state = np.array([[5.0, 30.0, 0.6]])
    signal = np.array([0.0, 1.0])[None, :, None] * np.linspace(1.0, -0.1, 242)
    change = shipped.change(np.full(2, 8.0), np.full(2, 6.0), np.array([1.0, 12.0]), state, signal)[0]
    assert np.all(change[0] == 0)
    assert np.abs(change[1]).max() > 0.01


def test_states_outside_the_box_are_taken_at_its_ends(shipped: FiniteCorrection) -> None:
    _, most = shipped.forces_n(5.0, 30.0)
    np.testing.assert_array_equal(
        *shipped.without_inclusion(np.array([[5.0, 30.0, most], [5.0, 30.0, 2 * most]])),
    )
    thick = shipped.box.thickness_mm[1]
    at_end, beyond = (shipped.forces_n(5.0, thickness)[1] for thickness in (thick, 1.2 * thick))
    assert at_end == beyond


def test_its_matrices_map_the_outputs(shipped: FiniteCorrection) -> None:
    rng = np.random.default_rng(0)
    one, other = (block_diag(*rng.standard_normal((2, 3, 121))) for _ in range(2))
    signal = rng.standard_normal((2, 2, 242))
    mapped, state = shipped.mapped(one, other), np.array([[5.0, 30.0, 0.7], [4.5, 31.0, 0.6]])
    sphere = (np.array([8.0, 5.0]), np.array([6.0, 5.0]), np.array([12.0, 20.0]))
    np.testing.assert_allclose(mapped.without_inclusion(state), shipped.without_inclusion(state) @ one.T, atol=1e-9)
    changed = shipped.change(*sphere, state, signal) @ other.T
    np.testing.assert_allclose(mapped.change(*sphere, state, signal @ other.T), changed, atol=1e-9)


def test_the_default_prior_lies_inside_the_shipped_boxes(shipped: FiniteCorrection) -> None:
    assert shipped.box.holds(InclusionPrior().box())
    assert not shipped.box.holds(Box(tissue_young_kpa=(10.0, 12.0), young_kpa=(80.0, 200.0)))


@given(
    tissue=st.floats(1.0, 50.0),
    contrast=st.tuples(st.floats(1.6, 6.0), st.floats(7.0, 30.0)),
    thick=st.floats(36.0, 60.0),
)
@pytest.mark.parametrize("name", NAMES)
def test_one_table_holds_the_priors_of_all_tissues(
    name: str, tissue: float, contrast: tuple[float, float], thick: float
) -> None:
    ends = (contrast[0] * tissue, contrast[1] * tissue)
    prior = InclusionPrior(
        depth_mm=(2.0, 20.0), young_kpa=ends, tissue_young_kpa=tissue, thickness_mm=thick, thickness_sd=0.05
    )
    found = correction_box(tsis.load_probe(name), prior.box())
    assert found in (wide_box(tsis.load_probe(name)), correction_box(tsis.load_probe(name)))


@pytest.mark.parametrize("name", NAMES)
def test_the_prior_of_tissue_has_a_table_that_errs_less_than_that_of_all_tissues(name: str) -> None:
    probe = tsis.load_probe(name)
    box = parse_prior(inclusion_prior_toml("breast-ex-vivo"), InclusionPrior).box()
    own, wide = (
        build_finite_correction(probe, box),
        build_finite_correction(probe, prior_on_tissue(InclusionPrior(), 15.0).box()),
    )
    assert own.box.holds(box)
    assert wide.box == wide_box(probe)
    assert own.error_in(box) < wide.error_in(box) / 1.5
    assert own.signal_error[1] < wide.signal_error[1] / 2
    assert own.forces_n(5.0, 30.0)[1] > wide.forces_n(5.0, 30.0)[1]


def test_the_largest_load_falls_from_soft_to_stiff_tissue() -> None:
    box = wide_box(tsis.load_probe("tsis-domed"))
    soft, stiff = box.tissue_young_kpa
    middle = np.sqrt(soft * stiff)
    np.testing.assert_allclose(box.largest_load(np.array([soft, middle, stiff])), [3.0, 2.7, 2.4])
    assert correction_box(tsis.load_probe("tsis-domed")).largest_load(np.array([1.0, 50.0])).tolist() == [3.6, 3.6]


def test_leaving_out_a_point_is_what_it_says() -> None:
    """The closed form against processes through all points but one."""
    rng = np.random.default_rng(2)
    points = rng.uniform(size=(30, 6))
    values = np.column_stack([np.exp(points[:, 0]), points[:, 1] * points[:, 4]])
    lengths, nugget = np.full(6, 0.8), 1e-4
    found = left_out(points, values, lengths, nugget)
    for index in (0, 11, 29):
        others = np.arange(30) != index
        process = CorrectionProcess.through(points[others], values[others], lengths, nugget)
        expected = process(points[index][None, :3], points[index][None, 3:])[0, 0]
        np.testing.assert_allclose(values[index] - expected, found[index], atol=1e-8)


def test_the_error_in_a_box_is_that_of_the_presses_in_and_near_it(shipped: FiniteCorrection) -> None:
    points = shipped.processes[0].points
    light = replace(shipped, left_out=np.where(points[:, 0] < 0.3, 0.01, 0.0))
    small, large = (
        Box(diameter_mm=ends, tissue_young_kpa=(4.0, 6.0), young_kpa=(50.0, 90.0))
        for ends in ((1.0, 1.5), (13.0, 14.0))
    )
    assert 0.005 < light.error_in(small) <= 0.01
    assert light.error_in(large) < 1e-3
    everywhere = replace(shipped, left_out=np.full(len(points), 0.02))
    assert everywhere.error_in(small) == pytest.approx(0.02)


def test_the_design_stays_inside_the_slab_and_the_box() -> None:
    box = CorrectionBox()
    states = design(box, 100, 5)
    assert len(np.unique(states[:, 5])) == 100
    assert np.all(states[:, 0] + states[:, 1] <= 0.97 * states[:, 4] + 1e-9)
    for column, ends in ((0, box.diameter_mm), (1, box.depth_mm), (3, box.tissue_young_kpa), (4, box.thickness_mm)):
        assert ends[0] - 1e-9 <= states[:, column].min()
        assert states[:, column].max() <= ends[1] + 1e-9
    step = np.linalg.norm(np.diff(states[:, 3:5] / [7.4, 37.0], axis=0), axis=1)
    shuffled = np.random.default_rng(0).permutation(states)[:, 3:5] / [7.4, 37.0]
    assert step.mean() < 0.6 * np.linalg.norm(np.diff(shuffled, axis=0), axis=1).mean()


def test_lengths_are_found_again_from_data_that_differ_by_rounding() -> None:
    """A search that ends early on the flat likelihood of smooth data ends elsewhere each time."""
    rng = np.random.default_rng(0)
    points = rng.random((150, 6))
    grown = np.exp(points @ [1.0, 0.5, 0.1, 0.05, 0.05, 1.5])
    waves = np.sin(3 * points[:, 0] + 4 * points[:, 5]) + points[:, 1] ** 2
    values = np.column_stack([grown / grown.std(), waves / waves.std()])
    lengths, _ = fit_lengths(points, values)
    again, _ = fit_lengths(points, values * (1 + 1e-6 * rng.normal(size=values.shape)))
    np.testing.assert_allclose(again, lengths, rtol=0.01)


def test_processes_pass_through_smooth_data() -> None:
    rng = np.random.default_rng(1)
    points, fresh = rng.uniform(size=(120, 6)), rng.uniform(size=(40, 6))

    def values(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.column_stack([np.exp(at[:, 0] * at[:, 5]), np.sin(at[:, 1] + at[:, 3]) + at[:, 4]])

    lengths, nugget = fit_lengths(points, values(points))
    process = CorrectionProcess.through(points, values(points), lengths, nugget)
    found = np.array([process(one[None, :3], one[None, 3:])[0, 0] for one in fresh])
    np.testing.assert_allclose(found, values(fresh), atol=0.02)


@pytest.mark.parametrize(
    ("options", "message"), [({"seed": -1}, "seed"), ({"pairs": 5}, "pairs"), ({"checks": 0}, "checks")]
)
def test_options_out_of_range(options: dict[str, int], message: str) -> None:
    with pytest.raises(InputError, match=message):
        build_finite_correction(tsis.load_probe("tsis-2011"), **options)  # type: ignore[arg-type]


@pytest.mark.slow
def test_an_interrupted_build_continues(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TSIS_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(build, "_Size", partial(build._Size, loads=3))
    # On the coarse mesh tissue wraps around the rim earlier.
    monkeypatch.setattr("tsis.mechanics.surrogate.finite_correction.FLAT_LOADS", (0.1, 0.8, 0.8))
    built = partial(build_finite_correction, tsis.load_probe("tsis-2011"), pairs=24, checks=4, resolution=COARSE)
    steps: list[int] = []

    def stop(done: int, _: int) -> None:
        steps.append(done)
        if done == 36 + 22:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        built(progress=stop)
    (saved,) = (tmp_path / build.KIND).glob("*-pairs")
    stored = read_cached_arrays(build.KIND, saved.name)
    assert stored is not None
    assert len(stored["index"]) == 21
    again = built()
    whole = built(cached=False)
    assert [path.name for path in (tmp_path / build.KIND).iterdir()] == [again.key]
    np.testing.assert_allclose(again.modes, whole.modes, atol=1e-4 * np.abs(whole.modes).max())
    np.testing.assert_array_equal(built().modes, again.modes)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_fresh_presses(name: str) -> None:
    """Presses that the table was not built from, with another sequence than that of its own error."""
    correction, one = build_finite_correction(tsis.load_probe(name)), solver(name)
    pairs = build._pairs(one, design(correction.box, 16, 4711), None, lambda: None)
    median, largest = build._measured(correction, pairs)
    assert median < 0.015
    assert largest < 0.06


def test_a_press_that_does_not_converge_continues_the_polynomial_in_the_load() -> None:
    loads = np.linspace(1.0, 3.0, 8)
    rows = np.stack([loads**5 - loads, 2.0 - loads**3], axis=1)
    gaps = rows.copy()
    gaps[[0, 7]] = np.nan
    np.testing.assert_allclose(build._completed(loads, gaps), rows, atol=1e-9)
    gaps[3] = np.nan
    with pytest.raises(MechanicsError, match="3 of 8"):
        build._completed(loads, gaps)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "force_n", "bound"), [("tsis-2011", 1.0, 0.01), ("tsis-domed", 1.4, 0.003), ("tsis-domed", 2.7, 0.003)]
)
def test_wide_tables_press_even_tissue_as_a_mesh_of_its_own_does(name: str, force_n: float, bound: float) -> None:
    """The mesh of a sphere of 25 mm left the dome's pressure 0.2 to 1 % low, near the rim 2 to 4 %."""
    correction, one = wide_table(name)
    without, _ = one.small(15.0, 30.0, None)
    plain = one.at_force(without, force_n) + correction.without_inclusion(np.array([[15.0, 30.0, force_n]]))[0]
    even = tsis.Phantom(young_kpa=15.0, thickness_mm=30.0)
    solved = row_of_field(press_finite(one.probe, even, force_n=force_n))
    rings = build._ring_means(0.9)
    errors = rings @ (plain - solved[:-1])[:121] / (rings @ solved[:121])
    assert np.abs(errors).max() < bound


@pytest.mark.slow
@pytest.mark.parametrize(("name", "force_n"), [("tsis-2011", 0.8), ("tsis-domed", 1.4), ("tsis-domed", 2.7)])
def test_wide_tables_hold_the_signal_on_a_mesh_of_its_own(name: str, force_n: float) -> None:
    """On the mesh of a sphere of 25 mm the signal of this one erred by 0.9 to 2 % of its peak."""
    correction, one = wide_table(name)
    factor = float((16 - 1) / (16 + 1.5))
    _, change = one.small(15.0, 30.0, (9.0, 6.0, factor))
    signal = signal_scale(9.0, 6.0, factor) * one.at_force(change, force_n)
    sphere, state = (np.array([9.0]), np.array([6.0]), np.array([16.0])), np.array([[15.0, 30.0, force_n]])
    signal = signal + correction.change(*sphere, state, signal[None, None])[0, 0]
    inclusion = tsis.Inclusion(diameter_mm=9.0, depth_mm=6.0, young_kpa=240.0)
    phantom = tsis.Phantom(young_kpa=15.0, thickness_mm=30.0, inclusion=inclusion)
    ((with_it, without),) = press_pairs(one.probe, phantom, forces_n=(force_n,))
    rings = build._ring_means(0.9)
    solved, expected = (rings @ row[:121] for row in (row_of_field(with_it) - row_of_field(without), signal))
    assert np.abs(expected - solved).max() < 0.01 * np.abs(solved).max()


def wide_table(name: str) -> tuple[FiniteCorrection, SlabPresses]:
    """The table that holds tissue of 15 kPa, and presses on its slabs."""
    probe = tsis.load_probe(name)
    correction = build_finite_correction(probe, prior_on_tissue(InclusionPrior(), 15.0).box())
    assert correction.box == wide_box(probe)
    return correction, SlabPresses.of(probe, wide_box(probe), 0.49)

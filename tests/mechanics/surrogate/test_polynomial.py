"""The surrogate: Chebyshev points against numpy's polynomials, states against fresh solves, and its life on disk."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tsis
from tsis.errors import InputError
from tsis.inclusion import InclusionPrior
from tsis.mechanics import press
from tsis.mechanics.mesh import hats, ring_points
from tsis.mechanics.small_strain.linear_press import PressKernel
from tsis.mechanics.small_strain.slab import Resolution
from tsis.mechanics.surrogate import building as surrogate_build
from tsis.mechanics.surrogate import building as surrogate_solves
from tsis.mechanics.surrogate.building import build_surrogate
from tsis.mechanics.surrogate.polynomial import Box, Degrees, chebyshev_points, chebyshev_weights, contrast_factor
from tsis.model.phantom import Inclusion, Phantom

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tsis.mechanics.surrogate.polynomial import PressSurrogate
    from tsis.model.probe import Probe


INTERVAL = (4.0, 12.0)


@pytest.mark.parametrize("count", [1, 2, 3, 7, 11])
def test_points_are_the_roots_of_the_chebyshev_polynomial(count: int) -> None:
    found = chebyshev_points(INTERVAL, count)
    basis = np.polynomial.Chebyshev.basis(count, domain=INTERVAL)
    np.testing.assert_allclose(found, np.sort(np.real(basis.roots())), rtol=1e-9)
    assert INTERVAL[0] < found.min() <= found.max() < INTERVAL[1]


@given(
    coefficients=st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=12),
    x=st.lists(st.floats(*INTERVAL), min_size=1, max_size=20),
)
def test_polynomials_are_reproduced(coefficients: list[float], x: list[float]) -> None:
    given = np.polynomial.Chebyshev(coefficients, domain=INTERVAL)
    matrix = chebyshev_weights(INTERVAL, len(coefficients), np.array(x))
    values = matrix @ given(chebyshev_points(INTERVAL, len(coefficients)))
    np.testing.assert_allclose(values, given(np.array(x)), atol=1e-11 * (1 + np.abs(coefficients).sum()))


def test_agrees_with_numpys_own_interpolation_of_a_smooth_function() -> None:
    x = np.linspace(*INTERVAL, 50)
    peer = np.polynomial.Chebyshev.interpolate(lambda t: np.exp(-t / 3) * np.sin(t), 8, domain=INTERVAL)
    nodes = chebyshev_points(INTERVAL, 9)
    np.testing.assert_allclose(
        chebyshev_weights(INTERVAL, 9, x) @ (np.exp(-nodes / 3) * np.sin(nodes)), peer(x), atol=1e-13
    )


def test_weights_sum_to_one() -> None:
    assert chebyshev_weights(INTERVAL, 6, np.array([3.0, 5.0, 12.0])).sum(axis=1) == pytest.approx(1.0)


PROBE = tsis.load_probe("tsis-2011")
SMALL = Box(
    diameter_mm=(6.0, 10.0),
    depth_mm=(4.0, 8.0),
    young_kpa=(60.0, 120.0),
    tissue_young_kpa=(4.5, 5.5),
    thickness_mm=(29.0, 31.0),
)
FEW = Degrees(diameter=5, depth=4, contrast=2, tissue=2, thickness=2, baseline=3)
TINY = Degrees(diameter=1, depth=1, contrast=1, tissue=1, thickness=1, baseline=1)
COARSE = Resolution(order=3, edge=0.05, growth=2.2, largest=0.3, below_cells=2, ray_layers=3)


@dataclass(frozen=True)
class Errors:
    """Largest errors over fresh presses, inside a share of the face (outside, the edge's singularity hides the rest).

    ``change``: of what the inclusion adds to pressure and displacement, over the press's own peak. ``plain``: of the
    baseline, relative, which differs a little from mesh to mesh as the slab's thickness varies.
    """

    change: float
    plain: float


def errors(surrogate: PressSurrogate, count: int, seed: int, *, probe: Probe = PROBE, share: float = 0.9) -> Errors:
    rng, box = np.random.default_rng(seed), surrogate.pressure_kpa.box
    inside = surrogate.radius_mm <= share * surrogate.radius_mm[-1]
    change, plain = [], []
    for _ in range(count):
        diameter, depth, young, tissue, thickness = (
            rng.uniform(*getattr(box, name))
            for name in ("diameter_mm", "depth_mm", "young_kpa", "tissue_young_kpa", "thickness_mm")
        )
        kernel = PressKernel(probe, thickness_mm=thickness, poisson=box.poisson, points=len(inside))
        slab = kernel.slab(diameter_mm=diameter, depth_mm=depth, poisson=box.poisson)
        bare = kernel.press(tissue, 1000 * surrogate.force_n)
        added = kernel.press(tissue, 1000 * surrogate.force_n, slab.change(young / tissue)) - bare

        inclusion = (np.array([diameter]), np.array([depth]), np.array([young]))
        for part, fresh, signal in (
            (surrogate.pressure_kpa, bare.pressure_kpa, added.pressure_kpa),
            (surrogate.face_displacement_mm, bare.face_displacement_mm, added.face_displacement_mm),
        ):
            fast = part.at_tissue(tissue, thickness)
            off = (fast(*inclusion)[0] - fast.baseline - signal)[inside]
            change.append(np.abs(off).max() / np.abs(signal[inside]).max())
            plain.append(np.abs(fast.baseline[inside] / fresh[inside] - 1).max())
        travel = surrogate.approach_mm.at_tissue(tissue, thickness)(*inclusion)[0, 0]
        plain.append(abs(travel / (bare.approach_mm + added.approach_mm) - 1))
    return Errors(change=float(max(change)), plain=float(max(plain)))


@pytest.fixture(scope="module")
def small() -> PressSurrogate:
    return build_surrogate(PROBE, SMALL, degrees=FEW, cached=False)


def test_error_against_fresh_solves(small: PressSurrogate) -> None:
    found = errors(small, 10, seed=3)
    assert found.change < 1e-3
    assert found.plain < 3e-4


@pytest.mark.slow
def test_error_over_the_default_box() -> None:
    calls: list[tuple[int, int]] = []
    box = InclusionPrior().box()  # what an estimate asks for by default
    surrogate = build_surrogate(PROBE, box, progress=lambda done, total: calls.append((done, total)), cached=False)
    assert 0 < surrogate.error < 1e-3
    total = 3 * 11 * 7
    assert calls == [(done, total) for done in range(1, total + 1)]
    assert total <= 300, "the project wants at most 300 solves"
    found = errors(surrogate, 100, seed=4)
    assert found.change < 1e-3
    assert found.plain < 3e-4


def test_values_at_the_points_are_the_solves_themselves(small: PressSurrogate) -> None:
    """One product over all axes at once, as a sum that anyone can read."""
    part, rng = small.pressure_kpa, np.random.default_rng(0)
    at = part.at_tissue(5.0, 30.0)
    d, h, young = rng.uniform([6.0, 4.0, 60.0], [10.0, 8.0, 120.0], (700, 3)).T
    nd, nh, ng, _ = at.change.shape
    factor = contrast_factor(young / 5.0)
    weights = [
        chebyshev_weights(interval, count, x)
        for interval, count, x in (
            (SMALL.diameter_mm, nd, d),
            (SMALL.depth_mm, nh, h),
            (SMALL.contrast_factor, ng, factor),
        )
    ]
    change = np.einsum("na,nb,nc,abck->nk", *weights, at.change, optimize=True)
    centre = h + d / 2
    expected = at.baseline + (factor * (d / centre) ** 3)[:, None] * change
    np.testing.assert_allclose(at(d, h, young), expected, rtol=1e-10)


def test_a_linear_map_of_the_outputs(small: PressSurrogate) -> None:
    matrix = np.random.default_rng(1).standard_normal((3, len(small.radius_mm)))
    given = np.array([[7.0, 9.0], [5.0, 6.0], [70.0, 100.0]])
    whole = small.pressure_kpa.at_tissue(5.2, 30.4)(*given)
    mapped = small.pressure_kpa.mapped(matrix).at_tissue(5.2, 30.4)(*given)
    np.testing.assert_allclose(mapped, whole @ matrix.T, rtol=1e-9, atol=1e-9)


def test_the_force_is_in_the_pressures(small: PressSurrogate) -> None:
    radius = small.radius_mm
    inclusions = np.array([[7.0, 9.0], [5.0, 6.0], [70.0, 100.0]])
    pressure = small.pressure_kpa.at_tissue(5.0, 30.0)(*inclusions)
    inside, area = ring_points(radius)
    np.testing.assert_allclose(pressure @ (area @ hats(radius, inside)), 1000.0, rtol=1e-9)


@pytest.mark.parametrize(
    ("force", "share"),
    [(0.2, 0.5), pytest.param(0.5, 0.9, marks=pytest.mark.slow), pytest.param(1.0, 0.9, marks=pytest.mark.slow)],
)
def test_a_dome_has_a_surrogate_at_each_force(force: float, share: float) -> None:
    """0.2 N touches on a part of the face, whose edge no polynomial follows; 0.5 N touches on all of it."""
    domed = tsis.load_probe("tsis-domed")
    surrogate = build_surrogate(domed, SMALL, force_n=force, degrees=FEW, cached=False)
    found = errors(surrogate, 6, seed=5, probe=domed, share=share)
    assert surrogate.force_n == force
    assert found.change < 2e-3
    assert (surrogate.error > 0.01) == (force == 0.2), "and it says so"


@pytest.mark.slow
def test_a_box_may_hold_softer_inclusions_too() -> None:
    box = replace(SMALL, young_kpa=(2.0, 8.0), tissue_young_kpa=(4.9, 5.1))
    surrogate = build_surrogate(PROBE, box, degrees=replace(FEW, contrast=5), cached=False)
    assert errors(surrogate, 6, seed=6).plain < 3e-4
    at = surrogate.face_displacement_mm.at_tissue(5.0, 30.0)
    soft, same, stiff = at(np.full(3, 8.0), np.full(3, 5.0), np.array([2.0, 5.0, 8.0]))[:, 0] - at.baseline[0]
    assert soft < same == 0.0 < stiff


def tiny(probe: Probe = PROBE, box: Box = SMALL, **given: Any) -> PressSurrogate:
    return build_surrogate(probe, box, **{"degrees": TINY, "resolution": COARSE, **given})


@pytest.fixture
def stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of an empty cache."""
    monkeypatch.setenv("TSIS_CACHE_DIR", str(tmp_path))
    return tmp_path / "surrogates"


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """One entry a surrogate that was solved and not loaded."""
    seen: list[int] = []
    solve: Callable[..., Any] = surrogate_solves.solve_all

    def counted(*arguments: Any) -> Any:
        seen.append(1)
        return solve(*arguments)

    monkeypatch.setattr(surrogate_build, "solve_all", counted)
    return seen


def same(first: PressSurrogate, second: PressSurrogate) -> bool:
    names = ("pressure_kpa", "face_displacement_mm", "approach_mm")
    return first.key == second.key and all(
        np.array_equal(getattr(getattr(first, name), part), getattr(getattr(second, name), part))
        for name in names
        for part in ("baseline", "change")
    )


def test_it_is_solved_once_and_then_loaded(stored: Path, builds: list[int]) -> None:
    first = tiny()
    assert [path.name for path in stored.iterdir()] == [first.key]
    assert same(tiny(), first)
    assert len(builds) == 1


def test_without_the_cache_nothing_is_read_or_written(stored: Path, builds: list[int]) -> None:
    assert same(tiny(cached=False), tiny(cached=False))
    assert len(builds) == 2
    assert not stored.exists()


@pytest.mark.parametrize("damage", ["flipped", "truncated", "empty", "foreign", "other key"])
def test_a_damaged_file_is_built_anew(stored: Path, builds: list[int], damage: str) -> None:
    first = tiny()
    path = stored / first.key
    data = bytearray(path.read_bytes())
    if damage == "flipped":
        data[len(data) // 2] ^= 1
    elif damage == "truncated":
        del data[-100:]
    elif damage == "empty":
        data.clear()
    elif damage == "foreign":
        data[:] = b"PK\x03\x04 not ours"
    else:
        other = tiny(box=replace(SMALL, poisson=0.3))
        data[:] = (stored / other.key).read_bytes()
    path.write_bytes(data)
    before = len(builds)
    assert same(tiny(), first)
    assert len(builds) == before + 1
    assert same(tiny(), first)
    assert len(builds) == before + 1, "the good file took the place of the bad one"


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    taken = tmp_path / "taken"
    taken.write_text("a file where the folder should be")
    monkeypatch.setenv("TSIS_CACHE_DIR", str(taken))
    assert same(tiny(), tiny())


def test_the_key_follows_the_content_and_not_the_name(stored: Path) -> None:
    first = tiny()
    softer = replace(PROBE, layers=(*PROBE.layers[:2], replace(PROBE.layers[2], young_kpa=30.0)))
    others = [
        tiny(probe=softer),
        tiny(probe=replace(PROBE, radius_mm=11.0)),
        tiny(probe=replace(PROBE, face_curvature_mm=40.0)),
        tiny(probe=replace(PROBE, sides="bonded")),
        tiny(force_n=0.5),
        tiny(box=replace(SMALL, depth_mm=(4.0, 8.5))),
        tiny(box=replace(SMALL, poisson=0.48)),
        tiny(degrees=replace(TINY, depth=2)),
        tiny(resolution=replace(COARSE, order=4)),
    ]
    assert len({first.key, *(other.key for other in others)}) == 10
    assert tiny(probe=replace(PROBE, name="renamed", assumed=())).key == first.key
    assert len(list(stored.iterdir())) == 10


def test_progress_is_told_slab_by_slab() -> None:
    calls: list[tuple[int, int]] = []
    degrees = Degrees(diameter=2, depth=1, contrast=1, tissue=1, thickness=2, baseline=1)
    tiny(degrees=degrees, progress=lambda done, total: calls.append((done, total)), cached=False)
    assert calls == [(1, 4), (2, 4), (3, 4), (4, 4)]


@pytest.mark.parametrize(
    ("changes", "phrase"),
    [
        ({"diameter_mm": (5.0, 5.0)}, r"diameter_mm must be a range \(low, high\) with 0 < low < high"),
        ({"thickness_mm": (31.0, 29.0)}, r"thickness_mm must be a range"),
        ({"tissue_young_kpa": (-1.0, 5.0)}, r"tissue_young_kpa must be a range"),
        ({"poisson": 0.5}, r"poisson must lie in \[0, 0.495\]"),
        ({"depth_mm": (4.0, 20.0)}, r"largest depth_mm \+ diameter_mm must be less than .* = 29; got 30"),
    ],
)
def test_what_a_box_refuses(changes: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        replace(SMALL, **changes)


@pytest.mark.slow
def test_finite_strain_has_a_surrogate_too() -> None:
    """Its own error, and the signal's against a fresh path inside the box."""
    box = Box(
        diameter_mm=(8.0, 12.0),
        depth_mm=(4.0, 7.0),
        young_kpa=(60.0, 120.0),
        tissue_young_kpa=(4.9, 5.1),
        thickness_mm=(29.9, 30.1),
    )
    few = Degrees(diameter=3, depth=3, contrast=2, tissue=1, thickness=1, baseline=2)
    surrogate = build_surrogate(PROBE, box, force_n=0.75, strain="finite", degrees=few, cached=False)
    assert 0 < surrogate.error < 5e-3
    inside, area = ring_points(surrogate.radius_mm)
    pressure = surrogate.pressure_kpa.at_tissue(5.0, 30.0).baseline
    assert pressure @ (area @ hats(surrogate.radius_mm, inside)) == pytest.approx(750.0, rel=2e-3)
    lump = Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
    phantom = Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=lump)
    fresh = press(PROBE, phantom, force_n=0.75, strain="finite").face_displacement_mm[::2]
    bare = press(PROBE, phantom.without_inclusion(), force_n=0.75, strain="finite").face_displacement_mm[::2]
    at = surrogate.face_displacement_mm.at_tissue(5.0, 30.0)
    fast = at(np.array([10.0]), np.array([5.0]), np.array([100.0]))[0] - at.baseline
    assert np.abs(fast - (fresh - bare))[:97].max() < 0.01 * np.abs(fresh - bare).max()


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        ({"strain": "large"}, "strain must be 'small' or 'finite'; got 'large'"),
        ({"strain": "finite"}, "resolution must suit strain 'finite'; got a Resolution"),
        ({"force_n": 0.0}, "force_n must lie in"),
    ],
)
def test_what_a_surrogate_refuses(given: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        tiny(cached=False, **given)

"""Presses of every force from one build, against finer meshes, searched contacts, and the surrogate at one force."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tsis
from tsis.errors import InputError
from tsis.mechanics import press
from tsis.mechanics.mesh import hats, ring_points
from tsis.mechanics.small_strain.linear_press import PressKernel
from tsis.mechanics.small_strain.slab import Resolution, face_of
from tsis.mechanics.surrogate.building import build_surrogate
from tsis.mechanics.surrogate.full_contact import build_full_contact_surrogate
from tsis.mechanics.surrogate.polynomial import Box, Degrees
from tsis.model.phantom import Inclusion, Phantom

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.mechanics.surrogate.full_contact import FullContactParts, FullContactProfiles, FullContactSurrogate
    from tsis.mechanics.surrogate.polynomial import Surrogate
    from tsis.model.probe import Probe

FLAT, DOMED = tsis.load_probe("tsis-2011"), tsis.load_probe("tsis-domed")
BOX = Box(
    diameter_mm=(6.0, 10.0),
    depth_mm=(4.0, 8.0),
    young_kpa=(60.0, 120.0),
    tissue_young_kpa=(4.5, 5.5),
    thickness_mm=(29.0, 31.0),
)
FEW = Degrees(diameter=5, depth=4, contrast=2, tissue=3, thickness=2, baseline=3)
TINY = Degrees(diameter=1, depth=1, contrast=1, tissue=1, thickness=1, baseline=1)
COARSE = Resolution(order=3, edge=0.05, growth=2.2, largest=0.3, below_cells=2, ray_layers=3)
FINER = Resolution(order=6, edge=0.006, growth=1.9, largest=0.17, below_cells=4, ray_layers=6)
INNER = 97  # of 121 radii: 0.8 of the face
MEAN_KPA = 1000 / (np.pi * 12.0**2)  # at 1 N
# diameter, depth, modulus of the inclusion, modulus and thickness of the tissue
SPOTS = [(7.0, 4.5, 70.0, 4.6, 29.3), (9.3, 7.1, 110.0, 5.4, 30.8), (6.2, 5.9, 64.0, 5.0, 30.0)]


@cache
def covered(probe: Probe) -> FullContactSurrogate:
    return build_full_contact_surrogate(probe, BOX, degrees=FEW, cached=False)


def at(surrogate: Surrogate, spot: tuple[float, ...]) -> NDArray[np.float64]:
    diameter, depth, young, tissue, thickness = spot
    there = surrogate.at_tissue(tissue, thickness)
    return np.asarray(there(np.array([diameter]), np.array([depth]), np.array([young]))[0])


def phantom(spot: tuple[float, ...], poisson: float = 0.49) -> Phantom:
    diameter, depth, young, tissue, thickness = spot
    lump = Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young, poisson=poisson)
    return Phantom(young_kpa=tissue, thickness_mm=thickness, poisson=poisson, inclusion=lump)


def press_of(
    parts: FullContactSurrogate | FullContactParts, name: str, spot: tuple[float, ...], force_n: float
) -> NDArray[np.float64]:
    """``shape + force * unit`` of one kind of answer."""
    unit = at(getattr(parts.unit, name), spot)
    return force_n * unit if parts.shape is None else at(getattr(parts.shape, name), spot) + force_n * unit


@pytest.mark.parametrize(
    "probe", [pytest.param(FLAT, id="flat", marks=pytest.mark.slow), pytest.param(DOMED, id="domed")]
)
@pytest.mark.parametrize(
    "force", [pytest.param(0.6, marks=pytest.mark.slow), 1.0, pytest.param(1.6, marks=pytest.mark.slow)]
)
def test_it_presses_as_a_finer_mesh_does(probe: Probe, force: float) -> None:
    for spot in SPOTS:
        fresh = press(probe, phantom(spot), force_n=force, resolution=FINER)
        pressure = press_of(covered(probe), "pressure_kpa", spot, force)
        displaced = press_of(covered(probe), "face_displacement_mm", spot, force)
        travel = press_of(covered(probe), "approach_mm", spot, force)[0]
        # Means around 121 radii against means around 241: they differ by the curvature between the radii.
        np.testing.assert_allclose(pressure[:INNER], fresh.pressure_kpa[::2][:INNER], atol=2e-3 * force * MEAN_KPA)
        peak = np.abs(fresh.face_displacement_mm).max()
        np.testing.assert_allclose(displaced[:INNER], fresh.face_displacement_mm[::2][:INNER], atol=5e-4 * peak)
        assert travel == pytest.approx(fresh.approach_mm, rel=3e-4)


@pytest.mark.slow
def test_a_flat_unit_is_the_surrogate_at_one_newton() -> None:
    at_one = build_surrogate(FLAT, BOX, force_n=1.0, degrees=FEW, cached=False)
    unit = covered(FLAT).unit
    for name in ("pressure_kpa", "face_displacement_mm", "approach_mm"):
        here, there = getattr(unit, name), getattr(at_one, name)
        np.testing.assert_allclose(here.baseline, there.baseline, rtol=1e-9)
        np.testing.assert_allclose(here.change, there.change, rtol=1e-7, atol=1e-9 * np.abs(there.change).max())
    assert covered(FLAT).shape is None
    assert covered(FLAT).covering_force_n is None


def test_the_unit_carries_a_newton_and_the_shape_nothing() -> None:
    surrogate = covered(DOMED)
    assert surrogate.shape is not None
    inside, area = ring_points(surrogate.radius_mm)
    over_face = area @ hats(surrogate.radius_mm, inside)
    for spot in SPOTS:
        assert over_face @ at(surrogate.unit.pressure_kpa, spot) == pytest.approx(1000.0, rel=1e-9)
        shape = at(surrogate.shape.pressure_kpa, spot)
        assert abs(over_face @ shape) < 1e-6 * (over_face @ np.abs(shape))


def test_the_contact_covers_the_face_from_the_covering_force_on() -> None:
    """Against a bisection with the searched contact of the press itself."""
    force = covered(DOMED).covering_force_n
    assert force is not None
    for spot in SPOTS:
        low, high = 0.1, 1.0
        for _ in range(12):
            middle = (low + high) / 2
            low, high = (low, middle) if contact_mm(spot, middle) == DOMED.radius_mm else (middle, high)
        assert at(force, spot)[0] == pytest.approx(high, rel=3e-3)


def contact_mm(spot: tuple[float, ...], force_n: float) -> float:
    """Radius of the contact on a mesh of its own."""
    diameter, depth, young, tissue, thickness = spot
    kernel = kernel_of(thickness)
    slab = kernel.slab(diameter_mm=diameter, depth_mm=depth, poisson=0.49)
    both = kernel.probe_compliance + kernel.tissue_compliance(tissue, slab.change(young / tissue))
    return kernel.contact.touch(both, 1000 * force_n, kernel.split(both, tissue)).radius_mm


@cache
def kernel_of(thickness: float) -> PressKernel:
    return PressKernel(DOMED, thickness_mm=thickness, poisson=0.49)


@pytest.mark.parametrize("probe", [FLAT, DOMED], ids=["flat", "domed"])
@pytest.mark.parametrize("poisson", [pytest.param(0.487, marks=pytest.mark.slow), 0.494])
def test_poissons_ratio_moves_it_along_the_derivative(probe: Probe, poisson: float) -> None:
    for spot in SPOTS:
        moved, still = (press(probe, phantom(spot, ratio), force_n=1.0).pressure_kpa[::2] for ratio in (poisson, 0.49))
        expected = (moved - still)[:INNER]
        found = (poisson - 0.49) * press_of(covered(probe).by_poisson, "pressure_kpa", spot, 1.0)[:INNER]
        assert np.abs(expected).max() > 1e-3 * MEAN_KPA
        np.testing.assert_allclose(found, expected, atol=2e-4 * MEAN_KPA)


def test_the_derivative_is_the_central_difference() -> None:
    step, few = 0.1, Degrees(diameter=2, depth=1, contrast=2, tissue=2, thickness=1, baseline=2)

    def at_ratio(poisson: float) -> FullContactSurrogate:
        box = replace(BOX, poisson=poisson)
        return build_full_contact_surrogate(FLAT, box, degrees=few, resolution=COARSE, poisson_step=step, cached=False)

    low, middle, high = (at_ratio(poisson) for poisson in (0.35, 0.4, 0.45))
    for name in ("pressure_kpa", "face_displacement_mm", "approach_mm"):
        for part in ("baseline", "change"):
            before, after = (getattr(getattr(end.unit, name), part) for end in (low, high))
            found = getattr(getattr(middle.by_poisson.unit, name), part)
            np.testing.assert_allclose(found, (after - before) / step, atol=1e-9 * np.abs(found).max())


@settings(max_examples=5)
@given(factor=st.floats(0.2, 5.0), domed=st.booleans())
def test_only_the_ratios_of_moduli_and_force_matter(factor: float, domed: bool) -> None:
    """All moduli and the force times ``factor``: pressures times it, the same displacements."""
    probe = DOMED if domed else FLAT
    layers = tuple(replace(layer, young_kpa=factor * layer.young_kpa) for layer in probe.layers)
    low, high = BOX.young_kpa, BOX.tissue_young_kpa
    stiffer = replace(
        BOX,
        young_kpa=(factor * low[0], factor * low[1]),
        tissue_young_kpa=(factor * high[0], factor * high[1]),
    )
    small = Degrees(diameter=2, depth=1, contrast=2, tissue=2, thickness=1, baseline=2)
    first, second = (
        build_full_contact_surrogate(one, box, degrees=small, resolution=COARSE, cached=False)
        for one, box in ((probe, BOX), (replace(probe, layers=layers), stiffer))
    )

    def same(
        here: FullContactProfiles | None, there: FullContactProfiles | None, pressure: float, displacement: float
    ) -> None:
        assert (here is None) == (there is None) == (not domed)
        if here is None or there is None:
            return
        scaled(here.pressure_kpa, there.pressure_kpa, pressure)
        scaled(here.face_displacement_mm, there.face_displacement_mm, displacement)
        scaled(here.approach_mm, there.approach_mm, displacement)

    for mine, other in ((first, second), (first.by_poisson, second.by_poisson)):
        same(mine.shape, other.shape, factor, 1.0)
        scaled(mine.unit.pressure_kpa, other.unit.pressure_kpa, 1.0)
        scaled(mine.unit.face_displacement_mm, other.unit.face_displacement_mm, 1 / factor)
    if domed:
        assert first.covering_force_n is not None
        assert second.covering_force_n is not None
        scaled(first.covering_force_n, second.covering_force_n, factor)


def scaled(first: Surrogate, second: Surrogate, factor: float) -> None:
    for name in ("baseline", "change"):
        here, there = getattr(first, name), getattr(second, name)
        np.testing.assert_allclose(there, factor * here, rtol=1e-6, atol=1e-7 * factor * np.abs(here).max())


@pytest.mark.parametrize("probe", [FLAT, DOMED], ids=["flat", "domed"])
def test_the_error_is_what_fresh_solves_meet(probe: Probe) -> None:
    surrogate, rng, worst = covered(probe), np.random.default_rng(8), 0.0
    for _ in range(6):
        spot = tuple(
            float(rng.uniform(*getattr(BOX, name)))
            for name in ("diameter_mm", "depth_mm", "young_kpa", "tissue_young_kpa", "thickness_mm")
        )
        kernel = PressKernel(probe, thickness_mm=spot[4], poisson=0.49, points=len(surrogate.radius_mm))
        change = kernel.slab(diameter_mm=spot[0], depth_mm=spot[1], poisson=0.49).change(spot[2] / spot[3])
        fresh = kernel.press(spot[3], 1000.0, change).pressure_kpa
        off = np.abs(press_of(surrogate, "pressure_kpa", spot, 1.0) - fresh)[:INNER].max()
        worst = max(worst, float(off / MEAN_KPA))
    assert 0 < worst < 5 * surrogate.error
    assert surrogate.error < 3e-4


@pytest.mark.slow
@pytest.mark.parametrize("probe", [FLAT, DOMED], ids=["flat", "domed"])
def test_error_over_the_default_box(probe: Probe) -> None:
    calls: list[tuple[int, int]] = []
    surrogate = build_full_contact_surrogate(probe, progress=lambda *call: calls.append(call), cached=False)
    assert 0 < surrogate.error < 3e-4
    assert calls == [(done, len(calls)) for done in range(1, len(calls) + 1)]
    rng, box, worst = np.random.default_rng(9), Box(), 0.0
    for _ in range(30):
        spot = tuple(
            float(rng.uniform(*getattr(box, name)))
            for name in ("diameter_mm", "depth_mm", "young_kpa", "tissue_young_kpa", "thickness_mm")
        )
        kernel = PressKernel(probe, thickness_mm=spot[4], poisson=0.49, central_mm=2.7, points=121)
        change = kernel.slab(diameter_mm=spot[0], depth_mm=spot[1], poisson=0.49).change(spot[2] / spot[3])
        fresh = kernel.press(spot[3], 1000.0, change).pressure_kpa
        off = np.abs(press_of(surrogate, "pressure_kpa", spot, 1.0) - fresh)[:INNER].max()
        worst = max(worst, float(off / MEAN_KPA))
    assert worst < 3e-4


def test_it_is_kept_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TSIS_CACHE_DIR", str(tmp_path))
    first = build_full_contact_surrogate(DOMED, BOX, degrees=TINY, resolution=COARSE)
    stored = tmp_path / "covered" / first.key
    assert stored.is_file()
    monkeypatch.setattr("tsis.mechanics.surrogate.full_contact.solve_all", None)  # nothing is solved again
    again = build_full_contact_surrogate(DOMED, BOX, degrees=TINY, resolution=COARSE)
    assert again.error == first.error
    assert again.shape is not None
    assert first.shape is not None
    np.testing.assert_array_equal(again.shape.pressure_kpa.change, first.shape.pressure_kpa.change)
    np.testing.assert_array_equal(
        again.by_poisson.unit.approach_mm.baseline, first.by_poisson.unit.approach_mm.baseline
    )


def test_the_key_follows_the_content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TSIS_CACHE_DIR", str(tmp_path))
    keys = {
        build_full_contact_surrogate(probe, box, degrees=TINY, resolution=COARSE, poisson_step=step).key
        for probe in (FLAT, DOMED)
        for box in (BOX, replace(BOX, poisson=0.495))
        for step in (0.004, 0.002)
    }
    assert len(keys) == 8


def test_a_step_that_is_no_step_is_refused() -> None:
    with pytest.raises(InputError, match="poisson_step must lie in"):
        build_full_contact_surrogate(FLAT, BOX, poisson_step=0.0)


def test_faces_of_one_mesh_are_one() -> None:
    """What the half-space and the probe answer is worked out once for all slabs of one build."""
    assert face_of(12.0, Resolution()) is face_of(12.0, Resolution())
    with pytest.raises(ValueError, match="read-only"):
        kernel_of(30.0).probe_compliance[0, 0] = 1.0

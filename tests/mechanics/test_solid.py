"""The press in three dimensions against the axisymmetric one, and against what mirrors and distances demand."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np
import pytest

import tsis
from tsis.mechanics import press
from tsis.mechanics.solid import SolidResolution, press_solid, symmetry_of
from tsis.model.calibration import LightMap
from tsis.model.phantom import Inclusion, Phantom

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.press import PressMap
    from tsis.model.probe import Probe

pytest.importorskip("ngsolve", reason="the extra fem3d is not installed")

PROBE = tsis.load_probe("tsis-2011")
PLAIN = Phantom(young_kpa=5.0, thickness_mm=30.0)
LARGE = Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
SMALL = Inclusion(diameter_mm=5.0, depth_mm=4.0, young_kpa=80.0)
COARSE = SolidResolution(face=0.15, rim=0.15, inclusion=0.5)
ROUGH = SolidResolution(face=0.25, rim=0.25, inclusion=0.6)  # for what holds on any mesh


@cache
def solid(*inclusions: Inclusion, resolution: SolidResolution | None = None, probe: Probe = PROBE) -> PressMap:
    first, *more = inclusions
    phantom = replace(PLAIN, inclusion=first, more_inclusions=tuple(more))
    return press_solid(probe, phantom, force_n=1.0, resolution=resolution, threads=1)


@cache
def plain(probe: Probe = PROBE) -> tsis.PressField:
    return press(probe, PLAIN, force_n=1.0)


def signal(*inclusions: Inclusion, resolution: SolidResolution | None = None) -> NDArray[np.float64]:
    """What the inclusions change about the displacement of the face, on the grid."""
    found = solid(*inclusions, resolution=resolution)
    return found.face_displacement_mm - plain().on_grid(found.x_mm, found.y_mm).face_displacement_mm


def radii(found: PressMap) -> NDArray[np.float64]:
    return np.asarray(np.hypot(found.x_mm[None, :], found.y_mm[:, None]))


def peak_mm(found: PressMap, change: NDArray[np.float64]) -> tuple[float, float]:
    """Where a paraboloid through the 9 x 9 values around the largest one inside 0.8 of the face has its top."""
    row, column = np.unravel_index(np.where(radii(found) < 9.6, change, -np.inf).argmax(), change.shape)
    rows, columns = slice(row - 4, row + 5), slice(column - 4, column + 5)
    x, y = (grid.ravel() for grid in np.meshgrid(found.x_mm[columns], found.y_mm[rows]))
    terms = np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
    _, a, b, c, d, e = np.linalg.lstsq(terms, change[rows, columns].ravel(), rcond=None)[0]
    top = np.linalg.solve([[2 * c, d], [d, 2 * e]], [-a, -b])
    return float(top[0]), float(top[1])


LONG = replace(SMALL, semi_axes_mm=(3.0, 2.0, 2.0))


@pytest.mark.parametrize(
    ("inclusion", "places", "mirrors"),
    [
        (SMALL, [(0.0, 0.0)], "xy"),
        (SMALL, [(3.0, 4.0)], "y"),
        (SMALL, [(3.0, 4.0), (-1.5, -2.0), (0.0, 0.0)], "y"),
        (SMALL, [(3.0, 4.0), (4.0, 3.0)], ""),
        (LONG, [(0.0, 0.0)], "xy"),
        (LONG, [(0.0, 4.0)], "y"),
        (LONG, [(3.0, 4.0)], ""),
    ],
)
def test_a_mirror_leaves_every_inclusion_where_it_is(
    inclusion: Inclusion, places: list[tuple[float, float]], mirrors: str
) -> None:
    found = symmetry_of(tuple(replace(inclusion, offset_mm=place) for place in places))
    assert found.mirrors == mirrors
    assert found.copies == 2 ** len(mirrors)
    along, across = found.rotated(*np.array(places).T)
    mirrored = [-along if "x" in mirrors else along, -across if "y" in mirrors else across]
    np.testing.assert_allclose(mirrored, [along, across], atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("inclusion", [LARGE, SMALL])
def test_on_the_axis_it_is_the_axisymmetric_press(inclusion: Inclusion) -> None:
    expected = press(PROBE, replace(PLAIN, inclusion=inclusion), force_n=1.0)
    found = solid(inclusion)
    around = expected.on_grid(found.x_mm, found.y_mm)
    bare = plain().on_grid(found.x_mm, found.y_mm)
    reference, change = around.face_displacement_mm - bare.face_displacement_mm, signal(inclusion)
    largest, radius = np.abs(reference).max(), radii(found)
    assert np.abs(change - reference)[radius < 9.6].max() < 0.01 * largest
    assert np.abs(change - reference)[radius < 0.95 * 12.0].max() < 0.02 * largest
    inner = radius < 9.6
    step = np.abs(around.pressure_kpa - bare.pressure_kpa)[inner].max()
    assert np.abs(found.pressure_kpa - around.pressure_kpa)[inner].max() < 0.1 * step
    error = (found.pressure_kpa - around.pressure_kpa)[inner]
    assert np.sqrt(np.mean(error**2)) < 0.015 * step
    assert found.approach_mm - plain().approach_mm == pytest.approx(
        expected.approach_mm - plain().approach_mm, rel=0.02
    )


@pytest.mark.slow
def test_the_pressure_sums_up_to_the_force() -> None:
    found = solid(replace(SMALL, offset_mm=(3.0, 0.0)))
    assert found.pressure_kpa.sum() * 0.25**2 == pytest.approx(1000.0, rel=3e-3)
    assert not found.pressure_kpa[radii(found) > 12.3].any()
    assert not found.face_displacement_mm[radii(found) > 12.0].any()


@pytest.mark.slow
def test_the_peak_moves_with_the_inclusion() -> None:
    found = solid(replace(SMALL, offset_mm=(3.0, 0.0)))
    x, y = peak_mm(found, signal(replace(SMALL, offset_mm=(3.0, 0.0))))
    assert x == pytest.approx(3.0, rel=0.03)
    assert y == pytest.approx(0.0, abs=0.03 * 3.0)


@pytest.mark.slow
def test_a_mirrored_offset_mirrors_the_map() -> None:
    right = solid(replace(SMALL, offset_mm=(3.0, 0.0)), resolution=ROUGH)
    left = solid(replace(SMALL, offset_mm=(-3.0, 0.0)), resolution=ROUGH)
    up = solid(replace(SMALL, offset_mm=(0.0, 3.0)), resolution=ROUGH)
    for name in ("face_displacement_mm", "pressure_kpa"):
        values = getattr(right, name)
        scale = 1e-5 * np.abs(values).max()
        np.testing.assert_allclose(getattr(left, name)[:, ::-1], values, atol=scale)
        np.testing.assert_allclose(values[::-1], values, atol=scale)
        np.testing.assert_allclose(getattr(up, name).T, values, atol=scale)


def test_an_ellipsoid_of_equal_axes_is_the_sphere() -> None:
    named = replace(SMALL, diameter_mm=1.0, semi_axes_mm=(2.5, 2.5, 2.5))
    np.testing.assert_allclose(
        solid(named, resolution=ROUGH).pressure_kpa, solid(SMALL, resolution=ROUGH).pressure_kpa, rtol=1e-12
    )


@pytest.mark.slow
def test_an_ellipsoid_is_felt_along_its_long_axis() -> None:
    along_x = replace(LARGE, semi_axes_mm=(6.0, 3.0, 3.0))
    along_y = replace(LARGE, semi_axes_mm=(3.0, 6.0, 3.0))
    change = signal(along_x, resolution=COARSE)
    found = solid(along_x, resolution=COARSE)
    middle, five = len(found.x_mm) // 2, int(np.searchsorted(found.x_mm, 5.0))
    assert change[middle, five] > 1.1 * change[five, middle]
    turned = signal(along_y, resolution=COARSE).T
    inner = radii(found) < 0.95 * 12.0
    assert np.abs(turned - change)[inner].max() < 0.02 * np.abs(change).max()  # another mesh


@pytest.mark.slow
def test_a_spheroid_is_that_of_the_axisymmetric_press() -> None:
    lens = replace(LARGE, depth_mm=5.0, semi_axes_mm=(6.0, 6.0, 3.0))
    expected = press(PROBE, replace(PLAIN, inclusion=lens), force_n=1.0)
    reference = expected.on_grid(solid(lens).x_mm, solid(lens).y_mm).face_displacement_mm
    change = reference - plain().on_grid(solid(lens).x_mm, solid(lens).y_mm).face_displacement_mm
    inner = radii(solid(lens)) < 9.6
    assert np.abs(signal(lens) - change)[inner].max() < 0.02 * np.abs(change).max()


@pytest.mark.slow
def test_two_small_inclusions_far_apart_add_up() -> None:
    tiny = Inclusion(diameter_mm=3.0, depth_mm=4.0, young_kpa=80.0)
    one, other = replace(tiny, offset_mm=(6.0, 0.0)), replace(tiny, offset_mm=(-6.0, 0.0))
    finer = SolidResolution(face=0.12, rim=0.15, inclusion=0.5)
    both = signal(one, other, resolution=finer)
    total = signal(one, resolution=finer) + signal(other, resolution=finer)
    inner = radii(solid(one, resolution=finer)) < 9.6
    assert np.abs(both - total)[inner].max() < 0.05 * np.abs(total[inner]).max()
    assert np.abs(both - both[:, ::-1])[inner].max() < 0.02 * np.abs(both[inner]).max()


def test_an_inclusion_of_the_tissues_own_material_is_not_there() -> None:
    same = replace(SMALL, young_kpa=5.0, offset_mm=(2.0, 1.0))
    assert np.abs(signal(same, resolution=ROUGH)).max() < 1e-8


def test_the_answer_is_linear_in_the_force() -> None:
    phantom = replace(PLAIN, inclusion=SMALL)
    half = press_solid(PROBE, phantom, force_n=0.5, resolution=ROUGH, threads=1)
    whole = solid(SMALL, resolution=ROUGH)
    np.testing.assert_allclose(2 * half.pressure_kpa, whole.pressure_kpa, rtol=1e-12)
    assert 2 * half.approach_mm == pytest.approx(whole.approach_mm)


@pytest.mark.slow
def test_housed_sides_agree_with_the_axisymmetric_press() -> None:
    housed = replace(PROBE, sides="bonded")
    expected = press(housed, replace(PLAIN, inclusion=LARGE), force_n=1.0)
    bare = press(housed, PLAIN, force_n=1.0)
    found = solid(LARGE, probe=housed)
    reference = expected.face_displacement_mm[0] - bare.face_displacement_mm[0]
    middle = len(found.x_mm) // 2
    assert found.face_displacement_mm[middle, middle] - bare.face_displacement_mm[0] == pytest.approx(
        reference, rel=0.02
    )


def test_stages_are_told() -> None:
    result: list[str] = []
    phantom = replace(PLAIN, inclusion=replace(SMALL, young_kpa=77.0))  # that no other test has kept
    press_solid(PROBE, phantom, force_n=0.1, resolution=ROUGH, threads=1, progress=result.append)
    assert [text.split()[0] for text in result] == ["meshing", "factorising", "solving"]


@pytest.mark.slow
def test_the_virtual_probe_sees_where_the_inclusion_lies(monkeypatch: pytest.MonkeyPatch) -> None:
    quick = partial(press_solid, resolution=COARSE, threads=1)
    monkeypatch.setattr("tsis.mechanics.solid.press_solid", quick)
    virtual = tsis.virtual.VirtualProbe(PROBE, rng=np.random.default_rng(1), light=LightMap.uniform(), strain="small")
    phantom = replace(PLAIN, inclusion=replace(SMALL, offset_mm=(3.0, -2.0)))
    grey = virtual.press(phantom, force_n=1.0).grey - virtual.press(PLAIN, force_n=1.0).grey
    x, y = np.meshgrid(*virtual.sensor.axes_mm())
    bright = (np.hypot(x, y) < 8.0) & (grey > 0.6 * np.percentile(grey[np.hypot(x, y) < 8.0], 99.5))
    assert x[bright].mean() == pytest.approx(3.0, abs=0.3)
    assert y[bright].mean() == pytest.approx(-2.0, abs=0.3)


@pytest.mark.slow
def test_any_arrangement_is_pressed_without_a_mirror() -> None:
    """Without a mirror plane the whole is meshed; on the axis it must find what the quarter finds."""
    far = Inclusion(diameter_mm=2.0, depth_mm=20.0, young_kpa=5.0, offset_mm=(10.0, 4.0))  # tissue: it is not there
    also = replace(far, offset_mm=(-3.0, 11.0))
    whole, quarter = signal(SMALL, far, also, resolution=COARSE), signal(SMALL, resolution=COARSE)
    inner = radii(solid(SMALL, resolution=COARSE)) < 9.6
    assert np.abs(whole - quarter)[inner].max() < 0.03 * np.abs(quarter).max()


@pytest.mark.slow
@pytest.mark.parametrize("offset", [1.5, 5.0])
def test_the_peak_moves_with_other_offsets(offset: float) -> None:
    one = replace(SMALL, offset_mm=(offset, 0.0))
    x, _ = peak_mm(solid(one), signal(one))
    assert x == pytest.approx(offset, rel=0.03)

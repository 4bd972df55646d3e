"""Strain of maps whose strain is known: stretches, rotations, shears, and splines that reproduce them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tsis.errors import InputError, UnknownNameError
from tsis.hardness.strain_map import (
    PrintedHardness,
    axial_strain,
    lagrangian_strain,
    printed_axial_strain,
    printed_estimate,
)
from tsis.matching.spline import fit_spline
from tsis.model.image import TactileImage

ANGLES = st.floats(-3.0, 3.0)
STRETCHES = st.floats(0.2, 3.0)


@given(x=STRETCHES, y=STRETCHES, z=STRETCHES)
def test_a_stretch_gives_half_of_the_change_of_its_square(x: float, y: float, z: float) -> None:
    gradient = np.diag([x, y, z])[None]
    expected = (np.array([x, y, z]) ** 2 - 1) / 2
    np.testing.assert_allclose(lagrangian_strain(gradient)[0], np.diag(expected), atol=1e-12)
    np.testing.assert_allclose(axial_strain(gradient), expected[2], atol=1e-12)


@given(a=ANGLES, b=ANGLES, c=ANGLES, z=STRETCHES)
def test_turning_a_body_strains_nothing_and_changes_no_strain(a: float, b: float, c: float, z: float) -> None:
    turn = Rotation.from_rotvec([a, b, c]).as_matrix()
    np.testing.assert_allclose(lagrangian_strain(turn[None]), 0.0, atol=1e-12)
    stretched = np.diag([1.0, 1.0, z])
    np.testing.assert_allclose(
        lagrangian_strain((turn @ stretched)[None]), lagrangian_strain(stretched[None]), atol=1e-11
    )


@given(shear=st.floats(-2.0, 2.0))
def test_simple_shear(shear: float) -> None:
    """``f_x = x + k z``: planes z = constant slide, e_xz = k / 2 and e_zz = k**2 / 2."""
    gradient = np.eye(3)[None].copy()
    gradient[0, 0, 2] = shear
    expected = np.zeros((3, 3))
    expected[0, 2] = expected[2, 0] = shear / 2
    expected[2, 2] = shear**2 / 2
    np.testing.assert_allclose(lagrangian_strain(gradient)[0], expected, atol=1e-12)
    np.testing.assert_allclose(axial_strain(gradient), shear**2 / 2, atol=1e-12)


def test_the_component_is_that_of_the_tensor() -> None:
    gradient = np.random.default_rng(5).normal(size=(50, 3, 3))
    tensor = lagrangian_strain(gradient)
    np.testing.assert_allclose(axial_strain(gradient), tensor[:, 2, 2], atol=1e-12)
    np.testing.assert_allclose(tensor, (np.swapaxes(gradient, 1, 2) @ gradient - np.eye(3)) / 2, atol=1e-12)


def test_the_printed_formula_strains_what_nobody_touched() -> None:
    assert printed_axial_strain(np.eye(3)[None])[0] == 1.5
    assert axial_strain(np.eye(3)[None])[0] == 0.0
    assert printed_axial_strain(np.diag([1.0, 1.0, 0.9])[None])[0] == pytest.approx(0.9 + 0.9**3 / 2)


def test_a_spline_through_a_uniform_compression_knows_its_strain() -> None:
    points = np.random.default_rng(1).normal(size=(60, 3))
    spline = fit_spline(points, points * [1.02, 1.02, 0.9])
    strain = axial_strain(spline.gradient(np.random.default_rng(2).normal(size=(20, 3))))
    np.testing.assert_allclose(strain, (0.9**2 - 1) / 2, atol=1e-8)


def test_a_spline_through_a_bent_body_gives_the_strain_between_its_points() -> None:
    """``f_z = z + 0.1 z**2 / 2`` has ``e_zz = 0.1 z + (0.1 z)**2 / 2``."""
    points = np.random.default_rng(3).uniform(-1, 1, size=(1500, 3))
    targets = points + np.column_stack([np.zeros((1500, 2)), 0.05 * points[:, 2] ** 2])
    inside = np.random.default_rng(4).uniform(-0.5, 0.5, size=(50, 3))
    strain = axial_strain(fit_spline(points, targets, control=points).gradient(inside))
    np.testing.assert_allclose(strain, 0.1 * inside[:, 2] + (0.1 * inside[:, 2]) ** 2 / 2, atol=4e-3)


@pytest.mark.parametrize("gradient", [np.eye(3), np.ones((2, 3, 2)), np.full((1, 3, 3), np.nan)])
def test_what_is_no_gradient_is_refused(gradient: np.ndarray) -> None:
    with pytest.raises(InputError, match="gradient must"):
        axial_strain(gradient)


PIXEL_MM = 0.04
Y_MM, X_MM = PIXEL_MM * np.mgrid[-100:101, -120:121]
FORCES = (0.7, 1.2)


def frame(radius_mm: float, peak: float, force_n: float | None, background: float = 8.0) -> TactileImage:
    """A dome of light over a disc, with little noise."""
    dome = peak * np.sqrt(np.maximum(0.0, 1 - (X_MM**2 + Y_MM**2) / radius_mm**2))
    noise = np.random.default_rng(round(1000 * peak)).normal(0.0, 0.3, dome.shape)
    grey = np.maximum(0.0, background + dome + noise)
    return TactileImage(grey=grey, mm_per_pixel=(PIXEL_MM, PIXEL_MM), force_n=force_n)


def hertzian(young: float) -> list[TactileImage]:
    """Radius as ``(F / E)**(1/3)``, light as the peak pressure ``F / a**2``."""
    radii = [2.0 * (force / 0.7 / young) ** (1 / 3) for force in FORCES]
    return [
        frame(radius, 60.0 * (force / 0.7) / (radius / 2.0) ** 2, force)
        for radius, force in zip(radii, FORCES, strict=True)
    ]


IMAGES = hertzian(1.0)


def found(images: Any = IMAGES, **options: Any) -> PrintedHardness:
    usual: dict[str, Any] = {"method": "cpd", "points": 120}
    return printed_estimate(images, **usual | options)


@cache
def usual() -> PrintedHardness:
    """The estimate with the usual choices, computed once."""
    return found()


def test_the_strain_is_that_of_the_light() -> None:
    """Peaks as the cube root of the force: a stretch by 1.197, ``e_zz = (1.197**2 - 1) / 2 = 0.216``."""
    expected = ((1.2 / 0.7) ** (2 / 3) - 1) / 2
    strains = [found(depth_mm_per_grey=depth).mean_strain for depth in (0.02, 0.04, 0.08)]
    assert np.mean(strains) == pytest.approx(expected, abs=0.05)


def test_by_default_points_are_matched_as_printed() -> None:
    answer = printed_estimate(IMAGES)
    assert answer.registration.method == "tprl"
    assert len(answer.before) == len(answer.after) == 200
    assert 0.05 < answer.mean_strain < 0.5


@pytest.mark.parametrize("young", [0.6, pytest.param(1.7, marks=pytest.mark.slow)])
def test_it_does_not_see_the_modulus(young: float) -> None:
    """Nearly three times the modulus, and the strain is the same within the scatter of the matching."""
    assert found(hertzian(young)).mean_strain == pytest.approx(usual().mean_strain, abs=0.1)


def test_stress_is_force_over_lit_area() -> None:
    answer = usual()
    first, second = (1e3 * f / a for f, a in zip(answer.force_n, answer.area_mm2, strict=True))
    assert answer.area_mm2[1] / answer.area_mm2[0] == pytest.approx((1.2 / 0.7) ** (2 / 3), rel=0.02)
    assert 0.8 * np.pi * 2.0**2 < answer.area_mm2[0] < np.pi * 2.0**2, "a threshold cuts the dim rim off"
    assert answer.force_n == FORCES
    assert answer.stress_kpa == pytest.approx(second)
    assert found(stress="first").stress_kpa == pytest.approx(first)
    assert found(stress="difference").stress_kpa == pytest.approx(second - first)
    assert answer.young_kpa == pytest.approx(answer.stress_kpa / abs(answer.mean_strain))
    assert answer.mean_strain == pytest.approx(float(answer.strain.mean()))


def test_points_lie_on_the_lit_surfaces() -> None:
    answer = found(points=150, depth_mm_per_grey=0.05)
    assert len(answer.before) == len(answer.after) == len(answer.strain) == 150
    for points, image in zip((answer.before, answer.after), IMAGES, strict=True):
        columns = np.round(points[:, 0] / PIXEL_MM + 120).astype(int)
        rows = np.round(points[:, 1] / PIXEL_MM + 100).astype(int)
        np.testing.assert_allclose(points[:, 2], 0.05 * image.grey[rows, columns], atol=1e-9)
    assert not answer.before.flags.writeable


def test_the_background_and_the_order_of_runs_change_nothing() -> None:
    lifted = [replace(image, grey=image.grey + 20.0) for image in IMAGES]
    assert found(lifted).mean_strain == pytest.approx(usual().mean_strain, rel=1e-6)
    assert found().young_kpa == usual().young_kpa


def test_by_default_a_grey_level_is_as_deep_as_a_pixel_is_wide() -> None:
    assert usual().mean_strain == found(depth_mm_per_grey=PIXEL_MM).mean_strain


def test_sign_and_printed_formula() -> None:
    darker = [replace(IMAGES[1], force_n=0.7), replace(IMAGES[0], force_n=1.2)]
    answer = found(darker, signed=True)
    assert answer.mean_strain < 0
    assert answer.young_kpa < 0
    assert found(darker).young_kpa == pytest.approx(-answer.young_kpa)
    assert found(formula="printed").mean_strain > 1.5


def test_a_spline_through_the_matches_is_another_one() -> None:
    through = found(spline="matches")
    assert np.isfinite(through.young_kpa)
    assert through.mean_strain != usual().mean_strain


@pytest.mark.parametrize(
    ("images", "says"),
    [
        (IMAGES[:1], "two frames"),
        ([IMAGES[0], "frame"], "TactileImage"),
        (IMAGES[::-1], "ascending forces"),
        ([replace(IMAGES[0], force_n=None), IMAGES[1]], "ascending forces"),
        ([IMAGES[0], replace(IMAGES[1], mm_per_pixel=(0.05, 0.05))], "share mm_per_pixel"),
        ([replace(image, mm_per_pixel=None) for image in IMAGES], "mm_per_pixel is not known"),
        ([frame(2.0, 0.0, 0.7), IMAGES[1]], "must show a contact"),
    ],
)
def test_frames_that_cannot_be_compared_are_refused(images: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        found(images)


def test_the_same_surface_twice_has_no_strain_to_divide_by() -> None:
    with pytest.raises(InputError, match="differ by some strain"):
        found([IMAGES[0], replace(IMAGES[0], force_n=1.2)], spline="matches")


@pytest.mark.parametrize(
    "choice", [{"stress": "third"}, {"formula": "cubic"}, {"spline": "pairs"}, {"method": "nearest"}]
)
def test_unknown_choices_are_named(choice: dict[str, Any]) -> None:
    with pytest.raises(UnknownNameError):
        found(**choice)


@pytest.mark.parametrize("choice", [{"points": 5}, {"points": 20.5}, {"depth_mm_per_grey": 0.0}])
def test_choices_out_of_range_are_refused(choice: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(choice))):
        found(**choice)

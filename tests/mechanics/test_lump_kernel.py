from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import tsis
from tsis.errors import InputError
from tsis.mechanics import press
from tsis.mechanics.finite_strain.neo_hookean_press import PressSeries
from tsis.mechanics.lump_kernel import LumpKernel, eshelby_factor, finite_strain_kernel, lump_kernel
from tsis.mechanics.surrogate.correction_building import build_finite_correction
from tsis.mechanics.surrogate.finite_correction import wide_box
from tsis.mechanics.tissue_field import FieldMesh, TissueFieldResponse
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from pathlib import Path

PROBE = tsis.load_probe("tsis-2011")
PLAIN = tsis.Phantom(young_kpa=5.0, thickness_mm=30.0)
INNER = 18  # radii of the kernel within 0.7 of the face's radius


@pytest.fixture(scope="module")
def kernel() -> LumpKernel:
    return lump_kernel(PROBE)


def exact_change(
    diameter: float, top: float, contrast: float, radius_mm: np.ndarray, *, plain: tsis.Phantom = PLAIN
) -> np.ndarray:
    lump = tsis.Inclusion(diameter_mm=diameter, depth_mm=top, young_kpa=plain.young_kpa * contrast)
    after, before = press(PROBE, replace(plain, inclusion=lump), force_n=1.0), press(PROBE, plain, force_n=1.0)
    return np.asarray(np.interp(radius_mm, before.radius_mm, after.pressure_kpa - before.pressure_kpa))


@pytest.mark.parametrize(
    ("diameter", "top", "contrast", "error"),
    [(7.0, 5.5, 3.0, 0.015), (9.0, 6.5, 15.0, 0.02), (5.0, 9.0, 8.0, 0.015), (10.0, 4.0, 12.0, 0.03)],
)
def test_the_kernel_is_near_exact_presses_between_those_it_was_fitted_to(
    kernel: LumpKernel, diameter: float, top: float, contrast: float, error: float
) -> None:
    exact = exact_change(diameter, top, contrast, kernel.radius_mm)[:INNER]
    found = kernel.response(distance_mm=0.0, centre_mm=top + diameter / 2, diameter_mm=diameter, contrast=contrast)
    assert np.abs(found[0, :INNER] - exact).max() < error * np.abs(exact).max()


@pytest.mark.parametrize(("corrected", "contrast", "error"), [(False, 1.1, 0.03), (True, 10.0, 0.01)])
def test_a_kernel_made_anew_is_near_exact_presses(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, corrected: bool, contrast: float, error: float
) -> None:
    """Without correction for a weak sphere; with it for a stiff one among those it is fitted to, here eight."""
    monkeypatch.setenv("TSIS_CACHE_DIR", str(tmp_path))
    for name, values in (("DIAMETERS", (6.0, 8.0)), ("TOPS", (5.0, 8.0)), ("CONTRASTS", (4.0, 10.0))):
        monkeypatch.setattr(f"tsis.mechanics.lump_kernel.EXACT_{name}", values)
    plain = replace(PLAIN, young_kpa=6.0)
    kernel = lump_kernel(PROBE, young_kpa=6.0, corrected=corrected, mesh=FieldMesh(points=25))
    exact = exact_change(8.0, 5.0, contrast, kernel.radius_mm, plain=plain)[:INNER]
    found = kernel.response(distance_mm=0.0, centre_mm=9.0, diameter_mm=8.0, contrast=contrast)
    assert np.abs(found[0, :INNER] - exact).max() < error * np.abs(exact).max()


def test_at_finite_strain_the_kernel_is_near_exact_presses(
    kernel: LumpKernel, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Between the forces and spheres that it is fitted to, here eight; a light press feels the rounded rim alone."""
    monkeypatch.setenv("TSIS_CACHE_DIR", str(tmp_path))
    for name, values in (("DIAMETERS", (6.0, 8.0)), ("TOPS", (5.0, 8.0)), ("CONTRASTS", (4.0, 10.0))):
        monkeypatch.setattr(f"tsis.mechanics.lump_kernel.EXACT_{name}", values)
    finite = finite_strain_kernel(kernel, PROBE, build_finite_correction(PROBE, ranges=wide_box(PROBE)), young_kpa=5.0)
    lump = tsis.Inclusion(diameter_mm=7.0, depth_mm=6.5, young_kpa=30.0)
    series = PressSeries(PROBE)
    after, before = (series.press(one, force_n=0.7) for one in (replace(PLAIN, inclusion=lump), PLAIN))
    exact = np.interp(kernel.radius_mm, before.radius_mm, after.pressure_kpa - before.pressure_kpa)[:INNER]

    def found(force_n: float) -> np.ndarray:
        change = finite.response(distance_mm=0.0, centre_mm=10.0, diameter_mm=7.0, contrast=6.0, force_n=force_n)
        return np.asarray(change[0, :INNER])

    bare = replace(kernel, correction=np.zeros_like(finite.correction), force_n=finite.force_n)
    linear = bare.response(distance_mm=0.0, centre_mm=10.0, diameter_mm=7.0, contrast=6.0)[0, :INNER]
    assert np.abs(found(0.7) - exact).max() < 0.03 * exact.max()
    assert np.abs(0.7 * linear - exact).max() > 0.08 * exact.max()
    assert found(0.02) / 0.02 == pytest.approx(found(0.05) / 0.05)
    assert np.abs(found(0.02) / 0.02 - linear).max() < 0.1 * linear.max()


@pytest.mark.parametrize("contrast", [0.5, 3.0, 30.0])
def test_a_small_deep_sphere_follows_eshelby(kernel: LumpKernel, contrast: float) -> None:
    weak, strong = (exact_change(3.0, 11.0, value, kernel.radius_mm)[:INNER] for value in (1.05, contrast))
    ratio = (strong @ weak) / (weak @ weak)
    assert ratio == pytest.approx(float(eshelby_factor(contrast) / eshelby_factor(1.05)), rel=0.02)


def test_the_response_sums_to_the_derivative_by_the_modulus_of_the_whole_tissue(kernel: LumpKernel) -> None:
    slab = TissueFieldResponse(PROBE, young_kpa=5.0, thickness_mm=30.0, poisson=0.49, mesh=FieldMesh(points=25))
    whole = slab.response(0).pressure_kpa[0].sum(axis=1)
    stiffer, softer = (press(PROBE, replace(PLAIN, young_kpa=5.0 * np.exp(h)), force_n=1.0) for h in (0.05, -0.05))
    derivative = np.interp(kernel.radius_mm, stiffer.radius_mm, stiffer.pressure_kpa - softer.pressure_kpa) / 0.1
    assert np.abs(whole[:12] - derivative[:12]).max() < 0.01 * np.abs(derivative).max()


def test_forces_are_kept_at_every_place(kernel: LumpKernel) -> None:
    """A round change at fixed force has no sum over the face."""
    change = kernel.pressure_kpa[0, 0, :, ::10, 10:40:10]
    area = np.gradient(kernel.radius_mm) * kernel.radius_mm
    area[-1] /= 2
    total = np.einsum("r,rnk->nk", area, change)
    size = np.einsum("r,rnk->nk", area, np.abs(change))
    assert np.abs(total[:2]).max() < 0.05 * size[:2].max()


def test_stiffness_of_the_whole_tissue_under_a_rigid_punch_is_that_of_its_modulus() -> None:
    rigid = Probe(radius_mm=5.0, layers=(Layer(thickness_mm=0.2, young_kpa=9e5, poisson=0.3),))
    slab = TissueFieldResponse(rigid, young_kpa=5.0, thickness_mm=30.0, poisson=0.49, mesh=FieldMesh(points=5))
    assert float(slab.stiffness_change().sum()) == pytest.approx(1.0, abs=1e-3)
    # Sneddon's punch on a half-space, 2 a E / (1 - nu^2), is softer than one on a slab of six radii
    assert 1e3 / slab.travel_per_newton() == pytest.approx(1.15 * 2 * 5.0 * 5.0 / (1 - 0.49**2), rel=0.12)


def test_values_outside_their_range_are_refused(kernel: LumpKernel) -> None:
    with pytest.raises(InputError, match="centre_mm"):
        kernel.response(distance_mm=0.0, centre_mm=2.0, diameter_mm=8.0, contrast=10.0)
    with pytest.raises(InputError, match="young_kpa"):
        lump_kernel(PROBE, young_kpa=0.0)

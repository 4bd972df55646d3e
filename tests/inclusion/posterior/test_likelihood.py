"""The likelihood against the dense normal distribution that it stands for."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import tsis
from tsis.imaging.rendering import rough_contact
from tsis.inclusion import InclusionPrior
from tsis.inclusion.frames import ring_edges
from tsis.inclusion.posterior.forward import POISSON, SHARED, SITE, THICKNESS, TISSUE, ForwardModel
from tsis.inclusion.posterior.forward import PROBE as PROBE_STIFFNESS
from tsis.inclusion.posterior.likelihood import InclusionLikelihood, Profiles, noise_covariance
from tsis.inclusion.posterior.rings import (
    RingShading,
    ShadingUncertainty,
    ring_correction,
    ring_correlation,
    ring_means,
    ring_responses,
)
from tsis.mechanics import press
from tsis.mechanics.surrogate.correction_building import build_finite_correction
from tsis.model.calibration import Calibration
from tsis.virtual.probe import FINE_RESOLUTION

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics.surrogate.full_contact import FullContactSurrogate

PROBE = tsis.load_probe("tsis-2011")
ANSWER = Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0)
PRIOR = InclusionPrior()
PHANTOM = tsis.load_phantom("hardness-100")
LEVEL = np.linspace(2.0, 0.5, 20)
SHADING = RingShading(
    growth_per_mm=np.linspace(-0.3, 0.2, 20), bend_per_mm2=np.linspace(0.4, -0.1, 20), flux=np.linspace(0.0, 2.0, 20)
)
ALIKE = ring_correlation(np.linspace(0.0, 9.6, 21), 0.5)
NUISANCES = 16  # seven and three terms of shading, then two of each of three frames
INCLUSIONS = np.array([[10.0, 5.0, 100.0], [3.0, 8.0, 60.0], [14.0, 4.5, 45.0], [1.5, 11.0, 119.0]])


def model_of(surrogate: FullContactSurrogate) -> ForwardModel:
    return ForwardModel(
        rings=ring_responses(surrogate, ring_edges(PROBE), LEVEL, offset_mm=0.5),
        level=LEVEL,
        shading=SHADING,
        calibration=ANSWER,
        prior=PRIOR,
        force_n=np.array([1.0, 0.8, 1.1]),
        is_reference=np.array([False, False, True]),
        correlation=ALIKE,
        spread_sd=0.3,
    )


@pytest.fixture(params=["flat", "domed", "finite"])
def model(request: pytest.FixtureRequest, flat: FullContactSurrogate, domed: FullContactSurrogate) -> ForwardModel:
    """Small strain under both probes, and finite strain under the dome."""
    if request.param != "finite":
        return model_of({"flat": flat, "domed": domed}[request.param])
    correction = build_finite_correction(tsis.load_probe("tsis-domed"))
    return replace(model_of(domed), correction=ring_correction(correction, ring_edges(PROBE), LEVEL, offset_mm=0.5))


@pytest.fixture
def data(model: ForwardModel) -> Profiles:
    """Profiles of the first inclusion with errors, some rings of which cannot be used."""
    rng = np.random.default_rng(5)
    grey = model.profiles(INCLUSIONS[:1], np.zeros(NUISANCES))[0][0]
    usable = np.ones(grey.shape, dtype=bool)
    usable[0, 3] = usable[2, 17:] = False
    return Profiles(
        grey=grey * (1 + 0.01 * rng.standard_normal(grey.shape)),
        variance=rng.uniform(1e-4, 1e-2, grey.shape),
        usable=usable,
    )


def by_hand(data: Profiles, calibration: Calibration) -> NDArray[np.float64]:
    """Covariance entry by entry, in the order of the raveled profiles."""
    frames, rings = data.grey.shape
    matrix = np.zeros((frames * rings, frames * rings))
    for f, r in np.ndindex(frames, rings):
        for g, s in np.ndindex(frames, rings):
            both = data.grey[f, r] * data.grey[g, s] * ALIKE[r, s]
            matrix[f * rings + r, g * rings + s] = calibration.pattern_sd**2 * both
            if f == g:
                matrix[f * rings + r, g * rings + s] += calibration.repeatability_sd**2 * both
            if (f, r) == (g, s):
                matrix[f * rings + r, g * rings + s] += data.variance[f, r]
    return matrix


def test_noise_covariance(data: Profiles) -> None:
    found = noise_covariance(data, ANSWER, ALIKE)
    np.testing.assert_allclose(found, by_hand(data, ANSWER), rtol=1e-12)
    assert np.linalg.eigvalsh(found)[0] > 0


def test_rings_err_alike_as_those_of_drawn_patterns_do() -> None:
    """Against patterns that are linear between drawn values, wherever these lie."""
    rng, grain = np.random.default_rng(1), 0.5
    edges = np.linspace(0.0, 9.6, 21)
    radius = np.linspace(0.0, 9.6, 20 * 48 + 1)
    middle = (radius[1:] + radius[:-1]) / 2
    weight = middle.reshape(20, 48) / middle.reshape(20, 48).sum(axis=1, keepdims=True)
    knots = np.arange(-1.0, 11.0, grain)
    drawn = []
    for _ in range(6000):
        pattern = np.interp(middle, knots + grain * rng.random(), np.sqrt(1.5) * rng.standard_normal(len(knots)))
        drawn.append((weight * pattern.reshape(20, 48)).sum(axis=1))
    np.testing.assert_allclose(ring_correlation(edges, grain), np.cov(np.array(drawn).T), atol=0.05)


@pytest.mark.parametrize("seed", [None, 1])
def test_evidence_is_the_dense_normal_density(model: ForwardModel, data: Profiles, seed: int | None) -> None:
    """Up to a constant, with covariance N + J P J' around the linearised profiles."""
    likelihood = InclusionLikelihood(model, data)
    mean_grey = np.array([row[use].mean() for row, use in zip(data.grey * LEVEL, data.usable, strict=True)])
    sd = model.nuisance_sd(mean_grey)
    at = np.zeros(len(sd)) if seed is None else sd * np.random.default_rng(seed).standard_normal(len(sd))
    found = likelihood(INCLUSIONS, at)
    use = np.flatnonzero(data.usable.ravel())
    noise = by_hand(data, ANSWER)[np.ix_(use, use)]
    expected = []
    for inclusion in INCLUSIONS:
        grey, slopes = model.profiles(inclusion[None], at)
        slope = slopes[0].reshape(-1, len(sd))[use]
        centre = grey.ravel()[use] - slope @ at
        density = multivariate_normal(centre, noise + slope @ np.diag(sd**2) @ slope.T)
        expected.append(density.logpdf(data.grey.ravel()[use]))
    difference = found.log_evidence - np.array(expected)
    assert np.ptp(expected) > 10, "the inclusions must differ for the comparison to say anything"
    np.testing.assert_allclose(difference, difference[0], atol=1e-8 * np.abs(expected).max())
    assert len(use) == 56


def test_best_nuisances_and_misfit_minimise_the_penalised_squares(model: ForwardModel, data: Profiles) -> None:
    likelihood = InclusionLikelihood(model, data)
    sd = model.nuisance_sd(np.array([row[use].mean() for row, use in zip(data.grey * LEVEL, data.usable, strict=True)]))
    fit = likelihood(INCLUSIONS[:1], np.zeros(len(sd)))
    use = np.flatnonzero(data.usable.ravel())
    grey, slopes = model.profiles(INCLUSIONS[:1], np.zeros(len(sd)))
    slope, residual = slopes[0].reshape(-1, len(sd))[use], data.grey.ravel()[use] - grey.ravel()[use]
    precision = np.linalg.inv(by_hand(data, ANSWER)[np.ix_(use, use)])

    def penalised(nuisance: NDArray[np.float64]) -> float:
        left = residual - slope @ nuisance
        return float(left @ precision @ left + ((nuisance / sd) ** 2).sum())

    assert fit.misfit[0] == pytest.approx(penalised(fit.nuisance[0]), rel=1e-9)
    rng = np.random.default_rng(0)
    for _ in range(20):
        assert penalised(fit.nuisance[0] + 0.05 * sd * rng.standard_normal(len(sd))) > fit.misfit[0]


def test_a_nuisance_that_is_known_exactly(model: ForwardModel, data: Profiles) -> None:
    """A standard deviation of zero is the limit of a small one."""
    fits = []
    for sd in (0.0, 1e-7):
        answer = replace(ANSWER, gain_sd=sd, force_sd=sd, offset_sd=sd, site_sd=sd, shading_sd=sd, probe_young_sd=sd)
        fits.append(InclusionLikelihood(replace(model, calibration=answer), data)(INCLUSIONS, np.zeros(NUISANCES)))
    exact, nearly = fits
    np.testing.assert_allclose(exact.misfit, nearly.misfit, rtol=1e-4)
    assert not exact.nuisance[:, [0, 3, 4, *range(7, NUISANCES)]].any()


@pytest.mark.parametrize("place", range(NUISANCES))
def test_slopes_are_derivatives(model: ForwardModel, place: int) -> None:
    at = 0.01 * np.random.default_rng(3).standard_normal(NUISANCES)
    step = np.zeros(NUISANCES)
    step[place] = 1e-3
    low, high = (model.profiles(INCLUSIONS, at + sign * step)[0] for sign in (-1, 1))
    found = model.profiles(INCLUSIONS, at)[1][..., place]
    expected = np.broadcast_to((high - low) / 2e-3, found.shape)
    np.testing.assert_allclose(found, expected, atol=0.02 * np.abs(expected).max())
    assert np.abs(expected).max() > 0.1


def test_errors_of_an_unmeasured_light_change_the_profiles_as_stated(model: ForwardModel) -> None:
    """By the formula, with the press of the model without them; and their slopes are derivatives."""
    rng = np.random.default_rng(4)
    errors = ShadingUncertainty(
        by_displacement=rng.standard_normal((20, 4)),
        by_bend=rng.standard_normal((20, 4)),
        by_slope=rng.standard_normal((20, 4)),
        by_force=np.array([0.1, -0.2, 0.05, 0.0]),
        by_square=np.array([0.0, 0.002, -0.001, 0.003]),
        by_gain=np.array([0.02, 0.0, -0.05, 0.01]),
    )
    whole = replace(model, shading=replace(SHADING, uncertainty=errors))
    model, wide = (replace(each, correction=None) for each in (model, whole))  # the formula is of small strain
    at = np.append(np.zeros(NUISANCES), [0.3, -0.5, 0.2, 0.8])
    drawn = at[NUISANCES:]
    found, without = wide.grey(INCLUSIONS, at), model.grey(INCLUSIONS, at[:NUISANCES])
    for frame, force in enumerate(model.force_n):
        shown = None if model.is_reference[frame] else INCLUSIONS
        pressed = model.rings.under(float(force), model.rings.on(PRIOR.tissue_young_kpa, PRIOR.thickness_mm, shown))
        pressure, displacement, slope = np.split(pressed, 3, axis=-1)
        logarithm = (errors.by_displacement @ drawn) * displacement + (errors.by_slope @ drawn) * slope
        logarithm += (errors.by_bend @ drawn) * displacement**2 + errors.by_gain @ drawn
        logarithm -= errors.by_force @ drawn * force + errors.by_square @ drawn * pressure**2
        expected = without[:, frame] * np.exp(logarithm)
        np.testing.assert_allclose(found[:, frame], expected, rtol=1e-9)
    np.testing.assert_allclose(wide.profiles(INCLUSIONS, at)[0], found, rtol=1e-12)
    slopes = wide.profiles(INCLUSIONS, at)[1], whole.profiles(INCLUSIONS, at)[1]
    for place in range(SHARED, len(at)):
        exact = place >= NUISANCES  # finite strain bends the profiles with the force, which the slopes approximate
        by, slope = (whole, slopes[1]) if exact else (wide, slopes[0])
        step = np.zeros(len(at))
        step[place] = 1e-4
        numeric = (by.grey(INCLUSIONS, at + step) - by.grey(INCLUSIONS, at - step)) / 2e-4
        np.testing.assert_allclose(slope[..., place], numeric, atol=1e-5 * np.abs(numeric).max())


@pytest.mark.parametrize("name", ["tsis-2011", "tsis-domed"])
def test_profiles_are_the_light_of_a_press(name: str, flat: FullContactSurrogate, domed: FullContactSurrogate) -> None:
    """Nuisances and all, against a press on another mesh."""
    probe, edges = tsis.load_probe(name), ring_edges(PROBE)
    model = replace(
        model_of({"tsis-2011": flat, "tsis-domed": domed}[name]),
        rings=ring_responses({"tsis-2011": flat, "tsis-domed": domed}[name], edges, np.ones(20)),
    )
    at = np.zeros(NUISANCES)
    at[[TISSUE, THICKNESS, SITE, PROBE_STIFFNESS, POISSON]] = [0.06, -0.05, 0.03, 0.04, 0.002]
    at[SHARED : SHARED + 3] = [0.02, -0.03, 0.01]
    stiffer = replace(
        probe, layers=tuple(replace(layer, young_kpa=layer.young_kpa * np.exp(0.04)) for layer in probe.layers)
    )
    tissue = replace(
        PHANTOM, young_kpa=5.0 * np.exp(0.06), thickness_mm=30.0 * np.exp(-0.05), poisson=0.492, inclusion=None
    )
    lump = replace(tissue, inclusion=tsis.Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0, poisson=0.492))
    site = replace(tissue, young_kpa=tissue.young_kpa * np.exp(0.03))
    found = model.grey(np.array([[10.0, 5.0, 100.0]]), at)[0]
    for row, slab, force in zip(
        found, (lump, lump, site), model.force_n * np.exp(at[SHARED : SHARED + 3]), strict=True
    ):
        field = press(stiffer, slab, force_n=float(force), resolution=FINE_RESOLUTION)
        grid = np.linspace(0.0, edges[-1], 20 * 24 + 1)
        middle = (grid[1:] + grid[:-1]) / 2

        def mean(values: NDArray[np.float64], middle: NDArray[np.float64] = middle) -> NDArray[np.float64]:
            weight = middle.reshape(20, 24)
            return np.asarray((weight * values.reshape(20, 24)).sum(axis=1) / weight.sum(axis=1))

        pressure = mean(np.interp(middle, field.radius_mm, field.pressure_kpa))
        displacement = mean(np.interp(middle, field.radius_mm, field.face_displacement_mm))
        slope = mean(np.interp(middle, field.radius_mm, np.gradient(field.face_displacement_mm, field.radius_mm)))
        expected = (
            rough_contact(pressure, ANSWER)
            * np.exp((SHADING.growth_per_mm + SHADING.bend_per_mm2 * displacement) * displacement)
            * (1 + np.linspace(0.0, 2.0, 20) * slope)
        )
        np.testing.assert_allclose(row, expected, rtol=3e-3)
        assert np.abs(row / expected - 1).mean() < 1e-3


@pytest.mark.parametrize("seed", [None, 1])
def test_the_fast_likelihood_is_exact_where_it_is_linearised(
    model: ForwardModel, data: Profiles, seed: int | None
) -> None:
    likelihood = InclusionLikelihood(model, data)
    sd = model.nuisance_sd(np.array([row[use].mean() for row, use in zip(data.grey * LEVEL, data.usable, strict=True)]))
    at = (
        np.zeros(len(sd))
        if seed is None
        else likelihood.within(sd * np.random.default_rng(seed).standard_normal(len(sd)))
    )
    relative = 2e-3 if model.correction is None else 5e-3  # its polynomials interpolate the correction
    for inclusion in INCLUSIONS:
        fast = likelihood.near(inclusion, at)(inclusion[None])[0]
        exact = likelihood(inclusion[None], at).log_evidence[0]
        assert fast == pytest.approx(exact, rel=relative, abs=0.2)
    plain = likelihood(None, at).log_evidence[0]
    vanishing = likelihood(np.array([[1.0, 12.0, 40.0]]), at).log_evidence[0]
    assert vanishing == pytest.approx(plain, rel=0.02), "the smallest and deepest is next to nothing"


def test_information_is_the_curvature_of_the_fast_likelihood(model: ForwardModel, data: Profiles) -> None:
    """Without noise in the data, by finite differences of the log evidence with the nuisances' slopes held."""
    at, inclusion = np.zeros(NUISANCES), INCLUSIONS[0]
    exact = replace(data, grey=model.grey(inclusion[None], at)[0])
    likelihood = InclusionLikelihood(model, exact)
    nearby, step = likelihood.near(inclusion, at), np.diag([0.02, 0.01, 1.0])
    fit, found = likelihood.with_information(inclusion, at)
    assert fit.log_evidence[0] == pytest.approx(likelihood(inclusion[None], at).log_evidence[0])
    for i in range(3):
        for j in range(3):
            corners = [nearby((inclusion + a * step[i] + b * step[j])[None])[0] for a in (1, -1) for b in (1, -1)]
            curvature = -(corners[0] - corners[1] - corners[2] + corners[3]) / (4 * step[i, i] * step[j, j])
            scale = np.sqrt(found[i, i] * found[j, j])
            assert found[i, j] == pytest.approx(curvature, abs=(0.02 if model.correction is None else 0.03) * scale)


def test_slopes_of_the_rings_are_those_of_a_press(flat: FullContactSurrogate) -> None:
    field = press(PROBE, PHANTOM, force_n=1.0)
    rings = ring_responses(flat, ring_edges(PROBE), np.ones(20))
    found = rings.on(PHANTOM.young_kpa, PHANTOM.thickness_mm, np.array([[10.0, 5.0, 100.0]]))[0, 40:]
    edges = ring_edges(PROBE)
    rise = np.diff(np.interp(edges, field.radius_mm, field.face_displacement_mm)) / np.diff(edges)
    np.testing.assert_allclose(found[2:], rise[2:], atol=0.02 * np.abs(rise).max())


def test_ring_means_are_means_over_the_rings_area(flat: FullContactSurrogate) -> None:
    matrix = ring_means(flat.radius_mm, np.array([0.0, 3.0, 8.0]))
    # r over a ring: 2 (b**3 - a**3) / (3 (b**2 - a**2)).
    np.testing.assert_allclose(matrix @ flat.radius_mm, [2.0, 2 * (8.0**3 - 3.0**3) / (3 * 55.0)], rtol=1e-9)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, rtol=1e-12)
    # Light that grows as 4 + r between the rings' middles, 1.5 and 5.5 mm, and stays as it is beyond.
    level = np.array([5.5, 9.5])
    r = np.linspace(3.0, 8.0, 200_001)
    weight = r * np.interp(r, [1.5, 5.5], level)
    lit = ring_means(flat.radius_mm, np.array([0.0, 3.0, 8.0]), level) @ flat.radius_mm
    assert lit[1] == pytest.approx((weight * r).sum() / weight.sum(), rel=2e-3)

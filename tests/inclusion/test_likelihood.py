"""The likelihood against the dense normal distribution that it stands for."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import tsis
from tsis import Calibration
from tsis.imaging.render import rough_contact
from tsis.inclusion.forward import ForwardModel
from tsis.inclusion.frames import ring_answers, ring_edges, ring_means
from tsis.inclusion.likelihood import Likelihood, Profiles, noise_covariance
from tsis.inclusion.prior import InclusionPrior
from tsis.inclusion.shading import RingShading
from tsis.mechanics import press

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics import PressSurrogate

PROBE = tsis.load_probe("tsis-2011")
ANSWER = Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0)
PRIOR = InclusionPrior()
PHANTOM = tsis.load_phantom("hardness-100")
LEVEL = np.linspace(2.0, 0.5, 20)
SHADING = RingShading(growth_per_mm=np.linspace(-0.3, 0.2, 20), flux=np.linspace(0.0, 2.0, 20))
INCLUSIONS = np.array([[10.0, 5.0, 100.0], [3.0, 8.0, 60.0], [14.0, 4.5, 45.0], [1.5, 11.0, 119.0]])


@pytest.fixture
def model(surrogate: PressSurrogate) -> ForwardModel:
    return ForwardModel(
        rings=ring_answers(surrogate, ring_edges(PROBE), LEVEL),
        level=LEVEL,
        shading=SHADING,
        calibration=ANSWER,
        prior=PRIOR,
        force_n=np.array([1.0, 0.8, 1.1]),
        is_reference=np.array([False, False, True]),
    )


@pytest.fixture
def data(model: ForwardModel) -> Profiles:
    """Profiles of the first inclusion with errors, some rings of which cannot be used."""
    rng = np.random.default_rng(5)
    grey = model.profiles(INCLUSIONS[:1], np.zeros(13))[0][0]
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
            if r == s:
                matrix[f * rings + r, g * rings + s] = calibration.pattern_sd**2 * data.grey[f, r] * data.grey[g, s]
            if (f, r) == (g, s):
                own = data.variance[f, r] + (calibration.repeatability_sd * data.grey[f, r]) ** 2
                matrix[f * rings + r, g * rings + s] += own
    return matrix


def test_noise_covariance(data: Profiles) -> None:
    found = noise_covariance(data, ANSWER).reshape(data.grey.size, data.grey.size)
    use = np.flatnonzero(data.usable.ravel())
    np.testing.assert_allclose(found[np.ix_(use, use)], by_hand(data, ANSWER)[np.ix_(use, use)], rtol=1e-12)
    assert np.linalg.eigvalsh(found)[0] > 0


@pytest.mark.parametrize("seed", [None, 1])
def test_evidence_is_the_dense_normal_density(model: ForwardModel, data: Profiles, seed: int | None) -> None:
    """Up to a constant, with covariance N + J P J' around the linearised profiles."""
    likelihood = Likelihood(model, data)
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
    likelihood = Likelihood(model, data)
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


def test_a_nuisance_that_is_known_exactly(surrogate: PressSurrogate, model: ForwardModel, data: Profiles) -> None:
    """A standard deviation of zero is the limit of a small one."""
    fits = []
    for sd in (0.0, 1e-7):
        answer = replace(ANSWER, gain_sd=sd, force_sd=sd, offset_sd=sd, site_sd=sd, shading_sd=sd)
        fits.append(Likelihood(replace(model, calibration=answer), data)(INCLUSIONS, np.zeros(13)))
    exact, nearly = fits
    np.testing.assert_allclose(exact.misfit, nearly.misfit, rtol=1e-4)
    assert not exact.nuisance[:, [0, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]].any()


@pytest.mark.parametrize("place", range(13))
def test_slopes_are_derivatives(model: ForwardModel, place: int) -> None:
    at = 0.01 * np.random.default_rng(3).standard_normal(13)
    step = np.zeros(13)
    step[place] = 1e-3
    low, high = (model.profiles(INCLUSIONS, at + sign * step)[0] for sign in (-1, 1))
    found = model.profiles(INCLUSIONS, at)[1][..., place]
    expected = np.broadcast_to((high - low) / 2e-3, found.shape)
    np.testing.assert_allclose(found, expected, atol=0.02 * np.abs(expected).max())
    assert np.abs(expected).max() > 0.1


def test_profiles_without_nuisances_are_the_response_to_the_surrogates_press(model: ForwardModel) -> None:
    grey, _ = model.profiles(INCLUSIONS, np.zeros(13))
    at = model.rings.at_tissue(PRIOR.tissue_young_kpa, PRIOR.thickness_mm)

    def expected(answers: NDArray[np.float64]) -> NDArray[np.float64]:
        pressure, displacement, slope = answers[..., :20], answers[..., 20:40], answers[..., 40:]
        return (
            rough_contact(pressure, ANSWER)
            * np.exp(SHADING.growth_per_mm * displacement)
            * (1 + np.linspace(0.0, 2.0, 20) * slope)
        )

    np.testing.assert_allclose(grey[:, 0], expected(at(*INCLUSIONS.T)), rtol=1e-12)
    np.testing.assert_allclose(grey[:, 1], expected(0.8 * at(*INCLUSIONS.T)), rtol=1e-12)
    plain = np.broadcast_to(expected(1.1 * at.plain), grey[:, 2].shape)
    np.testing.assert_allclose(grey[:, 2], plain, rtol=1e-12)


def test_slopes_of_the_rings_are_those_of_a_press(surrogate: PressSurrogate) -> None:
    field = press(PROBE, PHANTOM, force_n=1.0)
    at = ring_answers(surrogate, ring_edges(PROBE), np.ones(20)).at_tissue(PHANTOM.young_kpa, PHANTOM.thickness_mm)
    found = at(np.array([10.0]), np.array([5.0]), np.array([100.0]))[0, 40:]
    edges = ring_edges(PROBE)
    rise = np.diff(np.interp(edges, field.radius_mm, field.face_displacement_mm)) / np.diff(edges)
    np.testing.assert_allclose(found[2:], rise[2:], atol=0.02 * np.abs(rise).max())


def test_ring_means_are_means_over_the_rings_area(surrogate: PressSurrogate) -> None:
    matrix = ring_means(surrogate, np.array([0.0, 3.0, 8.0]))
    # r over a ring: 2 (b**3 - a**3) / (3 (b**2 - a**2)).
    np.testing.assert_allclose(matrix @ surrogate.radius_mm, [2.0, 2 * (8.0**3 - 3.0**3) / (3 * 55.0)], rtol=1e-9)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, rtol=1e-12)
    # Light that grows as 4 + r between the rings' middles, 1.5 and 5.5 mm, and stays as it is beyond.
    level = np.array([5.5, 9.5])
    r = np.linspace(3.0, 8.0, 200_001)
    weight = r * np.interp(r, [1.5, 5.5], level)
    lit = ring_means(surrogate, np.array([0.0, 3.0, 8.0]), level) @ surrogate.radius_mm
    assert lit[1] == pytest.approx((weight * r).sum() / weight.sum(), rel=2e-3)

"""The uncertainty budget: identity of the linear case, simulated errors, samples, and what is withheld."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest

import tsis
from tsis.errors import NotIdentifiedError, UnknownNameError, UntrustedError
from tsis.imaging.sensor import Sensor
from tsis.inclusion import InclusionPrior, estimate
from tsis.inclusion.budget import (
    OF_NUISANCE,
    OF_PRIOR,
    UncertaintyBudget,
    nuisance_columns,
    propagate,
    uncertainty_budget,
)
from tsis.inclusion.estimation import analyse
from tsis.inclusion.posterior.forward import SHARED_NUISANCES
from tsis.inclusion.posterior.likelihood import ErrorSources
from tsis.model.calibration import LightMap
from tsis.virtual.probe import VirtualProbe, nominal_calibration

if TYPE_CHECKING:
    from tsis.inclusion.prior import Floats
    from tsis.mechanics.surrogate.full_contact import FullContactSurrogate
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage

FRAMES, RINGS, PARAMETERS = 2, 12, 3
LIGHT = 3  # errors of light that was not measured
PROBE, PRIOR = tsis.load_probe("tsis-2011"), InclusionPrior()
ANSWER = nominal_calibration(Sensor())


def linear_sources(rng: np.random.Generator) -> ErrorSources:
    nuisances, rings = len(SHARED_NUISANCES) + 2 * FRAMES + LIGHT, FRAMES * RINGS
    roots = {name: rng.normal(size=(rings, 4)) for name in ("pattern", "repeatability", "model", "heterogeneity")}
    return ErrorSources(
        by_inclusion=rng.normal(size=(rings, PARAMETERS)) * [3.0, 1.0, 0.02],
        by_nuisance=0.3 * rng.normal(size=(rings, nuisances)),
        nuisance_sd=rng.uniform(0.01, 0.2, nuisances),
        covariance={name: 0.1 * root @ root.T for name, root in roots.items()} | {"pixels": 0.5 * np.eye(rings)},
        tissue_sd=0.1,
        frames=FRAMES,
    )


def closed_form(sources: ErrorSources, prior_sd: Floats) -> Floats:
    """Covariance C by plain inverses."""
    total = sources.by_nuisance @ sources.by_nuisance.T + sum(sources.covariance.values())
    inverse = np.linalg.inv(total)
    covariance = np.linalg.inv(sources.by_inclusion.T @ inverse @ sources.by_inclusion + np.diag(prior_sd**-2.0))
    return np.asarray(covariance)


def test_the_contributions_sum_to_the_covariance_of_the_linear_case() -> None:
    rng = np.random.default_rng(4)
    for prior_sd in (np.array([4.0, 2.3, 23.0]), np.array([0.1, 0.1, 1.0]), np.array([1e3, 1e3, 1e5])):
        sources = linear_sources(rng)
        spread = propagate(sources, prior_sd)
        covariance = closed_form(sources, prior_sd)
        np.testing.assert_allclose(sum(spread.values()), covariance, rtol=1e-9, atol=0.0)
        assert set(spread) == {*OF_NUISANCE, *sources.covariance, *OF_PRIOR.values()}
        columns = [column for name in OF_NUISANCE for column in nuisance_columns(name, sources)]
        assert sorted(columns) == list(range(len(sources.nuisance_sd)))


def test_a_larger_error_never_narrows_the_estimate() -> None:
    sources, prior_sd = linear_sources(np.random.default_rng(6)), np.array([4.0, 2.3, 23.0])
    before = np.diag(sum(propagate(sources, prior_sd).values()))
    for name, part in sources.covariance.items():
        wider = replace(sources, covariance={**sources.covariance, name: 4 * part})
        assert (np.diag(sum(propagate(wider, prior_sd).values())) > before).all()


def test_each_contribution_is_the_scatter_of_the_best_estimate_by_its_source_alone() -> None:
    """The estimator of least squares with a prior, solved as such for simulated errors of one source."""
    rng = np.random.default_rng(5)
    sources, prior_sd = linear_sources(rng), np.array([4.0, 2.3, 23.0])
    spread = propagate(sources, prior_sd)
    total = sources.by_nuisance @ sources.by_nuisance.T + sum(sources.covariance.values())
    whiten = np.linalg.inv(np.linalg.cholesky(total))
    rows = np.vstack([whiten @ sources.by_inclusion, np.diag(1 / prior_sd)])

    def scatter(errors: Floats) -> Floats:
        right = np.vstack([whiten @ errors, np.zeros((PARAMETERS, errors.shape[1]))])
        return np.asarray(np.linalg.lstsq(rows, right, rcond=None)[0].std(axis=1))

    draws = 20_000
    for name, part in sources.covariance.items():
        errors = rng.multivariate_normal(np.zeros(len(part)), part, draws).T
        np.testing.assert_allclose(scatter(errors), np.sqrt(np.diag(spread[name])), rtol=0.03)
    for name in ("gain", "force", "shade"):
        columns = nuisance_columns(name, sources)
        errors = sources.by_nuisance[:, columns] @ rng.normal(size=(len(columns), draws))
        np.testing.assert_allclose(scatter(errors), np.sqrt(np.diag(spread[name])), rtol=0.03)


def presses(name: str, *, force_n: float = 1.0) -> tuple[TactileImage, TactileImage]:
    virtual = VirtualProbe(PROBE, rng=np.random.default_rng(2), light=LightMap.uniform(), strain="small")
    return (
        virtual.press(tsis.load_phantom(name), force_n=force_n),
        virtual.press(tsis.load_phantom("plain"), force_n=force_n),
    )


def budget_of(frames: tuple[TactileImage, TactileImage], calibration: Calibration = ANSWER) -> UncertaintyBudget:
    return uncertainty_budget(frames[0], probe=PROBE, calibration=calibration, reference=frames[1])


@pytest.fixture(scope="module")
def lump(flat: FullContactSurrogate) -> tuple[TactileImage, TactileImage]:
    assert flat.key, "built once before anything is estimated"
    return presses("hardness-100")


@pytest.fixture(scope="module")
def budget(lump: tuple[TactileImage, TactileImage]) -> UncertaintyBudget:
    return budget_of(lump)


def test_the_budget_is_of_the_estimate(budget: UncertaintyBudget, lump: tuple[TactileImage, TactileImage]) -> None:
    same = estimate(lump[0], probe=PROBE, calibration=ANSWER, reference=lump[1])
    for name, quantity in budget.quantities.items():
        assert (quantity.value, quantity.sampled_sd) == (same.mean[name], same.sd[name])
        assert quantity.combined**2 == pytest.approx(sum(part.contribution**2 for part in quantity.components))
        assert sum(map(quantity.fraction, quantity.components)) == pytest.approx(1.0)
        assert quantity.expanded == pytest.approx(1.96 * quantity.combined, rel=1e-3)
        priors = [part.standard_uncertainty for part in quantity.components if part.distribution == "rectangular"]
        assert priors == pytest.approx(list(PRIOR.sd.values()))
        for part in quantity.components:
            assert part.sensitivity * part.standard_uncertainty == pytest.approx(part.contribution)
    assert {"diameter_mm", "depth_mm"} <= set(budget.quantities)


def test_the_linear_budget_is_near_the_samples(budget: UncertaintyBudget) -> None:
    departures = {name: quantity.departure for name, quantity in budget.quantities.items()}
    assert departures["depth_mm"] == pytest.approx(0.0, abs=0.3)
    assert departures["diameter_mm"] == pytest.approx(0.0, abs=0.3)


def test_a_source_that_is_known_exactly_is_none(
    lump: tuple[TactileImage, TactileImage], budget: UncertaintyBudget
) -> None:
    def of(found: UncertaintyBudget, source: str) -> list[float]:
        return [part.contribution for part in found["depth_mm"].components if part.source == source]

    exact = budget_of(lump, replace(ANSWER, site_sd=0.0))
    assert of(exact, "tissue of the reference site") == []
    assert of(budget, "tissue of the reference site")[0] > 0


def test_what_is_withheld_has_no_budget(monkeypatch: pytest.MonkeyPatch, budget: UncertaintyBudget) -> None:
    with pytest.raises(UnknownNameError):
        budget["depth"]
    found = budget.estimate
    loose = replaced(found, flags=("young_kpa_not_identified",), notes=("",))
    part = UncertaintyBudget(estimate=loose, quantities={"depth_mm": budget["depth_mm"]})
    assert part.withheld["young_kpa"] == "not identified"
    with pytest.raises(NotIdentifiedError, match="young_kpa must be identified by the data for a budget"):
        part["young_kpa"]
    untrusted = replaced(found, trusted=False, flags=("model_does_not_fit",), notes=("",))
    none = UncertaintyBudget(estimate=untrusted, quantities={})
    assert set(none.withheld.values()) == {"not to be trusted"}
    with pytest.raises(UntrustedError, match="this one is not trusted"):
        none["depth_mm"]
    analysed = partial(replaced, trusted=False, flags=("model_does_not_fit",), notes=("",))
    original = analyse
    monkeypatch.setattr(
        "tsis.inclusion.budget.analyse",
        lambda *args, **kwargs: (lambda whole: replace(whole, estimate=analysed(whole.estimate)))(
            original(*args, **kwargs)
        ),
    )
    assert budget_of(presses("hardness-100")).quantities == {}


def replaced(found: tsis.Estimate, **changes: object) -> tsis.Estimate:
    return tsis.Estimate(
        **{"untrusted": found.untrusted, "presence": found.presence, "trusted": True} | changes  # type: ignore[arg-type]
    )

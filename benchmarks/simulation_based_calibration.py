"""Ranks of the truth among posterior samples, over inclusions and nuisances drawn from the prior.

    python -m benchmarks.simulation_based_calibration --protocol domed --draws 1000 --seed 1

Profiles come from the forward model itself, with all nuisances drawn and not linearised, and noise of a dense
covariance: what is judged is the inference alone; `benchmarks.coverage` judges it together with the mechanics. If the
posterior is right, ranks are uniform, intervals hold as often as they say, and no estimate has a smaller mean square
error than the posterior mean. ``--exact N`` sets the first N beside the mean under the likelihood that is linearised
anew at every inclusion, at its own best nuisances, by importance sampling around the fast posterior.

The inclusion is uniform over the prior and the slab's thickness is normal, drawn again until the inclusion fits. The
estimator does not know of the latter. ``--any-slab`` leaves it out: the polynomials answer for slabs that cannot be,
and the prior is exactly the estimator's.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench, Several
from benchmarks.judgement import Judgement, rows_of
from benchmarks.simulated_presses import SMALL, Protocol
from scipy.stats import chisquare, gaussian_kde
from threadpoolctl import threadpool_limits

from tsis.cli.progress import progress_bar
from tsis.imaging.profile import radial_profile
from tsis.imaging.sensor import Sensor
from tsis.inclusion import InclusionPrior
from tsis.inclusion.frames import depletion_per_n, ring_edges, ring_light
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.inclusion.posterior.forward import THICKNESS, ForwardModel
from tsis.inclusion.posterior.likelihood import InclusionLikelihood, Profiles
from tsis.inclusion.posterior.rings import ring_correlation, ring_responses
from tsis.inclusion.prior import PARAMETERS
from tsis.mechanics.surrogate.full_contact import build_full_contact_surrogate
from tsis.model.image import TactileImage
from tsis.optics.face_light import irradiance
from tsis.virtual.examinations import DEEPEST_FRACTION
from tsis.virtual.probe import nominal_calibration

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.inclusion.posterior.exploration import InclusionPosterior

PROTOCOLS = {one.name: one for one in SMALL}
ALONE = ("flat-alone", "domed")
SPREAD_SD = 0.5  # mm**2, of the squared distance from the axis: either coordinate is known to 0.5 mm
BINS = 20  # of the ranks
KERNELS, PROPOSALS = 500, 500  # of the importance sampling of one draw
RELINEARISATIONS = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Experiment:
    """Presses by a protocol as the estimator reads them.

    Attributes
    ----------
    model
        Grey profiles of inclusions and nuisances.
    pixels
        Pixels in each ring, shape (rings,).
    model_error
        Error of the press model, a share of the pressure, which counts as noise.
    """

    model: ForwardModel
    pixels: NDArray[np.float64]
    model_error: float

    @classmethod
    def of(cls, protocol: Protocol, prior: InclusionPrior) -> Experiment:
        """As a virtual camera sees the protocol's probe, the inclusion's place known only by the prior."""
        probe, sensor = protocol.probe, Sensor()
        calibration = nominal_calibration(sensor, irradiance(probe))
        blank = TactileImage(grey=np.zeros((sensor.rows, sensor.columns)), mm_per_pixel=sensor.mm_per_pixel)
        edges = ring_edges(probe)
        light = ring_light(blank, calibration, edges)
        surrogate = build_full_contact_surrogate(probe, prior.box())
        copies = 1 + protocol.with_reference
        model = ForwardModel(
            rings=ring_responses(surrogate, edges, light.level),
            level=light.level,
            shading=light.shading,
            calibration=calibration,
            prior=prior,
            force_n=np.tile(protocol.forces_n, copies),
            is_reference=np.repeat([False, True][:copies], len(protocol.forces_n)),
            correlation=ring_correlation(edges, calibration.grain_mm),
            depletion_per_n=depletion_per_n(calibration, probe),
            spread_sd=SPREAD_SD,
        )
        return cls(
            model=model,
            pixels=radial_profile(blank, edges_mm=edges).count.astype(float),
            model_error=surrogate.error,
        )

    def variance(self, grey: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variance of ring means by pixel noise and model error, shape (frames, rings)."""
        known, level = self.model.calibration, self.model.level
        pixel = known.read_noise_grey**2 + known.shot_noise_grey * np.maximum(grey * level, 0.0) + 1 / 12
        return np.asarray(pixel / (self.pixels * level**2) + (self.model_error * grey) ** 2)

    def nuisance_sd(self, grey: NDArray[np.float64]) -> NDArray[np.float64]:
        """Prior standard deviations of the nuisances for profiles (frames, rings)."""
        return self.model.nuisance_sd((grey * self.model.level).mean(axis=1))

    def expected(self, inclusion: NDArray[np.float64] | None, nuisance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Profiles without noise, shape (frames, rings)."""
        return np.asarray(self.model.grey(None if inclusion is None else inclusion[None], nuisance)[0])

    def known(self, inclusion: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """Profiles without noise where every nuisance is as believed."""
        return self.expected(inclusion, np.zeros(len(self.nuisance_sd(np.ones((len(self.model.force_n), 1))))))

    def observed(self, grey: NDArray[np.float64], rng: np.random.Generator) -> Profiles:
        """Profiles with noise around ``grey``."""
        around = noise(grey, self.variance(grey), self.model)
        seen = rng.multivariate_normal(grey.ravel(), around, method="cholesky").reshape(grey.shape)
        return Profiles(grey=seen, variance=self.variance(seen), usable=np.ones(grey.shape, dtype=bool))


def noise(grey: NDArray[np.float64], variance: NDArray[np.float64], model: ForwardModel) -> NDArray[np.float64]:
    """Covariance of raveled profiles: what each mean has for its own, and patterns that its neighbours share.

    One pattern is that of the probe, common to the frames; another is drawn by each press.
    """
    frames, rings = grey.shape
    known, alike = model.calibration, np.eye(rings) if model.correlation is None else model.correlation
    covariance = np.empty((frames, rings, frames, rings))
    for i, j in np.ndindex(frames, frames):
        common = known.pattern_sd**2 + (i == j) * known.repeatability_sd**2
        covariance[i, :, j] = common * alike * np.outer(grey[i], grey[j])
    return np.asarray(covariance.reshape(grey.size, grey.size) + np.diag(variance.ravel()))


def draw(
    experiment: Experiment, rng: np.random.Generator, *, any_slab: bool = False
) -> tuple[NDArray[np.float64], Profiles]:
    """An inclusion (diameter, depth, modulus) from the prior, and profiles of it with every nuisance drawn."""
    prior = experiment.model.prior
    inclusion = rng.uniform(prior.low, prior.high)
    sd = experiment.nuisance_sd(experiment.known(inclusion))
    nuisance = sd * rng.standard_normal(len(sd))
    bottom = inclusion[0] + inclusion[1]
    while not any_slab and bottom >= DEEPEST_FRACTION * prior.thickness_mm * np.exp(nuisance[THICKNESS]):
        nuisance[THICKNESS] = sd[THICKNESS] * rng.standard_normal()
    return inclusion, experiment.observed(experiment.expected(inclusion, nuisance), rng)


def exact_mean(
    likelihood: InclusionLikelihood, prior: InclusionPrior, fast: InclusionPosterior, rng: np.random.Generator
) -> tuple[NDArray[np.float64], float]:
    """Posterior mean when each inclusion is linearised at its own best nuisances, and the effective sample size.

    Kernels around samples of the fast posterior propose; weights put right whatever is wrong with them.
    """
    proposal = gaussian_kde(fast.samples[rng.choice(len(fast.samples), KERNELS, replace=False)].T)
    points = proposal.resample(PROPOSALS, seed=rng).T
    points = points[((points >= prior.low) & (points <= prior.high)).all(axis=1)]
    start = likelihood.within(fast.fit.nuisance[0])
    log_weight = np.array([_own_evidence(likelihood, point, start) for point in points]) - proposal.logpdf(points.T)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    return weight @ points, float(1 / (weight**2).sum())


def _own_evidence(
    likelihood: InclusionLikelihood, inclusion: NDArray[np.float64], nuisance: NDArray[np.float64]
) -> float:
    for _ in range(RELINEARISATIONS):
        nuisance = likelihood.within(likelihood(inclusion[None], nuisance).nuisance[0])
    return float(likelihood(inclusion[None], nuisance).log_evidence[0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibrated:
    """What came of the draws.

    Attributes
    ----------
    judgement
        Estimates beside truths.
    exact
        Means of the exact posterior of the first draws, shape (exact, 3).
    effective
        Effective sample size of each of them.
    """

    judgement: Judgement
    exact: NDArray[np.float64]
    effective: NDArray[np.float64]

    def chances(self) -> NDArray[np.float64]:
        """Chance of ranks this uneven from a right posterior, by chi-square, shape (3,)."""
        counts = [np.histogram(column, bins=BINS, range=(0.0, 1.0))[0] for column in self.judgement.rank.T]
        return np.array([chisquare(count).pvalue for count in counts])

    def rmse_over_exact(self) -> NDArray[np.float64]:
        """Root mean square error of the estimates over that of the exact means, over the same draws, shape (3,)."""
        truth, mean = (values[: len(self.exact)] for values in (self.judgement.truth, self.judgement.mean))
        return np.asarray(np.sqrt(((mean - truth) ** 2).mean(axis=0) / ((self.exact - truth) ** 2).mean(axis=0)))


def run(
    protocol: Protocol,
    draws: int,
    *,
    seed: int,
    exact: int = 0,
    any_slab: bool = False,
    prior: InclusionPrior | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Calibrated:
    """Draw, estimate, rank."""
    prior = InclusionPrior() if prior is None else prior
    experiment = Experiment.of(protocol, prior)
    lines: list[dict[str, Any]] = []
    best: list[tuple[NDArray[np.float64], float]] = []
    with threadpool_limits(limits=1, user_api="blas"):
        for index in range(draws):
            rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
            truth, data = draw(experiment, rng, any_slab=any_slab)
            likelihood = InclusionLikelihood(experiment.model, data)
            found = explore_inclusion(likelihood, prior)
            lines.append(_line(truth, found.samples))
            if index < exact:
                best.append(exact_mean(likelihood, prior, found, rng))
            if progress is not None:
                progress(index + 1, draws)
    return Calibrated(
        judgement=Judgement.of(lines),
        exact=np.reshape([mean for mean, _ in best], (-1, len(PARAMETERS))),
        effective=np.array([effective for _, effective in best]),
    )


def _line(truth: NDArray[np.float64], samples: NDArray[np.float64]) -> dict[str, Any]:
    """A line as `Judgement.of` reads it."""
    return {
        "truth": truth,
        "mean": samples.mean(axis=0),
        "sd": samples.std(axis=0),
        "rank": (samples < truth).mean(axis=0),
        "trusted": True,
        "flags": [],
    }


def rows(found: Calibrated, prior: InclusionPrior) -> list[Sequence[str]]:
    """Lines of the table, a column a parameter."""
    result: list[Sequence[str]] = [*rows_of(found.judgement.summary(prior))]
    result.append(("uniform ranks, chi-square", *(f"{chance:.3g}" for chance in found.chances())))
    if len(found.exact):
        result.append(
            (f"rmse over exact mean's, {len(found.exact)} draws", *(f"{one:.3f}" for one in found.rmse_over_exact()))
        )
    return result


def main() -> int:
    """Print a table a protocol."""
    bench = Bench(__doc__, protocol=Several(PROTOCOLS), draws=1000, exact=0, seed=1, any_slab=False)
    prior = InclusionPrior()
    for name in bench.protocol or ALONE:
        with progress_bar(name) as progress:
            found = run(
                PROTOCOLS[name],
                bench.draws,
                seed=bench.seed,
                exact=bench.exact,
                any_slab=bench.any_slab,
                prior=prior,
                progress=progress,
            )
        slabs = "any slab" if bench.any_slab else "slabs that hold the inclusion"
        title = f"{bench.draws} draws, seed {bench.seed}, {slabs}: {PROTOCOLS[name].described}"
        bench.table(title, (name, *PARAMETERS), rows(found, prior))
        if len(found.exact):
            print(f"effective samples behind the exact means: median {np.median(found.effective):.0f}")
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())

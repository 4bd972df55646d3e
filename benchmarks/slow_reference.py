"""The fast posterior beside two samplers of all parameters at once, which linearise nothing and lay no grid.

    python -m benchmarks.slow_reference --samples 12000 --live 300 --seed 1

Both move diameter, depth, modulus and every nuisance, 15 to 21 numbers, under the density of `benchmarks.looped_model`,
which shares with the estimator only the tables of presses; its noise is a dense covariance. Importance sampling
proposes inclusions around the fast posterior's and nuisances around the best of each inclusion, and weights put right
whatever is wrong with the proposals. Nested sampling, by dynesty, knows nothing but the prior; ``--live 0`` leaves it
out. Without inclusion they give the evidence of plain tissue, so that Bayes factors that leave a doubt can be compared.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import dynesty
import numpy as np
from benchmarks.harness import Bench, Several
from benchmarks.looped_model import log_likelihood
from benchmarks.simulated_presses import SMALL
from benchmarks.simulation_based_calibration import Experiment, noise
from scipy.special import logsumexp, ndtri
from scipy.stats import gaussian_kde, multivariate_normal
from threadpoolctl import threadpool_limits

from tsis.inclusion import InclusionPrior
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.inclusion.posterior.likelihood import InclusionLikelihood

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.inclusion.posterior.exploration import InclusionPosterior
    from tsis.inclusion.posterior.likelihood import Profiles

PROTOCOLS = {one.name: one for one in SMALL}
CASES = (
    ("domed", (10.0, 5.0, 60.0)),
    ("flat", (3.0, 9.0, 80.0)),
    ("flat", (2.0, 6.0, 80.0)),
    ("flat", (1.2, 7.0, 80.0)),  # hardly to be seen
    ("flat-alone", (10.0, 5.0, 60.0)),
)
CERTAIN = 20.0  # log Bayes factor beyond which samplers find nothing of plain tissue worth weighing
LEFT = 0.01  # log evidence that may be left when a run ends
KERNELS = 2000
STEPS = 2  # of Gauss and Newton to the best nuisances of an inclusion
TAIL = 1.3  # times the variance that proposals of nuisances have by the linearised model
SLICES = 12  # between an old point and a new one: with fewer the modulus, of which data say little, does not mix


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sampled:
    """What a sampler found.

    Attributes
    ----------
    mean, sd
        Of diameter, depth and modulus, shape (3,); empty for plain tissue.
    log_evidence, log_evidence_sd
        Up to the constant of the noise, and its standard error.
    calls, seconds
        Evaluations of the density, and the time that they took with all else.
    effective
        Effective sample size.
    """

    mean: NDArray[np.float64]
    sd: NDArray[np.float64]
    log_evidence: float
    log_evidence_sd: float
    calls: int
    seconds: float
    effective: float


def weighted(
    experiment: Experiment, data: Profiles, found: InclusionPosterior | None, *, count: int, rng: np.random.Generator
) -> Sampled:
    """Importance sampling around a fast posterior, or of the nuisances of plain tissue alone when there is none."""
    started = perf_counter()
    prior, sd = experiment.model.prior, experiment.nuisance_sd(data.grey)
    density, likelihood = log_likelihood(experiment.model, data), InclusionLikelihood(experiment.model, data)
    precision = np.asarray(np.linalg.inv(noise(data.grey, data.variance, experiment.model)), dtype=float)
    believed = multivariate_normal(np.zeros(len(sd)), np.diag(sd**2))
    points, log_proposal = _proposed(prior, found, count, rng)
    start = likelihood.start if found is None else found.fit.nuisance[0]
    log_weight = -log_proposal
    for i, point in enumerate(points):
        if i == 0 or found is not None:  # all points of plain tissue share one proposal
            centre, spread = _nuisances(experiment, likelihood, data, precision, point, start)
            around = multivariate_normal(centre, TAIL * spread)
        nuisance = around.rvs(random_state=rng)
        log_weight[i] += density(point, nuisance) + believed.logpdf(nuisance) - around.logpdf(nuisance)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    effective = float(1 / (weight**2).sum())
    inclusions = np.empty((len(points), 0)) if found is None else np.array(points)
    mean = weight @ inclusions
    return Sampled(
        mean=mean,
        sd=np.sqrt(weight @ (inclusions - mean) ** 2),
        log_evidence=float(logsumexp(log_weight) - np.log(count)),
        log_evidence_sd=float(np.sqrt(1 / effective - 1 / count)),
        calls=len(points),
        seconds=perf_counter() - started,
        effective=effective,
    )


def _proposed(
    prior: InclusionPrior, found: InclusionPosterior | None, count: int, rng: np.random.Generator
) -> tuple[Sequence[NDArray[np.float64] | None], NDArray[np.float64]]:
    """Inclusions, those outside the prior left out, and the log of their proposal density over the prior's."""
    if found is None:
        return [None] * count, np.zeros(count)
    kernels = gaussian_kde(found.samples[rng.choice(len(found.samples), KERNELS, replace=False)].T)
    points = kernels.resample(count, seed=rng).T
    points = points[((points >= prior.low) & (points <= prior.high)).all(axis=1)]
    return list(points), kernels.logpdf(points.T) + np.log(prior.high - prior.low).sum()


def _nuisances(
    experiment: Experiment,
    likelihood: InclusionLikelihood,
    data: Profiles,
    precision: NDArray[np.float64],
    inclusion: NDArray[np.float64] | None,
    nuisance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Best nuisances of one inclusion, and their covariance there: normal equations, by a dense inverse."""
    sd = experiment.nuisance_sd(data.grey)
    for _ in range(STEPS):
        nuisance = likelihood.within(nuisance)
        grey, slopes = experiment.model.profiles(None if inclusion is None else inclusion[None], nuisance)
        slope = slopes.reshape(-1, len(sd))
        inverse = np.linalg.inv(np.diag(1 / sd**2) + slope.T @ precision @ slope)
        covariance = np.asarray((inverse + inverse.T) / 2, dtype=float)
        nuisance = covariance @ slope.T @ precision @ ((data.grey - grey[0]).ravel() + slope @ nuisance)
    return nuisance, covariance


def nested(experiment: Experiment, data: Profiles, *, is_plain: bool, live: int, rng: np.random.Generator) -> Sampled:
    """Sample inclusions and nuisances, or the nuisances of plain tissue."""
    prior = experiment.model.prior
    density = log_likelihood(experiment.model, data)
    sd = experiment.nuisance_sd(data.grey)
    own = 0 if is_plain else 3

    def prior_transform(unit: NDArray[np.float64]) -> NDArray[np.float64]:
        inclusion = prior.low + (prior.high - prior.low) * unit[:own] if own else unit[:0]
        return np.concatenate([inclusion, sd * ndtri(unit[own:])])

    def log_density(point: NDArray[np.float64]) -> float:
        return density(point[:own] if own else None, point[own:])

    started = perf_counter()
    sampler = dynesty.NestedSampler(
        log_density,
        prior_transform,
        own + len(sd),
        nlive=live,
        bound="single",  # there is one hill, long and thin
        sample="rslice",
        slices=SLICES,
        rstate=rng,
    )
    sampler.run_nested(dlogz=LEFT, print_progress=False)
    found = sampler.results
    weight, inclusions = found.importance_weights(), found.samples[:, :own]
    mean = weight @ inclusions
    return Sampled(
        mean=mean,
        sd=np.sqrt(weight @ (inclusions - mean) ** 2),
        log_evidence=float(found.logz[-1]),
        log_evidence_sd=float(found.logzerr[-1]),
        calls=int(np.sum(found.ncall)),
        seconds=perf_counter() - started,
        effective=float(1 / (weight**2).sum()),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """One case by all.

    Attributes
    ----------
    samplers
        With an inclusion and on plain tissue, by the sampler's name.
    mean, sd
        Of the fast posterior, shape (3,).
    log_bayes_factor
        Its evidence for an inclusion against plain tissue.
    seconds
        Time of the fast posterior.
    """

    samplers: dict[str, tuple[Sampled, Sampled | None]]
    mean: NDArray[np.float64]
    sd: NDArray[np.float64]
    log_bayes_factor: float
    seconds: float

    def shift(self, name: str) -> NDArray[np.float64]:
        """Fast mean less the sampler's, in units of the sampler's standard deviation."""
        return np.asarray((self.mean - self.samplers[name][0].mean) / self.samplers[name][0].sd)

    def widening(self, name: str) -> NDArray[np.float64]:
        """Fast standard deviation over the sampler's."""
        return np.asarray(self.sd / self.samplers[name][0].sd)

    def sampled_log_bayes_factor(self, name: str) -> tuple[float, float]:
        """By a sampler, and its standard error; not a number without a run on plain tissue."""
        one, plain = self.samplers[name]
        if plain is None:
            return float("nan"), float("nan")
        return one.log_evidence - plain.log_evidence, float(np.hypot(one.log_evidence_sd, plain.log_evidence_sd))


def simulated(protocol: str, inclusion: Sequence[float], rng: np.random.Generator) -> tuple[Experiment, Profiles]:
    """Profiles of an inclusion with every nuisance drawn."""
    experiment, truth = Experiment.of(PROTOCOLS[protocol], InclusionPrior()), np.array(inclusion)
    sd = experiment.nuisance_sd(experiment.known(truth))
    return experiment, experiment.observed(experiment.expected(truth, sd * rng.standard_normal(len(sd))), rng)


def compare(protocol: str, inclusion: Sequence[float], *, samples: int, live: int, seed: int) -> Comparison:
    """All of them on the same profiles; a sampler of no samples is left out."""
    rng = np.random.default_rng(seed)
    experiment, data = simulated(protocol, inclusion, rng)
    prior = experiment.model.prior
    samplers: dict[str, tuple[Sampled, Sampled | None]] = {}
    with threadpool_limits(limits=1, user_api="blas"):
        started = perf_counter()
        found = explore_inclusion(InclusionLikelihood(experiment.model, data), prior)
        seconds = perf_counter() - started
        certain = abs(found.log_bayes_factor) > CERTAIN
        if samples:
            samplers["importance sampling"] = (
                weighted(experiment, data, found, count=samples, rng=rng),
                None if certain else weighted(experiment, data, None, count=samples, rng=rng),
            )
        if live:
            samplers["nested sampling"] = (
                nested(experiment, data, is_plain=False, live=live, rng=rng),
                None if certain else nested(experiment, data, is_plain=True, live=live, rng=rng),
            )
    return Comparison(
        samplers=samplers,
        mean=found.samples.mean(axis=0),
        sd=found.samples.std(axis=0),
        log_bayes_factor=found.log_bayes_factor,
        seconds=seconds,
    )


def rows(protocol: str, inclusion: Sequence[float], found: Comparison) -> list[list[str]]:
    """A line for the fast posterior, and two for each sampler: its own, and how far from it the fast one is."""

    def cells(mean: NDArray[np.float64], sd: NDArray[np.float64]) -> list[str]:
        return [f"{one:.3f} ± {wide:.3f}" for one, wide in zip(mean, sd, strict=True)]

    numbers = ", ".join(f"{value:g}" for value in inclusion)
    factor = f"{found.log_bayes_factor:.2f}"
    lines = [[f"{protocol} ({numbers})", "tsis", *cells(found.mean, found.sd), factor, f"{found.seconds:.2f} s"]]
    for name, (one, plain) in found.samplers.items():
        other, error = found.sampled_log_bayes_factor(name)
        result = "" if plain is None else f"{other:.2f} ± {error:.2f}"
        effort = f"{one.seconds:.0f} s, {one.calls:,} evaluations, {one.effective:.0f} effective"
        apart = zip(found.shift(name), found.widening(name), strict=True)
        lines += [
            ["", name, *cells(one.mean, one.sd), result, effort],
            ["", f"tsis against {name}", *(f"{shift:+.3f} sd, x {wide:.3f}" for shift, wide in apart), "", ""],
        ]
    return lines


def main() -> int:
    """Print the table."""
    bench = Bench(__doc__, case=Several(range(1, 1 + len(CASES)), int), samples=12000, live=300, seed=1)
    lines: list[list[str]] = []
    for number in bench.case or range(1, 1 + len(CASES)):
        protocol, inclusion = CASES[number - 1]
        found = compare(protocol, inclusion, samples=bench.samples, live=bench.live, seed=bench.seed)
        lines += rows(protocol, inclusion, found)
    title = f"posterior mean and standard deviation, {bench.samples} samples, {bench.live} live points"
    heads = ("case", "by", "d mm", "h mm", "E kPa", "log Bayes factor", "time")
    bench.table(f"{title}, seed {bench.seed}", heads, lines)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())

"""The fast posterior beside a sampler of all parameters at once, under a model that is written a second time.

    python -m benchmarks.slow_reference --samples 12000 --seed 1

`tsis.inclusion.posterior` computes arrays of many inclusions, linearises in the nuisances and lays a grid. Here the
forward model and its likelihood are loops over the equations, one inclusion and one set of nuisances at a time, with a
dense covariance of the noise; both share only the tables of presses. Importance sampling moves diameter, depth, modulus
and every nuisance, 15 to 21 numbers: it proposes inclusions around the fast posterior's and nuisances around the best
of each inclusion, and weights put right whatever is wrong with the proposals. Without inclusion it gives the evidence
of plain tissue, so that Bayes factors that leave a doubt can be compared.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, Several
from benchmarks.simulated_presses import SMALL
from benchmarks.simulation_based_calibration import Experiment, noise
from scipy.special import logsumexp
from scipy.stats import gaussian_kde, multivariate_normal
from threadpoolctl import threadpool_limits

from tsis.compiled import compiled
from tsis.inclusion import InclusionPrior
from tsis.inclusion.posterior.exploration import explore_inclusion
from tsis.inclusion.posterior.likelihood import InclusionLikelihood

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.inclusion.posterior.exploration import InclusionPosterior
    from tsis.inclusion.posterior.forward import ForwardModel
    from tsis.inclusion.posterior.likelihood import Profiles
    from tsis.mechanics.surrogate.polynomial import Surrogate

    Numbers = NDArray[np.float64]
    # Plain tissue: values and two axes; change by an inclusion: values and five axes.
    Table = tuple[Numbers, tuple[Numbers, Numbers], Numbers, tuple[Numbers, Numbers, Numbers, Numbers, Numbers]]
    Tables = tuple[Table, Table, Table]

PROTOCOLS = {one.name: one for one in SMALL}
CASES = (
    ("domed", (10.0, 5.0, 60.0)),
    ("flat", (3.0, 9.0, 80.0)),
    ("flat", (2.0, 6.0, 80.0)),
    ("flat", (1.2, 7.0, 80.0)),  # hardly to be seen
    ("flat-alone", (10.0, 5.0, 60.0)),
)
CERTAIN = 20.0  # log Bayes factor beyond which the sampler finds nothing of plain tissue worth weighing
KERNELS = 2000
STEPS = 2  # of Gauss and Newton to the best nuisances of an inclusion
TAIL = 1.3  # times the variance that proposals of nuisances have by the linearised model
DARKEST = 1e-3  # light on a flank that the lamps do not reach, over that on the level face


def looped(model: ForwardModel) -> Callable[[Numbers | None, Numbers], Numbers]:
    """Grey profiles (frames, rings) of one inclusion (3,), or of plain tissue, and nuisances."""
    rings, prior, known = model.rings, model.prior, model.calibration
    believed = (math.log(prior.tissue_young_kpa), math.log(prior.thickness_mm))
    # What is linear in its nuisance is taken at the believed tissue.
    by_poisson, by_spread = (_in_tissue(_table(one), *believed) for one in (rings.by_poisson, rings.by_spread))
    tables = (_table(rings.response), by_poisson, by_spread)
    answer = (known.gain_grey_per_kpa, known.saturation_kpa, model.depletion_per_n)
    light = (model.level, model.shading.growth_per_mm, model.shading.bend_per_mm2, model.shading.flux)
    nothing = np.zeros(3)

    def grey(inclusion: Numbers | None, nuisance: Numbers) -> Numbers:
        shown = nothing if inclusion is None else inclusion
        plain = model.is_reference | (inclusion is None)
        site = model.is_reference
        return _grey(
            tables, shown, nuisance, model.force_n, plain, site, believed, answer, light, rings.count, rings.is_domed
        )

    return grey


def log_likelihood(model: ForwardModel, data: Profiles) -> Callable[[Numbers | None, Numbers], float]:
    """Log density of the usable profiles, without the constant of the noise, for one inclusion and nuisances."""
    grey, use = looped(model), data.usable.ravel()
    precision = np.linalg.inv(noise(data.grey, data.variance, model)[np.ix_(use, use)])
    seen = data.grey.ravel()[use]

    def density(inclusion: Numbers | None, nuisance: Numbers) -> float:
        left = seen - grey(inclusion, nuisance).ravel()[use]
        return float(-0.5 * left @ precision @ left)

    return density


def _table(surrogate: Surrogate) -> Table:
    """Values and the places along each axis for which they hold."""
    box = surrogate.box
    tissue, slab = ((math.log(low), math.log(high)) for low, high in (box.tissue_young_kpa, box.thickness_mm))
    plain, change = surrogate.baseline, surrogate.change
    ranges = (box.diameter_mm, box.depth_mm, box.contrast_factor, tissue, slab)
    axes = [_places(ends, count) for ends, count in zip(ranges, change.shape, strict=False)]
    return (
        np.ascontiguousarray(plain),
        (_places(tissue, plain.shape[0]), _places(slab, plain.shape[1])),
        np.ascontiguousarray(change),
        (axes[0], axes[1], axes[2], axes[3], axes[4]),
    )


def _in_tissue(table: Table, log_tissue: float, log_slab: float) -> Table:
    """The same at one tissue: an axis of one place says that nothing depends on it."""
    plain, plain_axes, change, axes = table
    here = [np.outer(_lagrange(t, log_tissue), _lagrange(s, log_slab)) for t, s in (plain_axes, axes[3:])]
    nowhere = np.zeros(1)
    return (
        np.einsum("ts,tsk->k", here[0], plain)[None, None],
        (nowhere, nowhere),
        np.einsum("ts,dhgtsk->dhgk", here[1], change)[:, :, :, None, None],
        (axes[0], axes[1], axes[2], nowhere, nowhere),
    )


def _places(ends: tuple[float, float], count: int) -> Numbers:
    """Roots of the Chebyshev polynomial of degree ``count`` between the ends, ascending."""
    low, high = ends
    return np.array([(low + high - (high - low) * math.cos(math.pi * (i + 0.5) / count)) / 2 for i in range(count)])


@compiled
def _lagrange(nodes: Numbers, x: float) -> Numbers:
    """Value at ``x`` of each polynomial that is one at one node and zero at the others."""
    weight = np.ones(len(nodes))
    for i in range(len(nodes)):
        for j in range(len(nodes)):
            if j != i:
                weight[i] *= (x - nodes[j]) / (nodes[i] - nodes[j])
    return weight


@compiled
def _plain(table: Table, log_tissue: float, log_slab: float) -> Numbers:
    """Answers of plain tissue."""
    values, nodes, _, _ = table
    in_tissue, in_slab = _lagrange(nodes[0], log_tissue), _lagrange(nodes[1], log_slab)
    found = np.zeros(values.shape[2])
    for t in range(len(in_tissue)):
        for s in range(len(in_slab)):
            found += in_tissue[t] * in_slab[s] * values[t, s]
    return found


@compiled
def _change(table: Table, inclusion: Numbers, log_tissue: float, log_slab: float) -> Numbers:
    """What an inclusion (diameter, depth, modulus) changes."""
    _, _, values, nodes = table
    diameter, depth, contrast = inclusion[0], inclusion[1], inclusion[2] / np.exp(log_tissue)
    factor = (contrast - 1) / (contrast + 1.5)
    in_d, in_h = _lagrange(nodes[0], diameter), _lagrange(nodes[1], depth)
    in_g, in_t, in_s = _lagrange(nodes[2], factor), _lagrange(nodes[3], log_tissue), _lagrange(nodes[4], log_slab)
    found = np.zeros(values.shape[5])
    for d in range(len(in_d)):
        for h in range(len(in_h)):
            for g in range(len(in_g)):
                for t in range(len(in_t)):
                    for s in range(len(in_s)):
                        weight = in_d[d] * in_h[h] * in_g[g] * in_t[t] * in_s[s]
                        for k in range(len(found)):
                            found[k] += weight * values[d, h, g, t, s, k]
    found *= factor * (diameter / (depth + diameter / 2)) ** 3
    return found


@compiled
def _answers(
    tables: Tables,
    inclusion: Numbers,
    nuisance: Numbers,
    believed: tuple[float, float],
    rings: int,
    plain: bool,
    site: bool,
) -> Numbers:
    """Signal of each ring per newton and, under a dome, by its shape.

    `tsis.inclusion.posterior.forward` lists the nuisances.

    A probe stiffer by a factor on some tissue does what the believed one does on tissue softer by that factor, with
    pressures and forces in units larger by it.
    """
    stiffer = math.exp(nuisance[4])
    log_tissue = believed[0] + nuisance[1] - nuisance[4]
    if site:
        log_tissue += nuisance[3]
    log_slab = believed[1] + nuisance[2]
    found = _plain(tables[0], log_tissue, log_slab)
    linear = nuisance[5] * _plain(tables[1], believed[0], believed[1])
    if not plain:
        softer = np.array([inclusion[0], inclusion[1], inclusion[2] / stiffer])
        found += _change(tables[0], softer, log_tissue, log_slab)
        linear += nuisance[5] * _change(tables[1], inclusion, believed[0], believed[1])
        linear += nuisance[6] * _change(tables[2], inclusion, believed[0], believed[1])
    for k in range(len(found)):
        if rings <= k < 3 * rings:
            found[k] /= stiffer
        elif 3 * rings <= k < 4 * rings:
            found[k] *= stiffer
    found += linear
    return found


@compiled
def _grey(
    tables: Tables,
    inclusion: Numbers,
    nuisance: Numbers,
    force_n: Numbers,
    plain: NDArray[np.bool],
    site: NDArray[np.bool],
    believed: tuple[float, float],
    answer: tuple[float, float, float],
    light: tuple[Numbers, Numbers, Numbers, Numbers],
    rings: int,
    is_domed: bool,
) -> Numbers:
    gain, saturation, depletion = answer
    level, growth, bend, flux = light
    frames = len(force_n)
    grey = np.empty((frames, rings))
    shown = -1  # which press ``found`` holds: frames of one site share it
    found = np.empty(0)
    for frame in range(frames):
        if shown != int(site[frame]):
            shown = int(site[frame])
            found = _answers(tables, inclusion, nuisance, believed, rings, plain[frame], site[frame])
        force = force_n[frame] * math.exp(nuisance[10 + frame])
        bright = math.exp(nuisance[0]) / (1.0 + depletion * force)
        for ring in range(rings):
            pressure, displacement, slope = (
                force * found[ring],
                force * found[rings + ring],
                force * found[2 * rings + ring],
            )
            if is_domed:
                pressure += found[3 * rings + ring]
                displacement += found[4 * rings + ring]
                slope += found[5 * rings + ring]
            x = 2.0 * ring / (rings - 1) - 1.0
            emphasis = nuisance[7] + nuisance[8] * x + nuisance[9] * (1.5 * x * x - 0.5)
            tilt = max(1.0 + flux[ring] * slope, DARKEST)
            grown = math.exp(growth[ring] * displacement + bend[ring] * displacement**2)
            shade = (grown * tilt) ** (1.0 + emphasis)
            contact = gain * saturation * math.erf(math.sqrt(math.pi) / 2 * max(pressure, 0.0) / saturation)
            grey[frame, ring] = bright * contact * shade + nuisance[10 + frames + frame] / level[ring]
    return grey


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sampled:
    """What a sampler found.

    Attributes
    ----------
    mean, sd
        Of diameter, depth and modulus, shape (3,); empty for plain tissue.
    log_evidence, log_evidence_sd
        Up to the constant of the noise, and its standard error.
    seconds
        Time of the evaluations with all else.
    effective
        Effective sample size.
    """

    mean: NDArray[np.float64]
    sd: NDArray[np.float64]
    log_evidence: float
    log_evidence_sd: float
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """One case by both.

    Attributes
    ----------
    sampled, plain
        With an inclusion, and on plain tissue unless the evidence is beyond doubt.
    mean, sd
        Of the fast posterior, shape (3,).
    log_bayes_factor
        Its evidence for an inclusion against plain tissue.
    """

    sampled: Sampled
    plain: Sampled | None
    mean: Numbers
    sd: Numbers
    log_bayes_factor: float

    @property
    def shift(self) -> Numbers:
        """Fast mean less the sampler's, in units of the sampler's standard deviation."""
        return np.asarray((self.mean - self.sampled.mean) / self.sampled.sd)

    @property
    def widening(self) -> Numbers:
        """Fast standard deviation over the sampler's."""
        return np.asarray(self.sd / self.sampled.sd)

    def sampled_log_bayes_factor(self) -> tuple[float, float]:
        """By the sampler, and its standard error; not a number without a run on plain tissue."""
        if self.plain is None:
            return math.nan, math.nan
        errors = self.sampled.log_evidence_sd, self.plain.log_evidence_sd
        return self.sampled.log_evidence - self.plain.log_evidence, float(np.hypot(*errors))


def simulated(protocol: str, inclusion: Sequence[float], rng: np.random.Generator) -> tuple[Experiment, Profiles]:
    """Profiles of an inclusion with every nuisance drawn."""
    experiment, truth = Experiment.of(PROTOCOLS[protocol], InclusionPrior()), np.array(inclusion)
    sd = experiment.nuisance_sd(experiment.known(truth))
    return experiment, experiment.observed(experiment.expected(truth, sd * rng.standard_normal(len(sd))), rng)


def compare(protocol: str, inclusion: Sequence[float], *, samples: int, seed: int) -> Comparison:
    """Both on the same profiles."""
    rng = np.random.default_rng(seed)
    experiment, data = simulated(protocol, inclusion, rng)
    with threadpool_limits(limits=1, user_api="blas"):
        found = explore_inclusion(InclusionLikelihood(experiment.model, data), experiment.model.prior)
        sampled = weighted(experiment, data, found, count=samples, rng=rng)
        certain = abs(found.log_bayes_factor) > CERTAIN
        plain = None if certain else weighted(experiment, data, None, count=samples, rng=rng)
    return Comparison(
        sampled=sampled,
        plain=plain,
        mean=found.samples.mean(axis=0),
        sd=found.samples.std(axis=0),
        log_bayes_factor=found.log_bayes_factor,
    )


def rows(protocol: str, inclusion: Sequence[float], found: Comparison) -> list[list[str]]:
    """A line for each posterior, and one that says how far they are apart."""

    def cells(mean: Numbers, sd: Numbers) -> list[str]:
        return [f"{one:.3f} ± {wide:.3f}" for one, wide in zip(mean, sd, strict=True)]

    numbers, one = ", ".join(f"{value:g}" for value in inclusion), found.sampled
    factor, error = found.sampled_log_bayes_factor()
    told = "" if found.plain is None else f"{factor:.2f} ± {error:.2f}"
    apart = zip(found.shift, found.widening, strict=True)
    return [
        [f"{protocol} ({numbers})", "tsis", *cells(found.mean, found.sd), f"{found.log_bayes_factor:.2f}", ""],
        ["", "sampler", *cells(one.mean, one.sd), told, f"{one.effective:.0f}"],
        ["", "apart", *(f"{shift:+.3f} sd, x {wide:.3f}" for shift, wide in apart), "", f"{one.seconds:.0f} s"],
    ]


def main() -> int:
    """Print the table."""
    bench = Bench(__doc__, case=Several(range(1, 1 + len(CASES)), int), samples=12000, seed=1)
    lines: list[list[str]] = []
    for number in bench.case or range(1, 1 + len(CASES)):
        protocol, inclusion = CASES[number - 1]
        lines += rows(protocol, inclusion, compare(protocol, inclusion, samples=bench.samples, seed=bench.seed))
    title = f"posterior mean and standard deviation, {bench.samples} samples, seed {bench.seed}"
    bench.table(title, ("case", "by", "d mm", "h mm", "E kPa", "log Bayes factor", "effective samples"), lines)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())

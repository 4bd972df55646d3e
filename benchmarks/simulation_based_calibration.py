"""Ranks of the truth among posterior samples, over inclusions and nuisances drawn from the prior.

    python -m benchmarks.simulation_based_calibration --protocol domed --draws 1000 --seed 1

Profiles come from the forward model itself, with all nuisances drawn and not linearised, and noise of a dense
covariance: what is judged is the inference alone; `benchmarks.coverage` judges it together with the mechanics. If the
posterior is right, ranks are uniform and intervals hold as often as they say. The inclusion is uniform over the prior
and the slab's thickness is normal, drawn again until the inclusion fits; the estimator does not know of the latter.
`benchmarks.slow_reference` sets single posteriors beside a sampler of everything.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench, Several
from benchmarks.judgement import Judgement, rows_of
from benchmarks.simulated_presses import SMALL, Protocol
from scipy.stats import chisquare
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
    from collections.abc import Callable

    from numpy.typing import NDArray


PROTOCOLS = {one.name: one for one in SMALL}
ALONE = ("flat-alone", "domed")
SPREAD_SD = 0.5  # mm**2, of the squared distance from the axis: either coordinate is known to 0.5 mm
BINS = 20  # of the ranks


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


def draw(experiment: Experiment, rng: np.random.Generator) -> tuple[NDArray[np.float64], Profiles]:
    """An inclusion (diameter, depth, modulus) from the prior, and profiles of it with every nuisance drawn."""
    prior = experiment.model.prior
    inclusion = rng.uniform(prior.low, prior.high)
    sd = experiment.nuisance_sd(experiment.known(inclusion))
    nuisance = sd * rng.standard_normal(len(sd))
    bottom = inclusion[0] + inclusion[1]
    while bottom >= DEEPEST_FRACTION * prior.thickness_mm * np.exp(nuisance[THICKNESS]):
        nuisance[THICKNESS] = sd[THICKNESS] * rng.standard_normal()
    return inclusion, experiment.observed(experiment.expected(inclusion, nuisance), rng)


def chances(judgement: Judgement) -> NDArray[np.float64]:
    """Chance of ranks this uneven from a right posterior, by chi-square, shape (3,)."""
    counts = [np.histogram(column, bins=BINS, range=(0.0, 1.0))[0] for column in judgement.rank.T]
    return np.array([chisquare(count).pvalue for count in counts])


def run(
    protocol: Protocol,
    draws: int,
    *,
    seed: int,
    prior: InclusionPrior | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Judgement:
    """Draw, estimate, rank."""
    prior = InclusionPrior() if prior is None else prior
    experiment = Experiment.of(protocol, prior)
    lines: list[dict[str, Any]] = []
    with threadpool_limits(limits=1, user_api="blas"):
        for index in range(draws):
            rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
            truth, data = draw(experiment, rng)
            found = explore_inclusion(InclusionLikelihood(experiment.model, data), prior)
            lines.append(_line(truth, found.samples))
            if progress is not None:
                progress(index + 1, draws)
    return Judgement.of(lines)


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


def main() -> int:
    """Print a table a protocol."""
    bench = Bench(__doc__, protocol=Several(PROTOCOLS), draws=1000, seed=1)
    prior = InclusionPrior()
    for name in bench.protocol or ALONE:
        with progress_bar(name) as progress:
            found = run(PROTOCOLS[name], bench.draws, seed=bench.seed, prior=prior, progress=progress)
        rows = [*rows_of(found.summary(prior))]
        rows.append(["uniform ranks, chi-square", *(f"{chance:.3g}" for chance in chances(found))])
        bench.table(f"{bench.draws} draws, seed {bench.seed}: {PROTOCOLS[name].described}", (name, *PARAMETERS), rows)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())

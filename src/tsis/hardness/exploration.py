"""The posterior of the modulus by quadrature over what else is unknown of the sphere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.hardness.likelihood import HardnessLikelihood
    from tsis.hardness.prior import HardnessPrior

COARSE, FINE = 120, 240  # moduli on the grid
NEGLIGIBLE = 25.0  # of log likelihood below the best, beyond which nothing is left
RATIOS, RADII, UNKNOWN_RADII = 5, 9, 41
SAMPLES = 4000
SMALLEST_RADIUS_MM = 1.0  # of a sphere of unknown radius


@dataclass(frozen=True, slots=True, kw_only=True)
class RadiusPrior:
    """What is known of the sphere's radius: a value with its standard deviation, or only that it lies in a range.

    Attributes
    ----------
    radius_mm, sd_mm
        None and 0 for a radius of which nobody knows more than that the probe can measure it.
    largest_mm
        The greatest radius that the probe can measure.
    """

    radius_mm: float | None
    sd_mm: float
    largest_mm: float

    def nodes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Radii in mm and the logarithms of their weights."""
        if self.radius_mm is None:
            radii = np.geomspace(SMALLEST_RADIUS_MM, self.largest_mm, UNKNOWN_RADII)
            return radii, np.full(UNKNOWN_RADII, -np.log(UNKNOWN_RADII))
        if self.sd_mm == 0:
            return np.array([self.radius_mm]), np.zeros(1)
        place, weight = np.polynomial.hermite_e.hermegauss(RADII)
        radii = self.radius_mm * np.exp(self.sd_mm / self.radius_mm * place)
        return np.asarray(radii), np.log(weight / weight.sum())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HardnessPosterior:
    """The modulus, and how well the best sphere explains the frames.

    Attributes
    ----------
    young_kpa
        Equally weighted samples, ascending: quantiles, so the same frames give the same ones.
    misfit
        Least squared misfit of the residuals.
    best
        Modulus in kPa, Poisson's ratio and radius in mm of the most likely node.
    """

    young_kpa: NDArray[np.float64]
    misfit: float
    best: tuple[float, float, float]


def explore_modulus(likelihood: HardnessLikelihood, prior: HardnessPrior, radius: RadiusPrior) -> HardnessPosterior:
    """Integrate over Poisson's ratio and radius on nodes, and draw the modulus from a grid in its logarithm."""
    place, weight = np.polynomial.legendre.leggauss(RATIOS)
    low, high = prior.poisson
    ratios, log_ratio = low + (high - low) * (place + 1) / 2, np.log(weight / 2)
    radii, log_radius = radius.nodes()
    nodes = ratios[:, None], radii[None, :]
    log_weight = log_ratio[:, None] + log_radius

    def at(log_young: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        found, misfit = likelihood(np.exp(log_young)[:, None, None], *nodes)
        return found + log_weight, misfit

    coarse = np.linspace(np.log(prior.young_kpa[0]), np.log(prior.young_kpa[1]), COARSE)
    log_young = _where_it_matters(coarse, logsumexp(at(coarse)[0], axis=(1, 2)))
    found, misfit = at(log_young)
    best = np.unravel_index(int(np.argmin(misfit)), misfit.shape)
    return HardnessPosterior(
        young_kpa=np.exp(_quantiles(log_young, logsumexp(found, axis=(1, 2)))),
        misfit=float(misfit.min()),
        best=(float(np.exp(log_young[best[0]])), float(ratios[best[1]]), float(radii[best[2]])),
    )


def _where_it_matters(grid: NDArray[np.float64], log_density: NDArray[np.float64]) -> NDArray[np.float64]:
    """A finer grid over what is not negligible, and one step of the coarse one to both sides."""
    kept = np.flatnonzero(log_density > log_density.max() - NEGLIGIBLE)
    low, high = max(kept[0] - 1, 0), min(kept[-1] + 1, len(grid) - 1)
    return np.linspace(grid[low], grid[high], FINE)


def _quantiles(grid: NDArray[np.float64], log_density: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evenly spaced quantiles of a density that is linear between the grid's points."""
    density = np.exp(log_density - log_density.max())
    share = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    wanted = (np.arange(SAMPLES) + 0.5) / SAMPLES
    return np.asarray(np.interp(wanted, share / share[-1], grid))

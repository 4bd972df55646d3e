"""Priors of a pressed sphere, and the posterior of its modulus on a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.model.require import require_number, require_pair

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.hardness._likelihood import HardnessLikelihood


@dataclass(frozen=True, slots=True, kw_only=True)
class HardnessPrior:
    """Ranges, uniform in the logarithm of the modulus and in Poisson's ratio; `InputError` for an empty or invalid one.

    Parameters
    ----------
    young_kpa
        Least and greatest modulus, within [1, 1e5] kPa.
    poisson
        Least and greatest Poisson's ratio, within [0.45, 0.495].

    Examples
    --------
    >>> HardnessPrior(young_kpa=(20.0, 500.0)).young_kpa
    (20.0, 500.0)
    """

    young_kpa: tuple[float, float] = (10.0, 1000.0)
    poisson: tuple[float, float] = (0.45, 0.495)

    def __post_init__(self) -> None:
        for name, low, high in (("young_kpa", 1.0, 1e5), ("poisson", 0.45, 0.495)):
            least, most = require_pair(name, getattr(self, name))
            require_number(f"{name}[0]", least, low, high)
            require_number(f"{name}[1]", most, low, high)
            if not least < most:
                raise InputError(f"{name} must be a range that ascends; got {(least, most)}")
            object.__setattr__(self, name, (least, most))

    @property
    def young_sd_kpa(self) -> float:
        """Standard deviation of the modulus, kPa."""
        low, high = self.young_kpa
        span = float(np.log(high / low))
        mean, square = (high - low) / span, (high**2 - low**2) / (2 * span)
        return float(np.sqrt(square - mean**2))

    def __str__(self) -> str:
        (low, high), (least, most) = self.young_kpa, self.poisson
        return (
            f"modulus {low:g} to {high:g} kPa, even in its logarithm; Poisson's ratio {least:g} to {most:g}, even; "
            "a homogeneous sphere between a smooth plate and the probe"
        )


COARSE, FINE = 120, 240  # moduli on the grid
NEGLIGIBLE = 25.0  # drop of the log likelihood below the best that is negligible
RATIOS, RADII, UNKNOWN_RADII = 5, 9, 41
SAMPLES = 4000
SMALLEST_RADIUS_MM = 1.0  # of a sphere of unknown radius


@dataclass(frozen=True, slots=True, kw_only=True)
class RadiusPrior:
    """Prior of the sphere's radius: a value with its standard deviation, or a range.

    ``radius_mm`` is None for an unknown radius, up to ``largest_mm``, the largest that the probe can measure.
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
        position, weight = np.polynomial.hermite_e.hermegauss(RADII)
        radii = self.radius_mm * np.exp(self.sd_mm / self.radius_mm * position)
        return np.asarray(radii), np.log(weight / weight.sum())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HardnessPosterior:
    """Posterior of the modulus, and the misfit of the best sphere."""

    young_kpa: NDArray[np.float64]  # equally weighted samples, ascending: quantiles, so equal frames give equal samples
    misfit: float  # least squared misfit of the residuals
    best: tuple[float, float, float]  # modulus in kPa, Poisson's ratio and radius in mm of the most likely node


def explore_modulus(likelihood: HardnessLikelihood, prior: HardnessPrior, radius: RadiusPrior) -> HardnessPosterior:
    """Integrate over Poisson's ratio and radius on nodes, and draw the modulus from a grid in its logarithm."""
    (position, weight), (low, high) = np.polynomial.legendre.leggauss(RATIOS), prior.poisson
    ratios, log_ratio = low + (high - low) * (position + 1) / 2, np.log(weight / 2)
    radii, log_radius = radius.nodes()
    nodes = ratios[:, None], radii[None, :]
    log_weight = log_ratio[:, None] + log_radius

    def at(log_young: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        result, misfit = likelihood(np.exp(log_young)[:, None, None], *nodes)
        return result + log_weight, misfit

    coarse = np.linspace(np.log(prior.young_kpa[0]), np.log(prior.young_kpa[1]), COARSE)
    log_young = _where_it_matters(coarse, scipy.special.logsumexp(at(coarse)[0], axis=(1, 2)))
    result, misfit = at(log_young)
    best = np.unravel_index(int(np.argmin(misfit)), misfit.shape)
    return HardnessPosterior(
        young_kpa=np.exp(_quantiles(log_young, scipy.special.logsumexp(result, axis=(1, 2)))),
        misfit=float(misfit.min()),
        best=(float(np.exp(log_young[best[0]])), float(ratios[best[1]]), float(radii[best[2]])),
    )


def modulus_samples(
    log_likelihood: Callable[[NDArray[np.float64]], NDArray[np.float64]], prior: HardnessPrior
) -> NDArray[np.float64]:
    """Equally weighted samples of the modulus in kPa, ascending, for a log likelihood of moduli, shape (n,)."""
    coarse = np.linspace(np.log(prior.young_kpa[0]), np.log(prior.young_kpa[1]), COARSE)
    log_young = _where_it_matters(coarse, log_likelihood(np.exp(coarse)))
    return np.exp(_quantiles(log_young, log_likelihood(np.exp(log_young))))


def _where_it_matters(grid: NDArray[np.float64], log_density: NDArray[np.float64]) -> NDArray[np.float64]:
    """A finer grid over the part that is not negligible, a coarse step wider on both sides."""
    inside = np.flatnonzero(log_density > log_density.max() - NEGLIGIBLE)
    low, high = max(inside[0] - 1, 0), min(inside[-1] + 1, len(grid) - 1)
    return np.linspace(grid[low], grid[high], FINE)


def _quantiles(grid: NDArray[np.float64], log_density: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evenly spaced quantiles of a density that is linear between the grid's points."""
    density = np.exp(log_density - log_density.max())
    cumulative = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    levels = (np.arange(SAMPLES) + 0.5) / SAMPLES
    return np.asarray(np.interp(levels, cumulative / cumulative[-1], grid))

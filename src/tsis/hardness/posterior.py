"""Prior, likelihood and posterior of a pressed sphere: contact radii and light tell its modulus on a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.model.require import require_number, require_pair

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.hardness.reading import ContactReading
    from tsis.hardness.table import ContactTable
    from tsis.model.calibration import Calibration


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
        log_density, misfit = likelihood(np.exp(log_young)[:, None, None], *nodes)
        return log_density + log_weight, misfit

    coarse = np.linspace(np.log(prior.young_kpa[0]), np.log(prior.young_kpa[1]), COARSE)
    log_young = _where_it_matters(coarse, scipy.special.logsumexp(at(coarse)[0], axis=(1, 2)))
    log_density, misfit = at(log_young)
    best = np.unravel_index(int(np.argmin(misfit)), misfit.shape)
    return HardnessPosterior(
        young_kpa=np.exp(_quantiles(log_young, scipy.special.logsumexp(log_density, axis=(1, 2)))),
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


DRIFT_SD = 0.003  # relative standard deviation of the lamps from press to press
STEP = 0.01  # of the logarithms by which derivatives are taken
OWN_FRACTION = 0.5  # of the table's squared error, independent in each press; the rest is common to a sphere's presses
RIGID_KPA, RIGID_POISSON = 1e8, 0.3  # of a steel ball: all of the compliance is the probe's


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactPress:
    """One press as measured by gauge and camera."""

    force_n: float  # by the gauge
    seen: ContactReading  # from the frame
    ball_radius_mm: float | None = None  # of the pressed rigid ball; None for the object
    ball_radius_sd: float = 0.0  # relative standard deviation of that radius


class HardnessLikelihood:
    """Normal errors of the logarithms of radius and light, with all nuisances but three integrated out.

    Errors of a contact radius come from image, table, and from force and probe modulus through the contact mechanics.
    Errors of the light come from image, force, drift of the lamps and gain. Gain and probe modulus are common to all
    presses. Modulus, Poisson's ratio and radius of the sphere are arguments.
    """

    def __init__(
        self, presses: Sequence[ContactPress], *, table: ContactTable, calibration: Calibration, drift_sd: float
    ) -> None:
        self.presses, self.table = tuple(presses), table
        self._calibration, self._drift_sd = calibration, drift_sd
        self.log_radius = np.log([press.seen.radius_mm for press in presses])
        self.log_light = np.log([press.seen.light_force_n / press.force_n for press in presses])
        light = calibration.gain_sd**2 + np.zeros((len(presses), len(presses)))
        own = np.array([press.seen.light_force_sd**2 for press in presses]) + drift_sd**2 + calibration.force_sd**2
        self._light = light + np.diag(own)

    def __call__(self, young_kpa: Any, poisson: Any, radius_mm: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Log likelihood and squared misfit, of the shape of the arguments, which broadcast."""
        residual, covariance = self.residuals(young_kpa, poisson, radius_mm)
        factor = np.linalg.cholesky(covariance)
        white = np.linalg.solve(factor, residual[..., None])[..., 0]
        misfit = (white**2).sum(axis=-1)
        volume = np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(axis=-1)
        return -misfit / 2 - volume, misfit

    def residuals(
        self, young_kpa: Any, poisson: Any, radius_mm: Any
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Residuals of all radii, then all lights, as a last axis, and their covariance."""
        young_kpa, poisson, radius_mm = np.broadcast_arrays(young_kpa, poisson, radius_mm)
        shape, count = young_kpa.shape, len(self.presses)
        residual = np.zeros((*shape, 2 * count))
        by_force, by_probe, by_ball, error = np.zeros((4, *shape, count))
        for index, press in enumerate(self.presses):
            sphere = (young_kpa, poisson, radius_mm)
            if press.ball_radius_mm is not None:
                sphere = (
                    np.full(shape, RIGID_KPA),
                    np.full(shape, RIGID_POISSON),
                    np.full(shape, press.ball_radius_mm),
                )
            here = self.table.log_radius(*sphere, press.force_n)
            by_force[..., index] = (self.table.log_radius(*sphere, press.force_n * np.exp(STEP)) - here) / STEP
            stiffer = self.table.log_radius(*sphere, press.force_n, probe_factor=np.exp(STEP))
            by_probe[..., index] = (stiffer - here) / STEP
            residual[..., index] = self.log_radius[index] - here
            error[..., index] = self.table.error_at(*self.table.coordinates(*sphere, press.force_n))
            if press.ball_radius_mm is not None:
                wider = self.table.log_radius(*sphere[:2], sphere[2] * np.exp(STEP), press.force_n)
                by_ball[..., index] = press.ball_radius_sd * (wider - here) / STEP
        residual[..., count:] = self.log_light
        return residual, self._covariance(by_force, by_probe, by_ball, error)

    def _covariance(
        self,
        by_force: NDArray[np.float64],
        by_probe: NDArray[np.float64],
        by_ball: NDArray[np.float64],
        error: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        count, calibration = len(self.presses), self._calibration
        ball = np.array([press.ball_radius_mm is not None for press in self.presses])
        same = ball[:, None] == ball  # presses of one body have the ball's radius and the table's error in common
        image = np.array([press.seen.radius_sd**2 for press in self.presses])
        shared = (1 - OWN_FRACTION) * same + OWN_FRACTION * np.eye(count)
        radius = np.diag(image) + shared * error[..., :, None] * error[..., None, :]
        radius = radius + calibration.probe_young_sd**2 * by_probe[..., :, None] * by_probe[..., None, :]
        radius = radius + by_ball[..., :, None] * by_ball[..., None, :] * same
        own_force = calibration.force_sd**2 * np.eye(count)
        radius = radius + own_force * by_force[..., :, None] * by_force[..., None, :]
        both = own_force * by_force[..., :, None]
        light = np.broadcast_to(self._light, radius.shape)
        upper = np.concatenate([radius, both], axis=-1)
        lower = np.concatenate([np.swapaxes(both, -1, -2), light], axis=-1)
        return np.concatenate([upper, lower], axis=-2)

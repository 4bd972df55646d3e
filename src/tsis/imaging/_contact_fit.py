"""The ellipse of a contact, by least squares on the change of a gel sensor's frame.

Inside the contact the gel has the object's shape: for a ball the slope, as a part of the unit normal, is linear in the
distance from the centre. Coloured lamps code the slope, which falls outside as under Hertz's pressure, faster on a thin
gel. White light codes the depth, a smooth hill without an edge: its width is that of the contact only through the
layer's mechanics, so that the gel's thickness and Poisson's ratio stay within the sensor's limits. Which colour a slope
has nobody knows, so that a polynomial with free coefficients in each channel stands for the lamps (variable projection,
Golub & Pereyra, Inverse Problems 19, R1, 2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.imaging._filters import gaussian_blur
from tsis.mechanics.gel import layer_compliance

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.optimize import OptimizeResult


WINDOW_SLOPE, WINDOW_DEPTH = 1.5, 2.0  # half width of the fitted window, in contact radii
DEGREE = 3  # of the polynomial of the lamps
BLUR = 0.06  # of the contact radius, where the fit of the optics' blur starts
LIMITS = np.array([0.8, 0.8, 0.6, 0.4, 0.4, 2.5, 1.5])  # of the parameters about their start
STEEPEST = 0.95  # sine of the slope at the edge of a contact
SHARPEST = 1.0  # limit of the logarithm of the blur under white light
FIXED = 1e-6  # limit of a parameter that is known
FEWEST_PIXELS = 60
RIDGE = 1e-9
_GRID = np.linspace(0.0, 6.0, 301)
_RATIOS = np.geomspace(0.05, 3.0, 18)  # contact radius over thickness
_POISSON = np.array([0.40, 0.45, 0.475, 0.49, 0.499])
_WAVES, _LAST_WAVE = 400, 60.0  # wave numbers times the contact's radius


@dataclass(frozen=True, slots=True, kw_only=True)
class GelLayer:
    """What is known of a gel under white light: limits of its thickness in pixels, and of Poisson's ratio."""

    thickness_px: tuple[float, float]
    poisson: tuple[float, float]

    def scaled(self, times: float) -> GelLayer:
        """The layer in pixels that are smaller by that factor."""
        low, high = self.thickness_px
        return GelLayer(thickness_px=(low * times, high * times), poisson=self.poisson)


@cache
def layer_hills() -> NDArray[np.float64]:
    """Depth of a bonded layer under a paraboloid over `_GRID`, 1 at the middle; shape (ratios, Poisson's, places).

    The pressure is a sum of ``(1 - rho²)^(m - 1/2)``, m = 1, 2, 3, collocated inside the contact (Johnson, Contact
    Mechanics, 5.8); the modulus cancels.
    """
    node, weight = np.polynomial.legendre.leggauss(_WAVES)
    wave, weight = _LAST_WAVE * (node + 1.0) / 2.0, _LAST_WAVE * weight / 2.0
    power = np.arange(3) + 0.5
    transform = (
        2.0**power
        * scipy.special.gamma(power + 1.0)
        * scipy.special.jv(power + 1.0, wave[:, None])
        / wave[:, None] ** power
    )
    bessel, touched = scipy.special.j0(np.outer(_GRID, wave)), np.linspace(0.0, 0.97, 16)
    within, inside = scipy.special.j0(np.outer(touched, wave)), _GRID <= 1.0
    result = np.empty((_RATIOS.size, _POISSON.size, _GRID.size))
    for row, ratio in enumerate(_RATIOS):
        for column, poisson in enumerate(_POISSON):
            layer = layer_compliance(wave, young_kpa=1.0, poisson=float(poisson), thickness_mm=float(1.0 / ratio))
            spectrum = (weight * layer.normal)[:, None] * transform
            system = np.column_stack([within @ spectrum, -np.ones(touched.size)])
            *pressure, depth = np.linalg.lstsq(system, -(touched**2) / 2.0, rcond=1e-10)[0]
            hill = bessel @ spectrum @ np.asarray(pressure)
            hill[inside] = depth - _GRID[inside] ** 2 / 2.0
            result[row, column] = hill / depth
    return result


def layer_hill(ratio: float, poisson: float) -> NDArray[np.float64]:
    """`layer_hills` between its nodes."""
    row = float(np.interp(np.log(ratio), np.log(_RATIOS), np.arange(_RATIOS.size)))
    column = float(np.interp(poisson, _POISSON, np.arange(_POISSON.size)))
    i, j = min(int(row), _RATIOS.size - 2), min(int(column), _POISSON.size - 2)
    part = layer_hills()[i : i + 2, j : j + 2]
    return np.asarray(np.einsum("i,j,ijk->k", (i + 1 - row, row - i), (j + 1 - column, column - j), part))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactFit:
    """An ellipse with its uncertainty, lengths in pixels.

    Attributes
    ----------
    centre, semi_axes, angle_deg
        Centre (x, y), long and short semi-axis, angle of the long one from x towards y.
    centre_sd, radius_sd
        Standard deviations of the fit alone; the radius is the geometric mean of the axes.
    explained
        Fraction of the change in the window that the fit explains.
    amplitude
        Root mean square of the fitted change inside the contact, grey levels.
    patch_variance
        Mean square residual times the pixels that err together, square grey levels.
    """

    centre: tuple[float, float]
    semi_axes: tuple[float, float]
    angle_deg: float
    centre_sd: tuple[float, float]
    radius_sd: float
    explained: float
    amplitude: float
    patch_variance: float

    @property
    def radius(self) -> float:
        """Radius of the circle of the same area."""
        return float(np.sqrt(self.semi_axes[0] * self.semi_axes[1]))


def outer_slope(rho: NDArray[np.float64], length: float, steepness: float = 0.0) -> NDArray[np.float64]:
    """Sine of the face's slope over the distance in contact radii, 1 at the edge.

    Outside, the tangent is Hertz's with a faster decay; ``steepness`` is the sine at the edge, 0 for a shallow press.
    """
    outside = np.maximum(rho, 1.0)
    inverse = 1.0 / outside
    hertz = (2.0 / np.pi) * outside * (np.arcsin(inverse) - inverse * np.sqrt(np.maximum(1.0 - inverse**2, 0.0)))
    tangent = hertz * np.exp(-(outside - 1.0) / length)
    sine = tangent / np.sqrt(1.0 + steepness**2 * (tangent**2 - 1.0))
    return np.where(rho < 1.0, rho, sine)


class _Window:
    """The change about a place and the weight of each pixel; residuals of ellipses in units of the start's radius."""

    def __init__(
        self,
        change: NDArray[np.float64],
        weight: NDArray[np.float64],
        centre: tuple[float, float],
        radius: float,
        gel: GelLayer | None,
    ) -> None:
        slope = gel is None
        half = (WINDOW_SLOPE if slope else WINDOW_DEPTH) * radius + 2.0
        rows, columns = weight.shape
        left, top = max(int(centre[0] - half), 0), max(int(centre[1] - half), 0)
        part = np.s_[top : min(int(centre[1] + half) + 2, rows), left : min(int(centre[0] + half) + 2, columns)]
        self.radius, self.gel = radius, gel
        self.weight = np.sqrt(weight[part])
        shape = self.weight.shape
        y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
        self.x, self.y = (x + (left - centre[0])) / radius, (y + (top - centre[1])) / radius
        self.data = (change[part] * self.weight[..., None]).reshape(-1, change.shape[2])
        used = self.weight.ravel() > 0
        self.pixels = int(np.count_nonzero(used))
        self.energy = float(np.square(self.data[used] - self.data[used].mean(axis=0)).sum()) if self.pixels else 0.0

    def shapes(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Columns that explain the change for an ellipse, weighted."""
        u, v, rho = self.reduced(parameters)
        blur = float(BLUR * self.radius * np.exp(parameters[6]))
        if self.gel is None:
            along = outer_slope(rho, float(np.exp(parameters[5])), float(parameters[7])) / np.maximum(rho, 1e-9)
            first, second = (gaussian_blur(along * part, (blur, blur), mode="nearest") for part in (u, v))
            one = np.ones_like(rho)  # products are faster than powers
            across, down = ([one, *accumulate([part] * DEGREE, np.multiply)] for part in (first, second))
            shapes = [across[i] * down[j] for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i) if (i, j) != (0, 0)]
            # Near lamps light the two sides of a contact differently.
            shapes += [part * place for part in (first, second) for place in (self.x, self.y)]
        else:
            ratio = self.radius * float(np.exp(parameters[2] - parameters[5]))
            hill = layer_hill(ratio, float(parameters[7]))
            depth = gaussian_blur(np.interp(rho, _GRID, hill), (blur, blur), mode="nearest")
            # The last shape is the ring of light around a press of a translucent gel, flat at the edge of the contact.
            beyond = np.maximum(rho - 1.0, 0.0)
            shapes = [depth, depth**2, beyond**2 * np.exp(-beyond / 0.25)]
        columns = np.stack([*shapes, np.ones_like(rho), self.x, self.y], axis=-1) * self.weight[..., None]
        return np.asarray(columns.reshape(self.weight.size, -1))

    def reduced(self, parameters: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Components (u, v) of the distance from the centre in units of the ellipse, and its size."""
        x, y, size = self.x - parameters[0], self.y - parameters[1], float(np.exp(parameters[2]))
        # The log aspect as a symmetric matrix without trace has no singular direction at the circle.
        half = float(np.hypot(parameters[3], parameters[4]))
        turn = np.sinh(half) / half if half > 1e-12 else 1.0
        a, b, c = np.cosh(half) - turn * parameters[3], -turn * parameters[4], np.cosh(half) + turn * parameters[3]
        u, v = (a * x + b * y) / size, (b * x + c * y) / size
        return u, v, np.hypot(u, v)

    def fitted(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """The change as the best weights of the shapes explain it."""
        shapes = self.shapes(parameters)
        normal = shapes.T @ shapes
        normal[np.diag_indices_from(normal)] += RIDGE * np.trace(normal)
        return np.asarray(shapes @ np.linalg.solve(normal, shapes.T @ self.data))

    def residual(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is left of the change."""
        return np.asarray((self.data - self.fitted(parameters)).ravel())

    def start(self, factor: float) -> NDArray[np.float64]:
        """Parameters of a circle of a radius relative to the window's."""
        if self.gel is None:
            return np.array([0.0, 0.0, np.log(factor), 0.0, 0.0, 0.0, 0.0, STEEPEST / 2])
        thickness, poisson = np.mean(np.log(self.gel.thickness_px)), np.mean(self.gel.poisson)
        return np.array([0.0, 0.0, np.log(factor), 0.0, 0.0, thickness, 0.0, poisson])

    def limits(self, *, ellipse: bool) -> NDArray[np.float64]:
        """Largest distances of the parameters from their start."""
        limits = LIMITS.copy()
        if not ellipse:
            limits[3:5] = FIXED
        if self.gel is None:
            return np.append(limits, STEEPEST / 2)
        limits[6] = SHARPEST
        limits[5] = max(float(np.ptp(np.log(self.gel.thickness_px))) / 2.0, FIXED)
        return np.append(limits, max(float(np.ptp(self.gel.poisson)) / 2.0, FIXED))


def fit_contact(
    change: NDArray[np.float64],
    weight: NDArray[np.float64],
    centre: tuple[float, float],
    radius: float,
    *,
    gel: GelLayer | None = None,
    starts: tuple[float, ...] = (1.0,),
    ellipse: bool = False,
) -> ContactFit | None:
    """Fit a contact near a place, as a circle or an ellipse.

    Parameters
    ----------
    change
        Change against the reference, shape (rows, columns, channels).
    weight
        Weight of each pixel, 0 for one that must not count, shape (rows, columns).
    centre, radius
        Where to start, pixels.
    gel
        The layer where the change follows the depth (white light); None where it follows the slope (coloured lamps).
    starts
        Radii from which to start, relative to ``radius``; the fit that leaves least of the same window is taken.
    ellipse
        Whether the axes may differ.

    Returns
    -------
    ContactFit or None
        None where too few pixels can be used.
    """
    # One window for all starts: a small window lies inside the contact, where any radius explains the change.
    window = _Window(change, weight, centre, max(starts) * radius, gel)
    if window.pixels < FEWEST_PIXELS or window.energy <= 0.0:
        return None
    solutions = [_solved(window, factor / max(starts), ellipse=ellipse) for factor in starts]
    fits = [_result(window, solution, centre, window.limits(ellipse=ellipse)) for solution in solutions]
    return joined_fits(fits, [float(solution.cost) for solution in solutions])


def _solved(window: _Window, factor: float, *, ellipse: bool) -> OptimizeResult:
    start, limits = window.start(factor), window.limits(ellipse=ellipse)
    free = limits > FIXED

    def whole(values: NDArray[np.float64]) -> NDArray[np.float64]:
        result = start.copy()
        result[free] = values
        return result

    def left(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return window.residual(whole(values))

    found = scipy.optimize.least_squares(
        left,
        start[free],
        bounds=((start - limits)[free], (start + limits)[free]),
        x_scale=0.1,
        diff_step=np.full(np.count_nonzero(free), 1e-3),
        xtol=1e-4,
        ftol=1e-5,
        max_nfev=25,
    )
    jacobian = np.zeros((found.fun.size, start.size))
    jacobian[:, free] = np.asarray(found.jac)
    found.x, found.jac = whole(found.x), jacobian
    return found


def joined_fits(fits: list[ContactFit], costs: list[float]) -> ContactFit:
    """The best fit; its radius is as uncertain as the radii of the other minima, weighted by their evidence."""
    best = int(np.argmin(costs))
    variance, radii = fits[best].patch_variance, np.array([fit.radius for fit in fits])
    if variance <= 0.0:
        return fits[best]
    weight = np.exp(-np.minimum((np.array(costs) - costs[best]) / variance, 500.0))
    spread = float((weight * (radii - radii[best]) ** 2).sum() / weight.sum())
    return replace(fits[best], radius_sd=float(np.sqrt(fits[best].radius_sd ** 2 + spread)))


def _result(
    window: _Window, solution: OptimizeResult, start: tuple[float, float], limits: NDArray[np.float64]
) -> ContactFit:
    x, jacobian, residual = solution.x, solution.jac, solution.fun
    left = residual.reshape(*window.weight.shape, -1)
    variance = float(np.square(residual).sum()) / max(window.pixels * left.shape[-1], 1)
    # Residuals of the model's own errors are correlated: they count by their patches, not by their pixels.
    variance *= _correlated_pixels(left)
    # The limits count as priors, so that a parameter that the frame does not tell widens the radius by them alone.
    prior = 3.0 * variance / np.square(limits)
    variances = np.diag(np.linalg.inv(jacobian.T @ jacobian + np.diag(prior))) * variance
    half, radius = float(np.hypot(x[3], x[4])), window.radius * float(np.exp(x[2]))
    inside = (window.reduced(x)[2] < 1.0).ravel() & (window.weight.ravel() > 0)
    fitted = window.fitted(x)
    part = fitted[inside] - fitted[~inside].mean(axis=0) if inside.any() and not inside.all() else np.zeros((1, 1))
    return ContactFit(
        centre=(start[0] + float(x[0]) * window.radius, start[1] + float(x[1]) * window.radius),
        semi_axes=(radius * float(np.exp(half)), radius * float(np.exp(-half))),
        angle_deg=float(0.5 * np.degrees(np.arctan2(x[4], x[3]))) if half > 1e-5 else 0.0,
        centre_sd=(window.radius * float(np.sqrt(variances[0])), window.radius * float(np.sqrt(variances[1]))),
        radius_sd=radius * float(np.sqrt(variances[2])),
        explained=1.0 - float(np.square(residual).sum()) / window.energy,
        amplitude=float(np.sqrt(np.square(part).sum(axis=1).mean())),
        patch_variance=variance,
    )


def _correlated_pixels(residual: NDArray[np.float64]) -> float:
    """Pixels that err together, from the correlation of neighbours along both axes."""
    total = float(np.square(residual).sum())
    if total <= 0.0:
        return 1.0
    across = float((residual[:, 1:] * residual[:, :-1]).sum()) / total
    down = float((residual[1:] * residual[:-1]).sum()) / total
    lags = [min(max(lag, 0.0), 0.95) for lag in (across, down)]
    return float(np.prod([(1.0 + lag) / (1.0 - lag) for lag in lags]))


def rescaled_point(point: tuple[float, float], step: int, new: int) -> tuple[float, float]:
    """A point in pixels of another step."""
    x, y = ((part + 0.5) * step / new - 0.5 for part in point)
    return x, y


def rescaled_fit(fit: ContactFit, step: int, new: int) -> ContactFit:
    """The fit in pixels of another step."""
    times = step / new
    return replace(
        fit,
        centre=rescaled_point(fit.centre, step, new),
        semi_axes=(fit.semi_axes[0] * times, fit.semi_axes[1] * times),
        centre_sd=(fit.centre_sd[0] * times, fit.centre_sd[1] * times),
        radius_sd=fit.radius_sd * times,
    )

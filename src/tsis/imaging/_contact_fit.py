"""The ellipse of a contact, by least squares on the change of a gel sensor's frame.

Inside the contact the gel has the object's shape: for a ball the slope, as a part of the unit normal, is linear in the
distance from the centre. Outside it falls as under Hertz's pressure, faster on a thin gel. Coloured lamps code the
slope, white light the depth, its integral. Which colour a slope has nobody knows, so that a polynomial with free
coefficients in each channel stands for the lamps (variable projection, Golub & Pereyra, Inverse Problems 19, R1, 2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from tsis.imaging._filters import gaussian_blur

if TYPE_CHECKING:
    from numpy.typing import NDArray


WINDOW_SLOPE, WINDOW_DEPTH = 1.5, 2.0  # half width of the fitted window, in contact radii
DEGREE = 3  # of the polynomial of the lamps
BLUR = 0.06  # of the contact radius, where the fit of the optics' blur starts
LIMITS = np.array([0.8, 0.8, 0.6, 0.4, 0.4, 2.5, 1.5])  # of the parameters about their start
FEWEST_PIXELS = 60
RIDGE = 1e-9
_GRID = np.linspace(0.0, 6.0, 601)


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
    """

    centre: tuple[float, float]
    semi_axes: tuple[float, float]
    angle_deg: float
    centre_sd: tuple[float, float]
    radius_sd: float
    explained: float
    amplitude: float

    @property
    def radius(self) -> float:
        """Radius of the circle of the same area."""
        return float(np.sqrt(self.semi_axes[0] * self.semi_axes[1]))


def outer_slope(rho: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Slope of the face over the distance in contact radii, 1 at the edge; outside Hertz's with a faster decay."""
    outside = np.maximum(rho, 1.0)
    inverse = 1.0 / outside
    hertz = (2.0 / np.pi) * outside * (np.arcsin(inverse) - inverse * np.sqrt(np.maximum(1.0 - inverse**2, 0.0)))
    return np.where(rho < 1.0, rho, hertz * np.exp(-(outside - 1.0) / length))


class _Window:
    """The change about a place and the weight of each pixel; residuals of ellipses in units of the start's radius."""

    def __init__(
        self,
        change: NDArray[np.float64],
        weight: NDArray[np.float64],
        centre: tuple[float, float],
        radius: float,
        slope: bool,
    ) -> None:
        half = (WINDOW_SLOPE if slope else WINDOW_DEPTH) * radius + 2.0
        rows, columns = weight.shape
        left, top = max(int(centre[0] - half), 0), max(int(centre[1] - half), 0)
        part = np.s_[top : min(int(centre[1] + half) + 2, rows), left : min(int(centre[0] + half) + 2, columns)]
        self.radius, self.slope = radius, slope
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
        length, blur = float(np.exp(parameters[5])), float(BLUR * self.radius * np.exp(parameters[6]))
        if self.slope:
            along = outer_slope(rho, length) / np.maximum(rho, 1e-9)
            first, second = (gaussian_blur(along * part, (blur, blur), mode="nearest") for part in (u, v))
            shapes = [
                first**i * second**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i) if (i, j) != (0, 0)
            ]
        else:
            slope = outer_slope(_GRID, length)
            fallen = np.concatenate([[0.0], np.cumsum(slope[1:] + slope[:-1])])
            depth = gaussian_blur(np.interp(rho, _GRID, 1.0 - fallen / fallen[-1]), (blur, blur), mode="nearest")
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


def fit_contact(
    change: NDArray[np.float64],
    weight: NDArray[np.float64],
    centre: tuple[float, float],
    radius: float,
    *,
    slope: bool,
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
    slope
        Whether the change follows the slope (coloured lamps) or the depth (white light).
    starts
        Radii from which to start, relative to ``radius``; the fit that explains most is taken.
    ellipse
        Whether the axes may differ.

    Returns
    -------
    ContactFit or None
        None where too few pixels can be used.
    """
    best: tuple[float, _Window, object] | None = None
    for factor in starts:
        window = _Window(change, weight, centre, factor * radius, slope)
        if window.pixels < FEWEST_PIXELS or window.energy <= 0.0:
            continue
        limits = LIMITS.copy()
        if not ellipse:
            limits[3:5] = 1e-6
        solution = least_squares(
            window.residual,
            np.zeros(7),
            bounds=(-limits, limits),
            x_scale=0.1,
            diff_step=np.full(7, 1e-3),
            xtol=1e-4,
            ftol=1e-5,
            max_nfev=25,
        )
        left = 2.0 * float(solution.cost) / window.energy
        if best is None or left < best[0]:
            best = left, window, solution
    return None if best is None else _result(*best[1:], centre)


def _result(window: _Window, solution: object, start: tuple[float, float]) -> ContactFit:
    x: NDArray[np.float64] = solution.x  # type: ignore[attr-defined]
    jacobian: NDArray[np.float64] = solution.jac  # type: ignore[attr-defined]
    residual: NDArray[np.float64] = solution.fun  # type: ignore[attr-defined]
    left = residual.reshape(*window.weight.shape, -1)
    variance = float(np.square(residual).sum()) / max(window.pixels * left.shape[-1], 1)
    free = np.sqrt(np.square(jacobian).sum(axis=0)) > 0
    normal = jacobian[:, free].T @ jacobian[:, free]
    normal[np.diag_indices_from(normal)] *= 1.0 + 1e-6
    # Residuals of the model's own errors are correlated: they count by their patches, not by their pixels.
    variances = np.zeros(7)
    variances[free] = np.diag(np.linalg.pinv(normal)) * variance * _correlated_pixels(left)
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

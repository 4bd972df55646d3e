"""Contacts in frames of a gel sensor: an ellipse by least squares, its standard deviations, a quality with reasons.

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
from heapq import heappop, heappush
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.imaging.gel_change import GelChange, gel_change, gel_levels, gel_reference, marker_pixels
from tsis.imaging.pixels import block_means
from tsis.mechanics.gel.contact import layer_compliance

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from tsis.model.gel_sensor import GelSensor


WINDOW_SLOPE, WINDOW_DEPTH = 1.5, 2.0  # half width of the fitted window, in contact radii
DEGREE = 3  # of the polynomial of the lamps
BLUR = 0.06  # of the contact radius, where the fit of the optics' blur starts
LIMITS = np.array([0.8, 0.8, 0.6, 0.4, 0.4, 2.5, 1.5])  # of the parameters about their start
STEEPEST = 0.7  # sine of the slope at the edge of a contact; the profile of steeper ones is not told from a wider one
SHARPEST = 1.0  # limit of the logarithm of the blur under white light
AT_LIMIT, UNKNOWN_SD = 0.98, 0.25  # share of that limit from which the radius is not known, and its relative sd then
FIXED = 1e-6  # limit of a parameter that is known
FEWEST_PIXELS = 60
TEXTURE_FALL = 0.5  # power of 1 - rho² by which the variance of a texture's imprint falls to the edge
TEXTURE_LEAK, TEXTURE_REACH = 0.1, 0.1  # the part of it that reaches beyond the edge, and how far, in radii
TEXTURE_BLUR = 0.2  # of the radius: what is explained of a textured contact is judged after this blur
OUTSIDE = 1.2  # radii from the centre, where no texture is
LEAST_EVEN = 0.3  # square levels
MOST_TEXTURE = 3.0  # of the logarithm of the texture's variance, about its start
RIDGE = 1e-9
BLUR_STEP, FINEST_BLUR = 1.1, 50.0  # ratio of the blurs that are tabulated, and its power at the finest
STEP = 1e-4  # of the parameters, for derivatives
MOST_STEPS, MOST_TRIES, LEAST_GAIN = 25, 6, 1e-5
PROFILE = slice(5, 8)  # parameters of the slope's decay or the layer, the blur, and the steepness or Poisson's ratio
LEAST_TEXTURE = 0.05  # of the logarithm of a texture's variance
SEARCH_COLUMNS = 160  # a search does not need more
TEXTURED, TEXTURED_STARTS = 0.95, (0.75, 1.0, 1.35)  # explained fraction below which a texture is tried, and radii
START_RADIUS_PX, FITTED_RADIUS_PX = 8.0, 15.0  # of a first and of the last fit: block means of larger contacts
MANY_MINIMA = 0.3  # standard deviation of the radius over it, which only several minima give
ROUND = 0.995  # explained fraction beyond which unequal axes can not explain clearly more
STARTS, AGAIN = (0.65, 0.85, 1.1), (0.6, 0.8, 1.0, 1.25)  # radii of a first and a second fit, relative
PEAK_NOISE = 8.0  # times the noise of the smoothed change
LEAST_CHANGE = 3.0  # levels
CENTRE_MODEL_SD = 0.03  # of the radius: what the fit's model misses
RADIUS_MODEL_SD = {"rgb": 0.008, "white": 0.01}  # of the radius, by rendered frames (seeds 501 and 8804)
LEAST_EXPLAINED, LEAST_TEXTURED = 0.6, 0.94  # of the change by a good contact; of a textured one after its blur
# By rendered frames (benchmarks/textured_contacts.py, seed 8804): of the radius of textured objects, and of the blur of
# the edge beyond that of the optics, which may be the object's own softness.
TEXTURED_MODEL_SD = {"rgb": 0.03, "white": 0.06}
SOFT_EDGE_SD = 0.4
LEAST_QUALITY, REFUSED_QUALITY = 0.5, 0.45  # of a good contact; of one with a reason against it, at most
MOVED = 0.1  # of the radius, between frames of a sequence
MOST_HERE = 0.34  # of the frames whose median is the reference: with a contact at one place, or with none
LARGEST_SHIFT = 0.45  # of the markers' pitch, from the movement of the neighbours: beyond it another may be meant
NEIGHBOURS = 1.6  # pitches
FEWEST_MARKER_PX, MOST_MARKER = 4, 0.5  # pixels of a marker, and its size over the pitch
_GRID = np.linspace(0.0, 6.0, 301)
_RATIOS = np.geomspace(0.05, 3.0, 18)  # contact radius over thickness
_POISSON = np.array([0.40, 0.45, 0.475, 0.49, 0.499])
_WAVES, _LAST_WAVE = 400, 60.0  # wave numbers times the contact's radius
REASONS = {
    "no contact": "nothing changed against the reference: press harder, or check the reference",
    "poor fit": "no ellipse explains the change: press with a smoother part of the object",
    "glare": "clipped pixels cover the contact: lower the exposure, or press elsewhere",
    "cut by the border": "a part of the contact is outside the frame: press nearer to the middle",
    "several contacts": "another contact is as strong: press with one",
    "moving": "the contact moved since the frame before: hold still, or take a later frame",
    "marker pattern": "markers cover much of the contact: press deeper, or use a gel without markers",
    "no reference": "too many frames are pressed here, or show nothing, for their median to be that of the untouched "
    "sensor: give a frame of it as reference",
    "uncertain": "the radius is not known within 15 %: press deeper, or reduce noise",
}


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
def _layer_hills() -> NDArray[np.float64]:
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
    hills = np.empty((_RATIOS.size, _POISSON.size, _GRID.size))
    for row, ratio in enumerate(_RATIOS):
        for column, poisson in enumerate(_POISSON):
            layer = layer_compliance(wave, young_kpa=1.0, poisson=float(poisson), thickness_mm=float(1.0 / ratio))
            spectrum = (weight * layer.normal)[:, None] * transform
            system = np.column_stack([within @ spectrum, -np.ones(touched.size)])
            *pressure, depth = np.linalg.lstsq(system, -(touched**2) / 2.0, rcond=1e-10)[0]
            hill = bessel @ spectrum @ np.asarray(pressure)
            hill[inside] = depth - _GRID[inside] ** 2 / 2.0
            hills[row, column] = hill / depth
    return hills


def layer_hill(ratio: float, poisson: float) -> NDArray[np.float64]:
    """`_layer_hills` between its nodes."""
    row = float(np.interp(np.log(ratio), np.log(_RATIOS), np.arange(_RATIOS.size)))
    column = float(np.interp(poisson, _POISSON, np.arange(_POISSON.size)))
    i, j = min(int(row), _RATIOS.size - 2), min(int(column), _POISSON.size - 2)
    part = _layer_hills()[i : i + 2, j : j + 2]
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
    textured
        Whether the imprint of a texture was counted, which makes the edge less sharp.
    edge_blur
        Standard deviation of the blur of the fitted edge, as a fraction of the radius.
    """

    centre: tuple[float, float]
    semi_axes: tuple[float, float]
    angle_deg: float
    centre_sd: tuple[float, float]
    radius_sd: float
    explained: float
    amplitude: float
    patch_variance: float
    textured: bool = False
    edge_blur: float = 0.0

    @property
    def radius(self) -> float:
        """Radius of the circle of the same area."""
        return float(np.sqrt(self.semi_axes[0] * self.semi_axes[1]))


def _outer_slope(rho: NDArray[np.float64], length: float, steepness: float = 0.0) -> NDArray[np.float64]:
    """Sine of the face's slope over the distance in contact radii, 1 at the edge; ``steepness`` is the sine there."""
    # Outside, the tangent is Hertz's with a faster decay.
    outside = np.maximum(rho, 1.0)
    inverse = 1.0 / outside
    hertz = (2.0 / np.pi) * outside * (np.arcsin(inverse) - inverse * np.sqrt(np.maximum(1.0 - inverse**2, 0.0)))
    tangent = hertz * np.exp(-(outside - 1.0) / length)
    sine = tangent / np.sqrt(1.0 + steepness**2 * (tangent**2 - 1.0))
    return np.where(rho < 1.0, rho, sine)


# Nodes of a profile over the distance from the centre in contact radii, closer at the edge of the contact.
_NODES = np.concatenate(
    [np.arange(0.0, 0.7, 0.05), np.arange(0.7, 1.4, 0.02), np.arange(1.4, 3.0, 0.05), [3.3, 4.0, 6.0]]
)


@cache
def _blur_matrix(step: int, order: int) -> NDArray[np.float64]:
    """Gaussian blur of a radial profile over `_NODES`: of a scalar (order 0), or of a vector along the radius (1)."""
    sd = BLUR_STEP**step
    ring = _NODES * np.gradient(_NODES)
    ring[0] = (_NODES[1] / 4.0) ** 2  # the disc around the centre
    away = (_NODES[:, None] - _NODES) / sd
    kernel = ring * np.exp(-(away**2) / 2.0) * scipy.special.ive(order, np.outer(_NODES, _NODES) / sd**2)
    kept = np.ones_like(_NODES) if order == 0 else _NODES  # fields that no blur changes: an even one, and a linear one
    total = kernel @ kept
    return np.asarray(kernel * np.divide(kept, total, out=np.zeros_like(total), where=total > 0.0)[:, None])


def blurred_profile(profile: NDArray[np.float64], sd: float, *, order: int) -> NDArray[np.float64]:
    """A profile over `_NODES` after a Gaussian blur of the plane, its standard deviation in contact radii.

    ``order`` is 0 for a scalar, and 1 for the length of a vector that points along the radius.
    """
    place = min(max(float(np.log(sd) / np.log(BLUR_STEP)), -FINEST_BLUR), -1.0)
    step = int(np.floor(place))
    part = place - step
    below, above = (_blur_matrix(at, order) @ profile for at in (step, step + 1))
    return np.asarray((1.0 - part) * below + part * above)


def edge_blur(parameters: NDArray[np.float64]) -> float:
    """Standard deviation of the blur of a fitted edge, as a fraction of the contact's radius."""
    return BLUR * float(np.exp(parameters[6] - parameters[2]))


@dataclass(frozen=True, slots=True)
class Solved:
    """Parameters of an ellipse, its shapes with their normal matrix and best weights, and the residual."""

    parameters: NDArray[np.float64]
    shapes: NDArray[np.float64]
    normal: NDArray[np.float64]
    weights: NDArray[np.float64]
    residual: NDArray[np.float64]

    @property
    def cost(self) -> float:
        """Half the sum of the squares of the residual."""
        return float(self.residual @ self.residual) / 2.0

    @property
    def fitted(self) -> NDArray[np.float64]:
        """The change as the shapes explain it."""
        return np.asarray(self.shapes @ self.weights)


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
        y, x = np.mgrid[: shape[0], : shape[1]].reshape(2, -1).astype(float)
        self.x, self.y = (x + (left - centre[0])) / radius, (y + (top - centre[1])) / radius
        self.even_weight = bool((self.weight == 1.0).all())
        self.data = (change[part] * self.weight[..., None]).reshape(-1, change.shape[2])
        used = self.weight.ravel() > 0
        self.pixels = int(np.count_nonzero(used))
        self.energy = float(np.square(self.data[used] - self.data[used].mean(axis=0)).sum()) if self.pixels else 0.0
        self.even: float | None = None  # variance of what texture does not reach; None without texture

    def shapes(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Columns that explain the change for an ellipse, weighted, shape (pixels, columns)."""
        u, v, rho = self.reduced(parameters)
        blur = edge_blur(parameters)
        if self.gel is None:
            slope = _outer_slope(_NODES, float(np.exp(parameters[5])), float(parameters[7]))
            along = np.interp(rho, _NODES, blurred_profile(slope, blur, order=1)) / np.maximum(rho, 1e-9)
            first, second = along * u, along * v
            one = np.ones_like(rho)  # products are faster than powers
            across, down = ([one, *accumulate([part] * DEGREE, np.multiply)] for part in (first, second))
            shapes = [across[i] * down[j] for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i) if (i, j) != (0, 0)]
            # Near lamps light the two sides of a contact differently.
            shapes += [part * place for part in (first, second) for place in (self.x, self.y)]
        else:
            ratio = self.radius * float(np.exp(parameters[2] - parameters[5]))
            hill = np.interp(_NODES, _GRID, layer_hill(ratio, float(parameters[7])))
            depth = np.interp(rho, _NODES, blurred_profile(hill, blur, order=0))
            # The last shape is the ring of light around a press of a translucent gel, flat at the edge of the contact.
            beyond = np.maximum(rho - 1.0, 0.0)
            shapes = [depth, depth**2, beyond**2 * np.exp(-beyond / 0.25)]
        columns = np.array([*shapes, np.ones_like(rho), self.x, self.y])
        return np.asarray(columns.T if self.even_weight else (columns * self.weight.ravel()).T)

    def reduced(self, parameters: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Components (u, v) of the distance from the centre in units of the ellipse, and its size."""
        x, y, size = self.x - parameters[0], self.y - parameters[1], float(np.exp(parameters[2]))
        # The log aspect as a symmetric matrix without trace has no singular direction at the circle.
        half = float(np.hypot(parameters[3], parameters[4]))
        turn = np.sinh(half) / half if half > 1e-12 else 1.0
        a, b, c = np.cosh(half) - turn * parameters[3], -turn * parameters[4], np.cosh(half) + turn * parameters[3]
        u, v = (a * x + b * y) / size, (b * x + c * y) / size
        return u, v, np.hypot(u, v)

    def texture(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variance over that outside of the contact: a texture's imprint falls with the pressure; shape (pixels,)."""
        rho = self.reduced(parameters)[2]
        fall = np.maximum(1.0 - rho**2, 0.0) ** TEXTURE_FALL
        fall += TEXTURE_LEAK * np.exp(-np.maximum(rho - 1.0, 0.0) / TEXTURE_REACH)
        return np.asarray(1.0 + np.expm1(parameters[8]) * fall)

    def solved(self, parameters: NDArray[np.float64]) -> Solved:
        """The best weights of the shapes at these parameters, and what they leave."""
        shapes = self.shapes(parameters)
        weighted = shapes if self.even is None else shapes / self.texture(parameters)[:, None]
        normal = shapes.T @ weighted
        normal[np.diag_indices_from(normal)] += RIDGE * np.trace(normal)
        weights = np.asarray(np.linalg.solve(normal, weighted.T @ self.data), dtype=np.float64)
        return Solved(parameters, shapes, normal, weights, self.residual(parameters, shapes @ weights))

    def residual(self, parameters: NDArray[np.float64], fitted: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is left of the change; with texture, numbers whose squares add up to twice the log likelihood."""
        left = self.data - fitted
        if self.even is None:
            return np.asarray(left.ravel())
        texture = self.texture(parameters)
        spread = np.sqrt(left.shape[1] * np.log(texture)) * self.weight.ravel()
        return np.append(left / np.sqrt(self.even * texture)[:, None], spread)

    def jacobian(self, at: Solved, free: NDArray[np.intp]) -> NDArray[np.float64]:
        """Derivatives of the residual by the free parameters (Kaufman, BIT 15, 49, 1975), shape (residuals, free)."""
        count = self.data.size
        columns = np.empty((at.residual.size, free.size))
        for column, index in enumerate(free):
            moved = at.parameters.copy()
            moved[index] += STEP
            columns[:, column] = (self.residual(moved, self.shapes(moved) @ at.weights) - at.residual) / STEP
        # The weights follow the parameters: what the shapes themselves explain of a derivative is taken away.
        part = columns[:count].reshape(*self.data.shape, -1)
        root = None if self.even is None else np.sqrt(self.even * self.texture(at.parameters))
        shapes = at.shapes if root is None else at.shapes / root[:, None]
        normal = at.normal if self.even is None else at.normal / self.even
        flat = part.reshape(len(part), -1)
        flat -= shapes @ np.linalg.solve(normal, shapes.T @ flat)
        return columns

    def explained(self, fitted: NDArray[np.float64], blur: float) -> float:
        """Fraction of the change that is explained, after a blur of both that takes a texture away."""
        if blur <= 0.0:
            return 1.0 - float(np.square(self.data - fitted).sum()) / self.energy
        shape, used = (*self.weight.shape, -1), self.weight.ravel() > 0
        whole = self.data - self.data[used].mean(axis=0) * self.weight.ravel()[:, None]
        left, change = (
            scipy.ndimage.gaussian_filter(part.reshape(shape), (blur, blur, 0.0), mode="constant")
            for part in (self.data - fitted, whole)
        )
        return 1.0 - float(np.square(left).sum() / np.square(change).sum())

    def start(self, factor: float) -> NDArray[np.float64]:
        """Parameters of a circle of a radius relative to the window's."""
        last, eighth = 0.0, STEEPEST / 2
        if self.gel is not None:
            last, eighth = float(np.mean(np.log(self.gel.thickness_px))), float(np.mean(self.gel.poisson))
        return np.array([0.0, 0.0, np.log(factor), 0.0, 0.0, last, 0.0, eighth, 0.0])

    def limits(self, *, ellipse: bool) -> NDArray[np.float64]:
        """Largest distances of the parameters from their start."""
        limits = LIMITS.copy()
        if not ellipse:
            limits[3:5] = FIXED
        if self.gel is None:
            return np.append(limits, [STEEPEST / 2, FIXED])
        limits[6] = SHARPEST
        limits[5] = max(float(np.ptp(np.log(self.gel.thickness_px))) / 2.0, FIXED)
        return np.append(limits, [max(float(np.ptp(self.gel.poisson)) / 2.0, FIXED), FIXED])


def fit_contact(
    change: NDArray[np.float64],
    weight: NDArray[np.float64],
    centre: tuple[float, float],
    radius: float,
    *,
    gel: GelLayer | None = None,
    starts: tuple[float, ...] = (1.0,),
    ellipse: bool = False,
    texture: bool = False,
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
    texture
        Whether the object's texture leaves an imprint: then what the fit leaves of the change counts less inside the
        contact, and where it ends tells the edge.

    Returns
    -------
    ContactFit or None
        None where too few pixels can be used.
    """
    # One window for all starts: a small window lies inside the contact, where any radius explains the change.
    window = _Window(change, weight, centre, max(starts) * radius, gel)
    if window.pixels < FEWEST_PIXELS or window.energy <= 0.0:
        return None
    begun = [window.start(factor / max(starts)) for factor in starts]
    limits = window.limits(ellipse=ellipse)
    if texture:
        begun, limits = _textured_starts(window, begun, limits)
    solutions = [_solved(window, start, limits) for start in begun]
    fits = [_result(window, solution, centre, limits) for solution in solutions]
    return joined_fits(fits, [solution.cost for solution in solutions])


def _textured_starts(
    window: _Window, starts: list[NDArray[np.float64]], limits: NDArray[np.float64]
) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """The starts with the variance of a texture, by what a smooth fit leaves inside and outside; and the limits."""
    smooth = _solved(window, starts[len(starts) // 2], limits)
    left = np.square(smooth.residual.reshape(window.data.shape)).sum(axis=1)
    rho, used = window.reduced(smooth.parameters)[2], window.weight.ravel() > 0
    outside, inside = used & (rho > OUTSIDE), used & (rho < 0.8)
    if not outside.any() or not inside.any():
        return starts, limits
    channels = window.data.shape[1]
    window.even = max(float(left[outside].mean()), LEAST_EVEN) / channels
    texture = float(np.log(max(left[inside].mean() / channels / window.even, 1.5)))
    for start in starts:
        start[8] = texture
    return starts, np.append(limits[:8], texture + MOST_TEXTURE)


def _solved(window: _Window, start: NDArray[np.float64], limits: NDArray[np.float64]) -> Solved:
    """The best parameters within the limits, those of the profile weighed against their distance from the start.

    What the profile leaves free - its decay, blur and steepness - would else be driven to a limit by the errors of the
    model: the limits count as priors, as strong as the patches of the residual of a first solution say.
    """
    at = _descended(window, start, start, limits, np.zeros(limits.size))
    prior = np.zeros(limits.size)
    prior[PROFILE] = 3.0 * _patch_variance(window, at) / np.square(limits[PROFILE])
    return _descended(window, at.parameters, start, limits, prior)


def _descended(
    window: _Window,
    parameters: NDArray[np.float64],
    start: NDArray[np.float64],
    limits: NDArray[np.float64],
    prior: NDArray[np.float64],
) -> Solved:
    """Levenberg and Marquardt's method within the limits."""
    free = np.flatnonzero(limits > FIXED)
    low, high = (start - limits)[free], (start + limits)[free]
    if window.even is not None:
        low[-1] = LEAST_TEXTURE
    weight = prior[free]

    def cost_of(solved: Solved) -> float:
        return solved.cost + float(weight @ np.square((solved.parameters - start)[free])) / 2.0

    at, damping = window.solved(parameters), 1e-3
    cost = cost_of(at)
    for _ in range(MOST_STEPS):
        jacobian, here = window.jacobian(at, free), at.parameters[free]
        gradient = jacobian.T @ at.residual + weight * (here - start[free])
        curvature = jacobian.T @ jacobian + np.diag(weight)
        # A parameter at its limit stays there where the cost falls beyond it.
        moving = ~(((here <= low) & (gradient > 0)) | ((here >= high) & (gradient < 0)))
        if not moving.any():
            break
        found = None
        for _ in range(MOST_TRIES):
            system = curvature[np.ix_(moving, moving)]
            system = system + damping * np.diag(np.diag(system) + 1e-12 * np.trace(system))
            step = np.zeros(free.size)
            step[moving] = -np.linalg.solve(system, gradient[moving])
            trial = at.parameters.copy()
            trial[free] = np.clip(here + step, low, high)
            found = window.solved(trial)
            if cost_of(found) < cost:
                break
            damping, found = max(4.0 * damping, 1e-3), None
        if found is None:
            break
        gain, moved = cost - cost_of(found), float(np.abs(found.parameters - at.parameters).max())
        at, cost, damping = found, cost - gain, damping / 5.0
        if gain < LEAST_GAIN * cost or moved < 1e-4:
            break
    return at


def _patch_variance(window: _Window, solution: Solved) -> float:
    """Mean square residual times the pixels that err together: errors of the model count by their patches."""
    residual = solution.residual[: window.data.size]
    mean = float(residual @ residual) / max(window.pixels * window.data.shape[1], 1)
    return mean * _correlated_pixels(residual.reshape(*window.weight.shape, -1))


def joined_fits(fits: list[ContactFit], costs: list[float]) -> ContactFit:
    """The best fit; its radius is as uncertain as the radii of the other minima, weighted by their evidence."""
    best = int(np.argmin(costs))
    variance, radii = fits[best].patch_variance, np.array([fit.radius for fit in fits])
    if variance <= 0.0:
        return fits[best]
    weight = np.exp(-np.minimum((np.array(costs) - costs[best]) / variance, 500.0))
    spread = float((weight * (radii - radii[best]) ** 2).sum() / weight.sum())
    return replace(fits[best], radius_sd=float(np.sqrt(fits[best].radius_sd ** 2 + spread)))


def _result(window: _Window, solution: Solved, start: tuple[float, float], limits: NDArray[np.float64]) -> ContactFit:
    x, fitted, free = solution.parameters, solution.fitted, np.flatnonzero(limits > FIXED)
    jacobian = np.zeros((solution.residual.size, x.size))
    jacobian[:, free] = window.jacobian(solution, free)
    variance = _patch_variance(window, solution)
    # The limits count as priors, so that a parameter that the frame does not tell widens the radius by them alone.
    prior = 3.0 * variance / np.square(limits)
    variances = np.diag(np.linalg.inv(jacobian.T @ jacobian + np.diag(prior))) * variance
    half, radius = float(np.hypot(x[3], x[4])), window.radius * float(np.exp(x[2]))
    radius_sd = radius * float(np.sqrt(variances[2]))
    if window.even is not None and window.gel is not None and x[6] > AT_LIMIT * SHARPEST:
        # A hill without an edge, and its shape left to a texture: that of twice the radius explains it as well.
        radius_sd = max(radius_sd, UNKNOWN_SD * radius)
    inside = (window.reduced(x)[2] < 1.0) & (window.weight.ravel() > 0)
    part = fitted[inside] - fitted[~inside].mean(axis=0) if inside.any() and not inside.all() else np.zeros((1, 1))
    return ContactFit(
        centre=(start[0] + float(x[0]) * window.radius, start[1] + float(x[1]) * window.radius),
        semi_axes=(radius * float(np.exp(half)), radius * float(np.exp(-half))),
        angle_deg=float(0.5 * np.degrees(np.arctan2(x[4], x[3]))) if half > 1e-5 else 0.0,
        centre_sd=(window.radius * float(np.sqrt(variances[0])), window.radius * float(np.sqrt(variances[1]))),
        radius_sd=radius_sd,
        explained=window.explained(fitted, TEXTURE_BLUR * radius if window.even is not None else 0.0),
        amplitude=float(np.sqrt(np.square(part).sum(axis=1).mean())),
        patch_variance=variance,
        textured=window.even is not None,
        edge_blur=edge_blur(x),
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


def _rescaled_point(point: tuple[float, float], step: int, new: int) -> tuple[float, float]:
    """A point in pixels of another step."""
    x, y = ((part + 0.5) * step / new - 0.5 for part in point)
    return x, y


def _rescaled_fit(fit: ContactFit, step: int, new: int) -> ContactFit:
    """The fit in pixels of another step."""
    times = step / new
    return replace(
        fit,
        centre=_rescaled_point(fit.centre, step, new),
        semi_axes=(fit.semi_axes[0] * times, fit.semi_axes[1] * times),
        centre_sd=(fit.centre_sd[0] * times, fit.centre_sd[1] * times),
        radius_sd=fit.radius_sd * times,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class GelContact:
    """The contact in one frame.

    Lengths in mm are None where the sensor's scale is not known; all numbers are NaN where there is no contact.

    Attributes
    ----------
    name
        The frame's name.
    centre_px, centre_sd_px
        Centre (x, y), and its standard deviations.
    radius_px, radius_sd_px
        Radius of the circle of the same area.
    semi_axes_px, angle_deg
        Long and short semi-axis, equal for a circle, and the angle of the long one from x towards y.
    centre_mm, centre_sd_mm
        Centre on the face from the middle of the frame, without the lens's distortion.
    radius_mm, radius_sd_mm, area_mm2, area_sd_mm2
        Size on the face; the standard deviations include that of the scale.
    scale_sd
        Relative standard deviation of the scale in them, which all contacts of the sensor share.
    explained
        Fraction of the change that the fit explains.
    quality
        From 0 to 1.
    good
        Whether the quality is at least one half and no reason stands against it.
    reasons
        Names of what is wrong; `REASONS` has a sentence for each.
    """

    name: str
    centre_px: tuple[float, float]
    centre_sd_px: tuple[float, float]
    radius_px: float
    radius_sd_px: float
    semi_axes_px: tuple[float, float]
    angle_deg: float
    centre_mm: tuple[float, float] | None
    centre_sd_mm: tuple[float, float] | None
    radius_mm: float | None
    radius_sd_mm: float | None
    area_mm2: float | None
    area_sd_mm2: float | None
    scale_sd: float | None
    explained: float
    quality: float
    good: bool
    reasons: tuple[str, ...]


def contacts(
    frames: Sequence[Any],
    *,
    sensor: GelSensor,
    reference: Any | None = None,
    names: Sequence[str] | None = None,
    sequence: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[GelContact, ...]:
    """Find the contact in each frame of a gel sensor.

    Raises `InputError` when a frame is no picture, is black, has no colour under coloured lamps, or a reference is
    missing; `ImageMismatchError` when a frame or the reference does not belong to the sensor.

    Parameters
    ----------
    frames
        Frames as `gel_levels` takes them: colour arrays of 8 or 16 bits, or grey ones of a white-light sensor.
    sensor
        The sensor that took them.
    reference
        A frame of the untouched sensor; None takes the median of at least eight frames pressed at different places.
    names
        Names of the frames; ``frame 1`` and so on when None.
    sequence
        Whether the frames are of one press in the order of time: then a contact that moves is no good one.
    progress
        Called with the number of finished frames and of all.
    """
    frames = list(frames)
    if not frames:
        raise InputError("frames must hold at least one frame; got none")
    labels = [f"frame {number}" for number in range(1, len(frames) + 1)] if names is None else list(names)
    untouched = gel_reference(frames, sensor, reference)
    found: list[GelContact] = []
    for number, (frame, name) in enumerate(zip(frames, labels, strict=True)):
        change = gel_change(gel_levels(frame, sensor, what=name), untouched, sensor, what=name)
        contact = find_gel_contact(change, sensor, name=name)
        if sequence and found and _moved(found[-1], contact):
            quality = min(contact.quality, REFUSED_QUALITY)
            contact = replace(contact, good=False, quality=quality, reasons=(*contact.reasons, "moving"))
        found.append(contact)
        if progress is not None:
            progress(number + 1, len(frames))
    return tuple(found) if reference is not None else tuple(_beside_one_another(found))


def _beside_one_another(found: Sequence[GelContact]) -> Iterator[GelContact]:
    """The contacts, those refused at whose place the median of the frames may not be that of the untouched sensor."""
    idle = sum("no contact" in contact.reasons for contact in found)
    for contact in found:
        apart = [np.hypot(*np.subtract(contact.centre_px, other.centre_px)) for other in found]
        here = sum(
            distance < contact.radius_px and "no contact" not in other.reasons
            for distance, other in zip(apart, found, strict=True)
        )
        if "no contact" in contact.reasons or here + idle <= MOST_HERE * len(found):
            yield contact
        else:
            quality = min(contact.quality, REFUSED_QUALITY)
            yield replace(contact, good=False, quality=quality, reasons=(*contact.reasons, "no reference"))


def _moved(before: GelContact, now: GelContact) -> bool:
    if "no contact" in before.reasons + now.reasons:
        return False
    return bool(np.hypot(*np.subtract(before.centre_px, now.centre_px)) > MOVED * now.radius_px)


def find_gel_contact(change: GelChange, sensor: GelSensor, *, name: str = "frame") -> GelContact:
    """Find the contact in the change of one frame; what `contacts` does for each."""
    with one_blas_thread():  # the systems are small: a second thread costs ten times what it saves
        return _find(change, sensor, name)


def _find(change: GelChange, sensor: GelSensor, name: str) -> GelContact:
    rows, columns = change.usable.shape
    step = max(1, round(columns / SEARCH_COLUMNS))
    coarse, usable = _reduced(change, step)
    place = _search(coarse, usable, max(change.noise / step, 0.3))
    if place is None:
        return _none(name)
    centre, radius, others = place
    gel = _layer(sensor, columns, rows)
    fits = _Fits(change, gel)
    fit = fits.at(START_RADIUS_PX, _place(centre, radius, step), starts=STARTS)
    if fit is None:
        return _none(name)
    if gel is not None:
        fit = fits.at(START_RADIUS_PX, fit, starts=AGAIN) or fit
    sd = fit.radius_sd  # other minima are in it
    oval = fits.at(START_RADIUS_PX, fit, ellipse=True) if fit.explained < ROUND else None
    is_oval = oval is not None and _is_oval(fit, oval)
    fit = fits.at(FITTED_RADIUS_PX, oval if is_oval else fit, ellipse=is_oval) or fit
    fit = fit if gel is None else replace(fit, radius_sd=max(fit.radius_sd, sd))
    if fit.explained < TEXTURED:
        ends = (1.0,) if is_oval else TEXTURED_STARTS
        if fit.radius_sd > MANY_MINIMA * fit.radius:  # so far away is another radius that explains the change as well
            ends = (*ends, 1.0 + fit.radius_sd / fit.radius)
        rough = fits.at(START_RADIUS_PX, fit, starts=ends, texture=True) or fit
        sd = rough.radius_sd
        finer = fits.at(FITTED_RADIUS_PX, rough, texture=True)
        if finer is not None and finer.explained > fit.explained:
            fit = replace(finer, radius_sd=max(finer.radius_sd, sd))
    reasons = _reasons(change, fit, others=[_rescaled_point(other, step, 1) for other in others])
    return _contact(name, fit, reasons, sensor, columns, rows, change)


class _Fits:
    """Fits of one change, on block means so that the radius has as many blocks as asked for; all in its pixels."""

    def __init__(self, change: GelChange, gel: GelLayer | None) -> None:
        self._change, self._gel = change, gel
        self._reduced: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}

    def at(self, radius_px: float, near: ContactFit | None, **options: Any) -> ContactFit | None:
        """A fit that starts at another; options as of `fit_contact`."""
        if near is None:
            return None
        step = max(1, int(near.radius / radius_px))
        if step not in self._reduced:
            blocks, usable = _reduced(self._change, step)
            self._reduced[step] = blocks, usable.astype(float)
        start = _rescaled_fit(near, 1, step)
        gel = None if self._gel is None else self._gel.scaled(1.0 / step)
        fit = fit_contact(*self._reduced[step], start.centre, start.radius, gel=gel, **options)
        return None if fit is None else _rescaled_fit(fit, step, 1)


def _place(centre: tuple[float, float], radius: float, step: int) -> ContactFit:
    """Where a search on blocks of that step found a contact, as a fit without uncertainty."""
    found = ContactFit(
        centre=centre, semi_axes=(radius, radius), angle_deg=0.0, centre_sd=(0.0, 0.0), radius_sd=0.0, explained=0.0,
        amplitude=0.0, patch_variance=0.0,
    )  # fmt: skip
    return _rescaled_fit(found, step, 1)


def _layer(sensor: GelSensor, columns: int, rows: int) -> GelLayer | None:
    """The gel in pixels of the frame under white light; None under coloured lamps."""
    if sensor.light == "rgb":
        return None
    scale, (low, high) = sensor.scale_of(columns, rows), sensor.thickness_mm.limits
    side = None if scale is None else float(np.sqrt(scale[0] * scale[1]))
    thickness = (0.1 * columns, 2.0 * columns) if side is None else (low / side, high / side)
    return GelLayer(thickness_px=thickness, poisson=sensor.poisson.limits)


def _reduced(change: GelChange, step: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Block means of the change, and the blocks whose pixels all count."""
    if step == 1:
        return change.change, change.usable
    rows, columns = (size // step for size in change.usable.shape)
    part = np.s_[: rows * step, : columns * step]
    blocks = [block_means(channel, (rows, columns)) for channel in np.moveaxis(change.change[part], 2, 0)]
    return np.stack(blocks, axis=-1), block_means(change.usable[part], (rows, columns)) > 0.99


def _search(
    change: NDArray[np.float64], usable: NDArray[np.bool_], noise: float
) -> tuple[tuple[float, float], float, list[tuple[float, float]]] | None:
    """Centre and radius of the strongest patch, and centres of others as strong; None without one."""
    weight = np.maximum(scipy.ndimage.gaussian_filter(usable.astype(float), 2.0), 0.05)
    smooth = scipy.ndimage.gaussian_filter(change * usable[..., None], (2.0, 2.0, 0.0)) / weight[..., None]
    strength = np.sqrt(np.square(smooth).sum(axis=2)) * usable
    energy = np.sqrt(scipy.ndimage.gaussian_filter(strength**2, 4.0))
    top = np.unravel_index(int(energy.argmax()), energy.shape)
    background = float(np.median(strength))
    if energy[top] < max(PEAK_NOISE * noise / 7.0, LEAST_CHANGE, 2.0 * background):
        return None
    near = strength[max(top[0] - 12, 0) : top[0] + 13, max(top[1] - 12, 0) : top[1] + 13]
    mask = strength > max(0.4 * float(np.quantile(near, 0.95)), 1.5 * background)
    labels, count = scipy.ndimage.label(scipy.ndimage.binary_closing(mask, iterations=2) | mask)
    if count == 0:
        return None
    totals = scipy.ndimage.sum_labels(strength, labels, np.arange(1, count + 1))
    areas = scipy.ndimage.sum_labels(labels > 0, labels, np.arange(1, count + 1))
    main = int(np.argmax(totals))
    y, x = np.nonzero(labels == main + 1)
    others = [
        (float(place[1]), float(place[0]))
        for index, place in enumerate(
            np.atleast_2d(scipy.ndimage.center_of_mass(strength + 1e-9, labels, np.arange(1, count + 1)))
        )
        if index != main and totals[index] > 0.25 * totals[main] and areas[index] > 20
    ]
    return (float(x.mean()), float(y.mean())), max(float(np.sqrt(x.size / np.pi)), 3.0), others


def _is_oval(circle: ContactFit, oval: ContactFit) -> bool:
    """Whether unequal axes explain clearly more, with a clear difference of the axes."""
    aspect = oval.semi_axes[0] / oval.semi_axes[1]
    left = max(1.0 - circle.explained, 1e-9)
    return aspect > 1.1 and oval.explained > circle.explained + 0.15 * left


def _reasons(change: GelChange, fit: ContactFit, *, others: list[tuple[float, float]]) -> list[str]:
    rows, columns = change.usable.shape
    angle, (long, short), turn = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False), fit.semi_axes, fit.angle_deg
    along = np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn))])
    across = np.array([-along[1], along[0]])
    edge = np.asarray(fit.centre) + np.outer(long * np.cos(angle), along) + np.outer(short * np.sin(angle), across)
    on_image = ((edge >= 0) & (edge <= (columns - 1, rows - 1))).all(axis=1)
    y, x = np.mgrid[:rows, :columns]
    place = np.stack([x, y], axis=-1) - np.asarray(fit.centre)
    inside = np.hypot(place @ along / long, place @ across / short) <= 1.15
    total = max(int(np.count_nonzero(inside)), 1)
    reasons = []
    if fit.explained < (LEAST_TEXTURED if fit.textured else LEAST_EXPLAINED):
        reasons.append("poor fit")
    if fit.amplitude < max(3.0 * change.noise / np.sqrt(total / 10.0), 2.0):
        reasons.append("no contact")
    if on_image.mean() < 0.9:
        reasons.append("cut by the border")
    if np.count_nonzero(inside & change.marker) > 0.5 * total:
        reasons.append("marker pattern")
    if np.count_nonzero(inside & ~change.usable & ~change.marker) > 0.35 * total:
        reasons.append("glare")
    if any(np.hypot(*np.subtract(other, fit.centre)) > 1.5 * fit.radius for other in others):
        reasons.append("several contacts")
    if fit.radius_sd > 0.15 * fit.radius:
        reasons.append("uncertain")
    return reasons


def _contact(
    name: str, fit: ContactFit, reasons: list[str], sensor: GelSensor, columns: int, rows: int, change: GelChange
) -> GelContact:
    radius, scale = fit.radius, sensor.scale_of(columns, rows)
    centre_sd = tuple(float(np.hypot(part, CENTRE_MODEL_SD * radius)) for part in fit.centre_sd)
    model_sd = (TEXTURED_MODEL_SD if fit.textured else RADIUS_MODEL_SD)[sensor.light]
    soft_sd = SOFT_EDGE_SD * max(fit.edge_blur - BLUR, 0.0)
    radius_sd = float(np.hypot(fit.radius_sd, np.hypot(model_sd, soft_sd) * radius))
    good_fit = float(np.clip((fit.explained - 0.5) / 0.4, 0.0, 1.0))
    quality = good_fit * float(np.clip(1.5 - radius_sd / radius / 0.1, 0.0, 1.0))
    reason = "poor fit" if good_fit < LEAST_QUALITY else "uncertain"
    in_mm: dict[str, Any] = dict.fromkeys(
        ("centre_mm", "centre_sd_mm", "radius_mm", "radius_sd_mm", "area_mm2", "area_sd_mm2", "scale_sd")
    )
    if scale is not None:
        side = float(np.sqrt(scale[0] * scale[1]))
        relative = float(np.hypot(radius_sd / radius, sensor.scale_uncertainty))
        x, y = sensor.face_mm([fit.centre], columns, rows)[0]
        area = float(np.pi * fit.semi_axes[0] * fit.semi_axes[1] * side**2)
        in_mm = {
            "centre_mm": (float(x), float(y)),
            "centre_sd_mm": (centre_sd[0] * scale[0], centre_sd[1] * scale[1]),
            "radius_mm": radius * side,
            "radius_sd_mm": radius * side * relative,
            "area_mm2": area,
            "area_sd_mm2": 2.0 * area * relative,
            "scale_sd": sensor.scale_uncertainty,
        }
    return GelContact(
        name=name,
        centre_px=fit.centre,
        centre_sd_px=(centre_sd[0], centre_sd[1]),
        radius_px=radius,
        radius_sd_px=radius_sd,
        semi_axes_px=fit.semi_axes,
        angle_deg=fit.angle_deg,
        explained=fit.explained,
        quality=quality if not reasons else min(quality, REFUSED_QUALITY),
        good=not reasons and quality >= LEAST_QUALITY,
        reasons=tuple(reasons) if reasons or quality >= LEAST_QUALITY else (reason,),
        **in_mm,
    )


def _none(name: str) -> GelContact:
    nan, pair = float("nan"), (float("nan"), float("nan"))
    return GelContact(
        name=name, centre_px=pair, centre_sd_px=pair, radius_px=nan, radius_sd_px=nan, semi_axes_px=pair, angle_deg=nan,
        centre_mm=None, centre_sd_mm=None, radius_mm=None, radius_sd_mm=None, area_mm2=None, area_sd_mm2=None,
        scale_sd=None, explained=0.0, quality=0.0, good=False, reasons=("no contact",),
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkerShift:
    """Markers of a gel: their places on the untouched face and how far they moved along it, shape (n, 2), mm."""

    points_mm: NDArray[np.float64]
    shift_mm: NDArray[np.float64]


def marker_shift(frame: Any, reference: Any, sensor: GelSensor) -> MarkerShift:
    """How far the markers of a gel moved against the untouched sensor.

    Dark dots of both frames are paired from where nothing moved inwards, each near the movement of its neighbours.

    Raises `InputError` when the sensor's file has no marker_pitch_mm or no scale, or no marker is found.
    """
    if sensor.marker_pitch_mm is None:
        raise InputError(f"{sensor.name} has no markers; put marker_pitch_mm into its file if the gel has them")
    now, before = (gel_levels(part, sensor, what=what) for part, what in ((frame, "frame"), (reference, "reference")))
    rows, columns = before.shape[:2]
    points, moved = (sensor.face_mm(_marker_places(part, sensor), columns, rows) for part in (before, now))
    partner = _partners(points, moved, sensor.marker_pitch_mm)
    pair = partner >= 0
    return MarkerShift(points_mm=points[pair], shift_mm=moved[partner[pair]] - points[pair])


def _partners(points: NDArray[np.float64], moved: NDArray[np.float64], pitch: float) -> NDArray[np.intp]:
    """Index in ``moved`` of each marker, -1 for none: from where nothing moved to its neighbours, the surest first.

    A marker lies near the mean movement of its neighbours, however far that is; the nearest may be another marker.
    """
    gaps = np.hypot(*(points[:, None] - moved[None]).transpose(2, 0, 1))
    near = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1)) < NEIGHBOURS * pitch
    partner, free = np.full(len(points), -1), np.ones(len(moved), dtype=bool)
    still = int(np.argmin([np.median(gaps[around].min(axis=1)) for around in near]))
    queue = [(float(gaps[still].min()), still, int(gaps[still].argmin()))]
    while queue:
        _, marker, other = heappop(queue)
        if partner[marker] >= 0 or not free[other]:
            continue
        partner[marker], free[other] = other, False
        for following in np.flatnonzero(near[marker] & (partner < 0)):
            done = near[following] & (partner >= 0)
            expected = points[following] + (moved[partner[done]] - points[done]).mean(axis=0)
            off = np.hypot(*(moved - expected).T)
            if off.min() < LARGEST_SHIFT * pitch:
                heappush(queue, (float(off.min()), int(following), int(off.argmin())))
    return partner


def _marker_places(levels: NDArray[np.float64], sensor: GelSensor) -> NDArray[np.float64]:
    """Centres (x, y) of the markers in pixels, weighted by their darkness."""
    rows, columns = levels.shape[:2]
    scale = sensor.scale_of(columns, rows)
    pitch = 0.0 if scale is None or sensor.marker_pitch_mm is None else sensor.marker_pitch_mm / scale[0]
    grey = levels.mean(axis=2)
    dark = np.maximum(scipy.ndimage.gaussian_filter(grey, max(pitch, 1.0)) - grey, 0.0)
    labels, count = scipy.ndimage.label(marker_pixels(levels, sensor))
    numbers = np.arange(1, count + 1)
    areas = scipy.ndimage.sum_labels(labels > 0, labels, numbers)
    sized = numbers[(areas >= FEWEST_MARKER_PX) & (areas < (MOST_MARKER * max(pitch, 4.0)) ** 2 * np.pi)]
    if sized.size == 0:
        raise InputError(f"a frame of {sensor.name} must show markers every {sensor.marker_pitch_mm} mm; got none")
    return np.asarray(scipy.ndimage.center_of_mass(dark, labels, sized))[:, ::-1]

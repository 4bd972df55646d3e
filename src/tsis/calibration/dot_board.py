"""Pixel scale from a dot board: spots, their lattice, the map from board to image, and its uncertainty.

A spot is a maximum of the difference of two Gaussian blurs, which suppresses level and slope of the light; the blur of
the strongest response gives the spots' size (Lindeberg, Int. J. Computer Vision 30, 79, 1998).

The image coordinates of the dots are polynomials of the board's: linear terms are scale and rotation, quadratic terms
the perspective of a tilted camera, cubic and higher terms the lens. The least-squares fit gives each image axis its own
residual variance: noise is in pixels, the scatter of the dots in millimetres, and their ratio differs between the axes
where pixels are not square.

The residuals show how well the dots fit the map. Where they fit to a hundredth of a pixel, errors outside the map are
larger: bend, skew, bias of a spot. The bend counts in full: both the mean over a pitch and the size at the position
itself are the scale.
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.calibration.measured import MeasuredValue
from tsis.calibration.scale import UNIT, PixelScale, check_field
from tsis.errors import CalibrationError
from tsis.imaging.corrections import require_image, subtract_background
from tsis.imaging.patch import NOISE_FACTOR, QUANTISATION, pixel_noise
from tsis.model.require import freeze_arrays, require_integer, require_number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from tsis.model.image import TactileImage


STEP = 2.0**0.5  # from one blur to the next
FINEST_PX = 1.5  # blur: finer spots have no sub-pixel centre
COARSEST = 1 / 20  # blur over the image's shorter side, for at least five spots across
BORDER = 4.0  # blurs between a spot and the border, whose reflection would shift it outwards
LEAST_SEPARATION = 1.5  # blurs between a spot and the next maximum
WEAKEST = 0.3  # strength over that of a typical spot


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Spots:
    """_Spots of a frame, strongest first."""

    positions_px: NDArray[np.float64]  # centres (x, y), shape (n, 2)
    strength: NDArray[np.float64]  # height above the surroundings, shape (n,), grey levels
    width_px: float  # standard deviation of a Gaussian as wide as the spots
    bright: bool  # brighter than their surroundings

    def __post_init__(self) -> None:
        freeze_arrays(self, "positions_px", "strength", dtype=float)


def find_spots(grey: NDArray[np.float64], *, least: int) -> _Spots:
    """Find spots of one size and sign, set by the strongest ``least``, above noise and a fraction of their strength."""
    noise = max(pixel_noise(grey), QUANTISATION)
    blurs = FINEST_PX * STEP ** np.arange(64)
    blurs = blurs[blurs <= max(COARSEST * min(grey.shape), FINEST_PX)]
    typical = np.zeros((2, len(blurs)))  # strength, by sign and blur
    best, fine = None, _blurred(grey, FINEST_PX)
    for k, blur in enumerate(blurs):
        coarse = _blurred(grey, STEP * blur)
        change = fine - coarse
        level = float(np.median(change))  # a field with light that falls off all round responds everywhere
        for side, sign in enumerate((1.0, -1.0)):
            response = sign * (change - level)
            rows, columns = _peaks(response, blur, NOISE_FACTOR * noise * _noise_gain(blur))
            strength = np.sort(response[rows, columns])
            if strength.size >= least:
                typical[side, k] = strength[-least:].mean()
            if typical[side, k] > np.delete(typical.ravel(), side * len(blurs) + k).max(initial=0.0):
                best = side, k, response, rows, columns
        fine = coarse
    if best is None:
        return _Spots(positions_px=np.empty((0, 2)), strength=np.empty(0), width_px=0.0, bright=True)
    side, k, response, rows, columns = best
    strength = response[rows, columns]
    selected = np.flatnonzero(strength > WEAKEST * typical[side, k])
    selected = selected[np.argsort(-strength[selected], kind="stable")]
    return _Spots(
        positions_px=_sub_pixel(response, rows[selected], columns[selected], max(1, round(blurs[k] / 2))),
        strength=strength[selected],
        # A Gaussian responds most to the blur of its own width over the root of the step.
        width_px=float(blurs[k] * STEP ** (0.5 + _top(typical[side], k))),
        bright=side == 0,
    )


def _top(values: NDArray[np.float64], index: int) -> float:
    """Offset of the parabola's top through a maximum and its neighbours, in steps."""
    if not 0 < index < len(values) - 1:
        return 0.0
    bend = (values[index - 1] + values[index + 1]) - 2 * values[index]
    return float(np.clip((values[index - 1] - values[index + 1]) / (2 * bend), -0.5, 0.5)) if bend < 0 else 0.0


def _in_even_light(
    positions_px: NDArray[np.float64], strength: NDArray[np.float64], width_px: float
) -> NDArray[np.float64]:
    """Centres of spots in even light, shape (n, 2), pixels."""
    # Light that grows across a spot shifts its centre by the spot's variance times the relative growth per pixel.
    # Towards the rim of a lit field the shift is proportional to the distance from its middle, which is an error of
    # scale. The light is an exponential of a quadratic function of position, fitted to the spots' own strengths.
    middle, extent = positions_px.mean(axis=0), np.ptp(positions_px, axis=0).max() / 2
    u, v = ((positions_px - middle) / extent).T
    zero, ones = np.zeros_like(u), np.ones_like(u)
    factors = np.linalg.lstsq(np.stack([ones, u, v, u * u, u * v, v * v], axis=1), np.log(strength), rcond=None)[0]
    growth_x = np.stack([zero, ones, zero, 2 * u, v, zero], axis=1) @ factors
    growth_y = np.stack([zero, zero, ones, zero, u, 2 * v], axis=1) @ factors
    return np.asarray(positions_px - width_px**2 / extent * np.stack([growth_x, growth_y], axis=1))


def _blurred(grey: NDArray[np.float64], blur: float) -> NDArray[np.float64]:
    return np.asarray(scipy.ndimage.gaussian_filter(grey, blur), dtype=np.float64)


def _noise_gain(blur: float) -> float:
    """Standard deviation of the difference of two blurs of white noise of standard deviation 1."""
    first, second = blur**2, (STEP * blur) ** 2
    return float(np.sqrt((1 / first + 1 / second - 4 / (first + second)) / (4 * np.pi)))


def _peaks(response: NDArray[np.float64], blur: float, least: float) -> tuple[NDArray[np.intp], ...]:
    """Rows and columns of the maxima above a level, apart from each other and from the border."""
    size = 2 * round(LEAST_SEPARATION * blur) + 1
    highest = scipy.ndimage.maximum_filter(response, size)
    margin = int(np.ceil(BORDER * blur)) + 1
    inside = np.zeros(response.shape, dtype=bool)
    inside[margin:-margin, margin:-margin] = True
    return np.nonzero((response >= highest) & (response > least) & inside)


def _sub_pixel(
    response: NDArray[np.float64], rows: NDArray[np.intp], columns: NDArray[np.intp], half: int
) -> NDArray[np.float64]:
    """Tops (x, y) of the paraboloids through the neighbourhoods of maxima, shape (n, 2)."""
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    terms = np.stack([np.ones(x.size), *(a.ravel() for a in (x, y, x * x, x * y, y * y))], axis=1)
    around = response[rows[:, None] + y.ravel(), columns[:, None] + x.ravel()]
    _, bx, by, xx, xy, yy = np.linalg.pinv(terms) @ around.T
    bend = 4 * xx * yy - xy**2
    # A paraboloid without a top, or with one beyond one pixel, leaves the centre at the pixel.
    good = (bend > 0) & (xx < 0)
    safe = np.where(good, bend, 1.0)
    shift = np.stack([(xy * by - 2 * yy * bx) / safe, (xy * bx - 2 * xx * by) / safe], axis=1)
    shift[~good | (np.abs(shift).max(axis=1) > 1.0)] = 0.0
    return np.asarray(np.stack([columns, rows], axis=1) + shift)


FIRST_ORDER, LENS_ORDER, WIDE_ORDER = 1, 3, 5  # the distortion of a lens is odd
SPARE = 0.375  # least fraction of the dots' coordinates that remains as degrees of freedom
BEYOND_CHANCE = 1e-3  # probability below which distortion counts as observed
WORTH_FITTING = 0.05  # probability below which wide-angle terms are fitted: omitted true terms shift the scale
STRAY = 1e-3  # probability that one dot of a good board counts as a stray
MOST_STRAYS = 0.1  # fraction of the dots


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _BoardMap:
    """A fitted map from lattice to image."""

    cells: NDArray[np.float64]  # lattice coordinates of the dots, shape (n, 2)
    positions_px: NDArray[np.float64]  # their measured centres (x, y), shape (n, 2)
    order: int  # of the polynomial
    factors: NDArray[np.float64]  # its coefficients, shape (terms, 2)
    spread: NDArray[np.float64]  # inverse of the normal matrix, shape (terms, terms)
    sd_px: NDArray[np.float64]  # standard deviation (x, y) of one coordinate of a dot

    def at(self, cells: NDArray[np.float64]) -> NDArray[np.float64]:
        """Image positions (x, y) of lattice coordinates, shape (n, 2), pixels."""
        return np.asarray(self._terms(cells) @ self.factors)

    def residuals_px(self) -> NDArray[np.float64]:
        """Residual of each dot, shape (n, 2), pixels."""
        return self.positions_px - self.at(self.cells)

    @property
    def degrees_of_freedom(self) -> int:
        """Of the standard deviation along one image axis."""
        return len(self.cells) - len(self.factors)

    def cell_at(self, position_px: tuple[float, float]) -> NDArray[np.float64]:
        """Lattice coordinates of an image position, by Newton's method from the nearest dot."""
        cell = self.cells[np.argmin(np.linalg.norm(self.positions_px - position_px, axis=1))]
        for _ in range(20):
            miss = np.asarray(position_px) - self.at(cell[None])[0]
            step = np.linalg.lstsq(self._step_px(cell, extent=1e-3), miss, rcond=None)[0]
            cell = cell + np.clip(step, -1.0, 1.0)
        return np.asarray(cell)

    def face_step(self, cell: NDArray[np.float64], *, extent: float = 1.0) -> NDArray[np.float64]:
        """Step on the face of one pixel along x and y, in pitches, mean over ``extent`` pitches; columns of (2, 2)."""
        return np.asarray(np.linalg.inv(self._step_px(cell, extent=extent)))

    def pixel_size(self, cell: NDArray[np.float64], *, pitch: MeasuredValue) -> tuple[MeasuredValue, MeasuredValue]:
        """Size (x, y) of a pixel on the face at a lattice position, by propagation of the residuals' variance."""
        back = self.face_step(cell)
        slopes = self._slopes(cell, extent=1.0)
        x, y = (self._size_along(back, slopes, axis, pitch) for axis in (0, 1))
        return x, y

    def _size_along(
        self, back: NDArray[np.float64], slopes: NDArray[np.float64], axis: int, pitch: MeasuredValue
    ) -> MeasuredValue:
        size = float(np.linalg.norm(back[:, axis]))
        # Degrees of freedom of the two image axes and the pitch after Welch and Satterthwaite.
        variances = self._variances(back, slopes, axis)
        by_dots, by_pitch = float(variances.sum()) * pitch.value**2, (size * pitch.sd) ** 2
        squares = float((variances**2).sum()) * pitch.value**4 / self.degrees_of_freedom
        squares += by_pitch**2 / pitch.degrees_of_freedom
        total = by_dots + by_pitch
        freedom = total**2 / squares if squares > 0.0 else float(self.degrees_of_freedom)
        return MeasuredValue(value=size * pitch.value, sd=total**0.5, degrees_of_freedom=freedom, unit=UNIT)

    def bend(
        self, cell: NDArray[np.float64], *, point: float = 1e-3
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Excess (x, y) of the pixel size over one pitch above that at the position itself, relative; and its noise."""
        back, here = (self.face_step(cell, extent=extent) for extent in (1.0, point))
        sizes = np.linalg.norm(back, axis=0)
        slopes = self._slopes(cell, extent=1.0) - self._slopes(cell, extent=point)
        noise = np.array([np.sqrt(self._variances(back, slopes, axis).sum()) for axis in (0, 1)])
        return sizes / np.linalg.norm(here, axis=0) - 1, noise / sizes

    def _variances(self, back: NDArray[np.float64], slopes: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
        """Variance of a pixel's size, in pitches, from each image axis of the dots' positions, shape (2,)."""
        # d|K e| = -u K dJ K e with K the inverse of J and u the direction of K e.
        weights = back[:, axis] / np.linalg.norm(back[:, axis]) @ back
        along = slopes @ back[:, axis]
        return np.asarray((weights * self.sd_px) ** 2 * float(along @ self.spread @ along))

    def _slopes(self, cell: NDArray[np.float64], *, extent: float) -> NDArray[np.float64]:
        """Change of each term for a step of one pitch along each lattice axis, shape (terms, 2)."""
        ends = np.array([[extent, 0.0], [0.0, extent]])
        return np.asarray((self._terms(cell + ends) - self._terms(cell - ends)).T / (2 * extent))

    def _step_px(self, cell: NDArray[np.float64], *, extent: float) -> NDArray[np.float64]:
        return np.asarray((self._slopes(cell, extent=extent).T @ self.factors).T)

    def _terms(self, cells: NDArray[np.float64]) -> NDArray[np.float64]:
        return _terms(cells, self.cells, self.order)


def _terms(cells: NDArray[np.float64], about: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """Products of powers of lattice coordinates up to an order, scaled by middle and half width of ``about``."""
    middle, half = (about.max(axis=0) + about.min(axis=0)) / 2, np.ptp(about, axis=0) / 2
    u, v = ((cells - middle) / half).T
    # Three rows cannot separate a cubic from a linear term: powers stay below the number of rows and of columns.
    columns, rows = (len(np.unique(about[:, axis])) for axis in (0, 1))
    powers = [(a, b) for a, b in itertools.product(range(columns), range(rows)) if a + b <= order]
    return np.stack([u**a * v**b for a, b in powers], axis=1)


def _fit_map(cells: NDArray[np.float64], positions_px: NDArray[np.float64]) -> _BoardMap:
    """The map of the highest order that the dots support; wide-angle terms only where chance hardly explains them."""
    # Cubic terms are always fitted: without them an interval is valid only for a lens without distortion.
    if not _carries(cells, LENS_ORDER):
        raise CalibrationError(
            f"the dots must fill rows and columns, so that the lens's distortion can be separated from the scale; got "
            f"{len(cells)} dots that do not (press the whole board on the face)"
        )
    order = _fit_order(cells, positions_px, LENS_ORDER)
    if _carries(cells, WIDE_ORDER):
        wide = _fit_order(cells, positions_px, WIDE_ORDER)
        if _chance_of(order, wide) < WORTH_FITTING:
            return wide
    return order


def _carries(cells: NDArray[np.float64], order: int) -> bool:
    """Whether number, rows and columns of the dots suffice for a polynomial of an order."""
    design = _terms(cells, cells, order)
    count = design.shape[1]
    return count <= (1 - SPARE) * len(cells) and bool(np.linalg.matrix_rank(design) == count)


def _chance_of(small: _BoardMap, large: _BoardMap) -> float:
    """Probability of such an improvement by the higher order where the lower order is true (Fisher's F)."""
    added, freedom = 2 * (len(large.factors) - len(small.factors)), 2 * large.degrees_of_freedom
    # Each image axis with its own variance, as in the fit.
    before = (small.residuals_px() ** 2).sum(axis=0) / large.sd_px**2
    gained = float(before.sum()) - freedom
    return float(scipy.stats.f.sf(max(gained, 0.0) / added, added, freedom))


def _without_strays(cells: NDArray[np.float64], positions_px: NDArray[np.float64]) -> NDArray[np.bool]:
    """True for the dots whose position agrees with a map fitted without them."""
    good = np.ones(len(cells), dtype=bool)
    for _ in range(int(MOST_STRAYS * len(cells))):
        fitted = _fit_map(cells[good], positions_px[good])
        design = _terms(fitted.cells, fitted.cells, fitted.order)
        lever = 1 - np.einsum("ij,jk,ik->i", design, fitted.spread, design)
        freedom = fitted.degrees_of_freedom
        squares = fitted.residuals_px() ** 2 / np.maximum(lever, 1e-9)[:, None] / np.maximum(fitted.sd_px, 1e-9) ** 2
        outside = np.sqrt(squares * (freedom - 1) / np.maximum(freedom - squares, 1e-9)).max(axis=1)
        worst = int(np.argmax(outside))
        if outside[worst] < scipy.stats.t.isf(STRAY / (4 * len(cells)), freedom - 1):
            break
        good[np.flatnonzero(good)[worst]] = False
    return good


def _fit_order(cells: NDArray[np.float64], positions_px: NDArray[np.float64], order: int) -> _BoardMap:
    """Fit the map of a given order by least squares."""
    design = _terms(cells, cells, order)
    factors = np.linalg.lstsq(design, positions_px, rcond=None)[0]
    squares = ((positions_px - design @ factors) ** 2).sum(axis=0)
    return _BoardMap(
        cells=cells,
        positions_px=positions_px,
        order=order,
        factors=np.asarray(factors, dtype=float),
        spread=np.asarray(np.linalg.inv(design.T @ design), dtype=float),
        sd_px=np.sqrt(squares / (len(cells) - len(factors))),
    )


MOST_SKEW_DEG = 3.0  # between the image's axes on the board; noise and scatter cause some tenths
# Height over width of a pixel; a hexagonal board or one with every second row missing gives 0.58 or 0.5 times that.
PIXEL_RATIO = (0.8, 1.25)
LONGEST_PIXEL = 2.5  # ratio of the sides up to which a lattice of two pitches is recognised for the error message
CLEAR_SKEW_DEG = 4.0  # by which the best pair of lattice axes must be squarer than the second
# Pairs of axes that describe the same lattice; the first dots may have had gaps as neighbours.
WAYS = [(i, j) for i in range(3) for j in range(-2, 3) if i > 0 or j > 0]
AXES = [
    np.array(pair)
    for pair in itertools.combinations(WAYS, 2)
    if abs(pair[0][0] * pair[1][1] - pair[0][1] * pair[1][0]) == 1
]


def _with_square_axes(fitted: _BoardMap, cell: NDArray[np.float64]) -> _BoardMap:
    """The same dots along the two lattice axes that make the image's axes perpendicular on the face."""
    # Where pixels are far from square, the diagonal of a rotated board may be shorter in the image than its side. A
    # square lattice at 32 degrees along a diagonal is again square, with pixels 2.6 times as long as wide, which no
    # camera has.
    step = fitted.face_step(cell)
    skews = np.array([abs(skew_deg(axes @ step)) for axes in AXES])
    width, height = np.array([np.linalg.norm(axes @ step, axis=0) for axes in AXES]).T
    ratios = height / width
    usual = (ratios > PIXEL_RATIO[0]) & (ratios < PIXEL_RATIO[1])
    first, second = np.argsort(np.where(usual, skews, 90.0))[:2]
    if not usual[first] or skews[first] > MOST_SKEW_DEG:
        raise _no_square(skews, ratios, usual)
    if usual[second] and skews[second] - skews[first] < CLEAR_SKEW_DEG:
        raise CalibrationError(
            f"the dots' rows must differ from their diagonals; both fit a square lattice to {skews[second]:.0f} "
            "degrees (lay the rows along the image's axes)"
        )
    axes = AXES[first]
    if abs((axes @ step)[0, 0]) < abs((axes @ step)[1, 0]):
        axes = axes[::-1]
    # Count along the image's axes as nearly as possible: the rotation then has a sign.
    axes = axes * np.sign(np.diag(axes @ step))[:, None]
    return _fit_map(fitted.cells @ axes.T, fitted.positions_px)


def _no_square(skews: NDArray[np.float64], ratios: NDArray[np.float64], usual: NDArray[np.bool]) -> CalibrationError:
    """Explain why no pair of lattice axes gives the pixels of a camera."""
    long = (ratios < LONGEST_PIXEL) & (ratios > 1 / LONGEST_PIXEL)
    squarest = int(np.argmin(np.where(long, skews, 90.0)))
    if long[squarest] and skews[squarest] <= MOST_SKEW_DEG:
        return CalibrationError(
            "the board's rows and columns must be one pitch apart, with no row missing throughout; they would make a "
            f"pixel {ratios[squarest]:.2f} times as high as wide, and cameras' pixels are {PIXEL_RATIO[0]:g} to "
            f"{PIXEL_RATIO[1]:g} (use a board of dots on a square lattice, not a hexagonal one)"
        )
    skew = float(np.where(usual, skews, 90.0).min() if usual.any() else skews.min())
    return CalibrationError(
        f"the dots must form a square lattice seen straight on, to {MOST_SKEW_DEG:g} degrees; theirs is {skew:.1f} "
        "degrees askew (use a board with one pitch along both axes and square rows, and press it without tilt)"
    )


def rotation_deg(step: NDArray[np.float64]) -> float:
    """Angle in the image from the x axis towards the y axis to the nearest lattice axis, in [-45, 45]."""
    angle = -float(np.degrees(np.arctan2(step[1, 0], step[0, 0])))
    return (angle + 45.0) % 90.0 - 45.0


def skew_deg(step: NDArray[np.float64]) -> float:
    """Departure of the image's two axes from a right angle on the face."""
    x, y = step.T
    sine = (x @ y) / (np.linalg.norm(x) * np.linalg.norm(y))
    return float(np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))))


NEAREST = 12  # neighbours in the search for a dot's two steps
MISS = 0.3  # largest distance of a dot from its prediction, in steps; a wide-angle lens changes steps by a fifth
STARTS = 8  # dots tried as the first one
ENOUGH = 0.95  # fraction of the spots on the lattice that ends the search for a better first dot
MORE = 1.2  # required factor of links over the best lattice so far
DENSE = 1.2  # links each to neighbours: 2 on an endless board without gaps


def _index_lattice(positions_px: NDArray[np.float64]) -> NDArray[np.int64]:
    """Spot number and lattice position (spot, i, j) of each spot of the lattice; (0, 3) when no two steps repeat."""
    # From a first dot the lattice grows to the neighbour nearest to its prediction, with steps that follow the image's
    # distortion; a missing dot is skipped. Growth begins at the dots with the most common steps; the lattice with
    # clearly the most pairs of neighbours wins. The order of the lattice's axes is arbitrary.
    best = np.empty((0, 3), dtype=np.int64)
    if len(positions_px) < 4:
        return best
    tree = scipy.spatial.cKDTree(positions_px)
    starts = [(first, _first_steps(positions_px, tree, first)) for first in range(len(positions_px))]
    existing = [(first, steps) for first, steps in starts if steps is not None]
    if not existing:
        return best
    # The most common steps come first: beside gaps a diagonal looks like a step, beside a stray spot half a step.
    steps_of = np.array([steps for _, steps in existing])
    most = 0
    for position in np.argsort(-_same_lattice(steps_of), kind="stable")[:STARTS]:
        lattice = _grown(positions_px, tree, existing[position][0], existing[position][1])
        links = _link_count(lattice)
        if links > MORE * most:
            best, most = lattice, links
        if len(best) >= ENOUGH * len(positions_px) and most >= DENSE * len(best):
            break
    return best


def _first_steps(
    positions: NDArray[np.float64], tree: scipy.spatial.cKDTree, first: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """The two shortest steps, not nearly parallel, that have dots at both ends."""
    near = np.asarray(tree.query(positions[first], k=min(NEAREST + 1, len(positions)))[1])
    ways = positions[near[1:]] - positions[first]
    forth_and_back = [
        way
        for way in ways
        if np.linalg.norm(ways + way, axis=1).min() < MISS * np.linalg.norm(way)
        and (way[0], way[1]) > (-way[0], -way[1])
    ]
    pairs = itertools.combinations(forth_and_back, 2)
    for first_way, second_way in sorted(pairs, key=lambda pair: float(np.linalg.norm(pair, axis=1).sum())):
        area = first_way[0] * second_way[1] - first_way[1] * second_way[0]
        if abs(area) > 0.5 * np.linalg.norm(first_way) * np.linalg.norm(second_way):
            return first_way, second_way
    return None


def _same_lattice(steps: NDArray[np.float64]) -> NDArray[np.int64]:
    """Number of similar pairs of steps for each pair, shape (n,), from pairs of shape (n, 2, 2)."""
    straight = np.linalg.norm(steps[:, None] - steps[None], axis=3).max(axis=2)
    crossed = np.linalg.norm(steps[:, None] - steps[None, :, ::-1], axis=3).max(axis=2)
    shorter = np.linalg.norm(steps, axis=2).min(axis=1)
    return np.asarray((np.minimum(straight, crossed) < MISS / 2 * shorter[:, None]).sum(axis=1))


def _link_count(rows: NDArray[np.int64]) -> int:
    """Pairs of neighbours on the lattice."""
    cells = {(int(i), int(j)) for _, i, j in rows}
    return sum(((i + 1, j) in cells) + ((i, j + 1) in cells) for i, j in cells)


def _grown(
    positions: NDArray[np.float64],
    tree: scipy.spatial.cKDTree,
    first: int,
    steps: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> NDArray[np.int64]:
    spot_at = {(0, 0): first}
    cell_of = {first: (0, 0)}
    waiting = list(_links(positions, tree, first, steps))
    heapq.heapify(waiting)
    while waiting:
        _, start, axis, extent, spot = heapq.heappop(waiting)
        i, j = cell_of[start]
        cell = (i + extent, j) if axis == 0 else (i, j + extent)
        if spot in cell_of or cell in spot_at:
            continue
        spot_at[cell], cell_of[spot] = spot, cell
        measured = _measured_steps(positions, cell, spot_at, steps)
        for link in _links(positions, tree, spot, measured):
            heapq.heappush(waiting, link)
    return np.array([(spot, i, j) for (i, j), spot in spot_at.items()], dtype=np.int64)


def _links(
    positions: NDArray[np.float64],
    tree: scipy.spatial.cKDTree,
    start: int,
    steps: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> Iterator[tuple[float, int, int, int, int]]:
    """_Spots near the predictions from a dot: (relative miss, start, axis, steps, spot)."""
    for axis, extent in itertools.product((0, 1), (1, -1, 2, -2)):
        distance, spot = tree.query(positions[start] + extent * steps[axis])
        miss = float(distance / np.linalg.norm(steps[axis]))
        if miss < MISS:
            # Double steps only after all single steps.
            yield miss + (abs(extent) - 1), start, axis, extent, int(spot)


def _measured_steps(
    positions: NDArray[np.float64],
    cell: tuple[int, int],
    spot_at: dict[tuple[int, int], int],
    first: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The steps about a dot: medians over the pairs around it, each axis separately."""
    medians = []
    for axis, default in enumerate(first):
        steps = list(_steps_around(positions, cell, spot_at, axis))
        medians.append(np.median(steps, axis=0) if steps else default)
    return medians[0], medians[1]


def _steps_around(
    positions: NDArray[np.float64], cell: tuple[int, int], spot_at: dict[tuple[int, int], int], axis: int
) -> Iterator[NDArray[np.float64]]:
    for di, dj in itertools.product(range(-2, 3), repeat=2):
        low = (cell[0] + di, cell[1] + dj)
        high = (low[0] + 1, low[1]) if axis == 0 else (low[0], low[1] + 1)
        if low in spot_at and high in spot_at:
            yield positions[spot_at[high]] - positions[spot_at[low]]


LEAST_FRACTION = 2e-4  # least relative uncertainty of a picture of spots: light, aberrations, the gel's creep
EVEN = 3**0.5  # bound of an even distribution over its standard deviation
BY_CHANCE = 2.0  # standard deviations that noise explains


def _with_model_uncertainty(
    sizes: tuple[MeasuredValue, MeasuredValue], fitted: _BoardMap, cell: NDArray[np.float64]
) -> tuple[MeasuredValue, ...]:
    """Pixel sizes (x, y) at a lattice position with the uncertainty of the map added to that of its residuals."""
    bend = _beyond_noise(*fitted.bend(cell))
    # An error between none and half the skew is equally likely (GUM 4.3.7: bound over the root of three).
    askew = _skew_beyond_noise(fitted, cell) / 2 / EVEN
    fractions = np.sqrt(LEAST_FRACTION**2 + bend**2 + askew**2)
    return tuple(_widened(size, float(fraction)) for size, fraction in zip(sizes, fractions, strict=True))


def _beyond_noise(values: NDArray[np.float64], noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part of ``values`` that noise does not explain; the residuals' part includes the rest."""
    return np.asarray(np.sqrt(np.maximum(values**2 - (BY_CHANCE * noise) ** 2, 0.0)))


def _skew_beyond_noise(fitted: _BoardMap, cell: NDArray[np.float64]) -> float:
    """Sine of the skew that noise does not explain."""
    # Cameras have square axes, so the skew comes from the board or the tilt. Pitches with a relative difference e,
    # rotated by 45 degrees, show a skew of e and an error of e / 2 in both pixel sizes; a board sheared by an angle s
    # causes a smaller error in one of them, 1 - cos(s).
    sine = np.sin(np.radians(skew_deg(fitted.face_step(cell))))
    x, y = fitted.pixel_size(cell, pitch=MeasuredValue(value=1.0, sd=0.0))
    return float(_beyond_noise(np.array(sine), np.hypot(x.sd / x.value, y.sd / y.value)))


def _widened(size: MeasuredValue, fraction: float) -> MeasuredValue:
    added = (fraction * size.value) ** 2
    total = size.sd**2 + added
    # Only the residuals' part has few degrees of freedom (Welch and Satterthwaite).
    freedom = size.degrees_of_freedom * (total / size.sd**2) ** 2 if size.sd > 0 else np.inf
    return MeasuredValue(value=size.value, sd=total**0.5, degrees_of_freedom=float(freedom), unit=size.unit)


FEWEST = 16  # dots
LEAST_SIDE = 3  # dots along each side of the lattice: two have no residual
MOST_STRANGERS = 0.5  # fraction of the spots off the lattice
ROUGHEST = 0.06  # root mean square residual over the dots' distance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DotDiagnostics:
    """Diagnostics of a scale from dots.

    Attributes
    ----------
    centres_px
        Centres (x, y) of the dots used, shape (n, 2), pixels.
    cells
        Their lattice positions, whole pitches, shape (n, 2).
    residuals_px
        Centre minus fitted position, shape (n, 2), pixels.
    strays_px
        _Spots outside the lattice, shape (m, 2), pixels.
    bright
        True when the dots are brighter than their surroundings.
    width_px
        Standard deviation of a Gaussian as wide as the dots, pixels.
    order
        Order of the polynomial fitted: 3, or 5 for a wide-angle lens.
    distortion_chance
        Probability of the apparent distortion without any.
    distorted
        True when the distortion is beyond chance.
    largest_change
        Largest relative difference, along either axis, between the pixel size at a dot and the scale: the error of
        the scale elsewhere in the image.
    """

    centres_px: NDArray[np.float64]
    cells: NDArray[np.float64]
    residuals_px: NDArray[np.float64]
    strays_px: NDArray[np.float64]
    bright: bool
    width_px: float
    order: int
    distortion_chance: float
    distorted: bool
    largest_change: float

    def __post_init__(self) -> None:
        freeze_arrays(self, "centres_px", "cells", "residuals_px", "strays_px", dtype=float)


def scale_from_dots(
    image: TactileImage,
    reference: TactileImage | None = None,
    *,
    pitch_mm: float,
    pitch_sd_mm: float = 0.0,
    min_dots: int = FEWEST,
) -> tuple[PixelScale, DotDiagnostics]:
    """Measure the size of a pixel along each image axis on a square board of dots.

    The dots may be darker or brighter than their surroundings and rotated by any angle, and some may be missing. The
    scale is the mean over one pitch to either side of the probe's axis (``image.axis_px``). Perspective and lens
    distortion are fitted too: they widen the interval and do not shift the scale. The interval also includes the bend
    of the pixel size over that pitch, a skew beyond noise, and at least 2e-4 of the size.

    Along the image's axes a board with two pitches looks like a camera with longer pixels: it is refused only where
    the pixels' sides would differ by more than a quarter. Rotated by 45 degrees it shows its pitches as skew. Where
    every second dot is missing as on a chessboard the lattice is again square; this is not detected.

    Raises `CalibrationError` when there are no dots, or too few, when they form no square lattice or several, when a
    pixel would be outside 0.8 to 1.25 times as high as wide or the lattice more than 3 degrees askew, or when the scale
    is impossible for a tactile probe; `ImageMismatchError` when the reference differs from the image in size, scale or
    full scale; `InputError` when an argument is outside its range.

    Parameters
    ----------
    image
        The probe with the board pressed on it; its own scale is not used.
    reference
        The untouched probe in the same light; None when the light is even.
    pitch_mm
        Distance of neighbouring dots, centre to centre, along both axes of the board, in [0.05, 50] mm.
    pitch_sd_mm
        Its standard uncertainty, in [0, 1] mm: of the mean pitch over the board, not the scatter of single dots.
    min_dots
        Fewest dots, 16 or more: fewer cannot separate distortion from scale.

    Returns
    -------
    scale : PixelScale
        The pixel sizes with their uncertainties.
    diagnostics : DotDiagnostics
        The dots, the lattice, the residuals, and the distortion.

    Examples
    --------
    >>> from tsis.imaging.sensor import Sensor
    >>> from tsis.virtual.calibration_bench import dot_board_frame
    >>> frame = dot_board_frame(Sensor(mm_per_pixel=(0.0336, 0.0392)), rng=np.random.default_rng(1), pitch_mm=2.5)
    >>> scale, diagnostics = scale_from_dots(frame, pitch_mm=2.5)
    >>> [round(size, 4) for size in scale.mm_per_pixel]
    [0.0336, 0.0392]
    """
    require_image("image", image)
    pitch = MeasuredValue(
        value=require_number("pitch_mm", pitch_mm, 0.05, 50.0, hint="millimetres"),
        sd=require_number("pitch_sd_mm", pitch_sd_mm, 0.0, 1.0, hint="millimetres"),
        unit="mm",
    )
    min_dots = require_integer("min_dots", min_dots, FEWEST, 10**6)
    change = image if reference is None else subtract_background(image, reference)
    spots = find_spots(change.grey, least=min_dots)
    cells, centres, strays = _dots(spots, min_dots)
    fitted = _fit_map(cells, centres)
    cell = _cell_of_axis(fitted, image.axis())
    fitted = _with_square_axes(fitted, cell)
    cell = fitted.cell_at(image.axis())
    _check_rough(fitted)
    x, y = _with_model_uncertainty(fitted.pixel_size(cell, pitch=pitch), fitted, cell)
    check_field((x.value, y.value), image.grey.shape, "pitch_mm", pitch_mm)
    residuals = fitted.residuals_px()
    step = fitted.face_step(cell)
    scale = PixelScale(
        mm_per_pixel_x=x,
        mm_per_pixel_y=y,
        shape=(image.grey.shape[0], image.grey.shape[1]),
        at_px=image.axis(),
        method="dots",
        count=len(cells),
        residual_px=_root_mean_square(residuals),
        rotation_deg=rotation_deg(step),
        skew_deg=skew_deg(step),
    )
    chance = _chance_of(_fit_order(fitted.cells, fitted.positions_px, FIRST_ORDER), fitted)
    sizes = np.array([np.linalg.norm(fitted.face_step(dot), axis=0) for dot in fitted.cells])
    diagnostics = DotDiagnostics(
        centres_px=centres,
        cells=fitted.cells,
        residuals_px=residuals,
        strays_px=strays,
        bright=spots.bright,
        width_px=spots.width_px,
        order=fitted.order,
        distortion_chance=chance,
        distorted=chance < BEYOND_CHANCE,
        largest_change=float(np.abs(sizes / np.linalg.norm(step, axis=0) - 1).max()),
    )
    return scale, diagnostics


def _dots(spots: _Spots, least: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Lattice coordinates and centres of the dots, and the centres of the other spots."""
    positions = spots.positions_px
    if len(positions) < least:
        raise CalibrationError(
            f"image must show at least {least} dots; {len(positions)} spots stand out (press the dot board flat on the "
            "face, light it evenly, and give the untouched probe as reference)"
        )
    rows = _index_lattice(positions)
    if len(rows) < max(least, (1 - MOST_STRANGERS) * len(positions)):
        raise CalibrationError(
            f"image must show at least {least} dots of a square lattice; of {len(positions)} spots {len(rows)} lie on "
            "one (press the dot board flat on the face, and clean the face)"
        )
    cells = rows[:, 1:].astype(float)
    centres = _in_even_light(positions[rows[:, 0]], spots.strength[rows[:, 0]], spots.width_px)
    if min(len(np.unique(cells[:, axis])) for axis in (0, 1)) < LEAST_SIDE:
        raise CalibrationError(
            f"the dots must form at least {LEAST_SIDE} rows and {LEAST_SIDE} columns; {len(rows)} dots lie in fewer "
            "(press the whole board on the face)"
        )
    good = _without_strays(cells, centres)
    dots = set(rows[good, 0].tolist())
    strays = np.array([position for spot, position in enumerate(positions) if spot not in dots]).reshape(-1, 2)
    return cells[good], centres[good], strays


def _cell_of_axis(fitted: _BoardMap, axis_px: tuple[float, float]) -> NDArray[np.float64]:
    cell = fitted.cell_at(axis_px)
    low, high = fitted.cells.min(axis=0) - 1, fitted.cells.max(axis=0) + 1
    if not (np.isfinite(cell).all() and (low <= cell).all() and (cell <= high).all()):
        raise CalibrationError(
            f"the dots must surround the probe's axis at ({axis_px[0]:.0f}, {axis_px[1]:.0f}) px, where the scale is "
            "measured; they lie aside (press the board on the middle of the face)"
        )
    return cell


def _check_rough(fitted: _BoardMap) -> None:
    nearest = np.asarray(scipy.spatial.cKDTree(fitted.positions_px).query(fitted.positions_px, k=2)[0])
    rough = _root_mean_square(fitted.residuals_px()) / float(np.median(nearest[:, 1]))
    if rough > ROUGHEST:
        raise CalibrationError(
            f"the dots must lie on a lattice to {ROUGHEST:.0%} of their distance; they miss it by {rough:.0%} (press "
            "the board flat on the face, and clean the face)"
        )


def _root_mean_square(residuals_px: NDArray[np.float64]) -> float:
    return float(np.sqrt((residuals_px**2).sum(axis=1).mean()))

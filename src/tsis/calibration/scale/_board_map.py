"""The map from a dot board to the image with lens distortion, and the size of a pixel with its uncertainty.

The image coordinates of the dots are polynomials of the board's: linear terms are scale and rotation, quadratic terms
the perspective of a tilted camera, cubic and higher terms the lens. The least-squares fit gives each image axis its own
residual variance: noise is in pixels, the scatter of the dots in millimetres, and their ratio differs between the axes
where pixels are not square.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.calibration._measured import MeasuredValue
from tsis.calibration.scale._value import UNIT
from tsis.errors import CalibrationError

if TYPE_CHECKING:
    from numpy.typing import NDArray


FIRST_ORDER, LENS_ORDER, WIDE_ORDER = 1, 3, 5  # the distortion of a lens is odd
SPARE = 0.375  # least fraction of the dots' coordinates that remains as degrees of freedom
BEYOND_CHANCE = 1e-3  # probability below which distortion counts as observed
WORTH_FITTING = 0.05  # probability below which wide-angle terms are fitted: omitted true terms shift the scale
STRAY = 1e-3  # probability that one dot of a good board counts as a stray
MOST_STRAYS = 0.1  # fraction of the dots


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoardMap:
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
        """Step on the face, in pitches, of one pixel along each image axis: columns x and y of a (2, 2) array.

        The step is the mean over ``extent`` pitches to either side; a board resolves no less than one.
        """
        return np.asarray(np.linalg.inv(self._step_px(cell, extent=extent)))

    def pixel_size(self, cell: NDArray[np.float64], *, pitch: MeasuredValue) -> tuple[MeasuredValue, MeasuredValue]:
        """Size (x, y) of a pixel on the face at a lattice position, by propagation of the residuals' variance.

        The degrees of freedom follow Welch and Satterthwaite for the two image axes and the pitch.
        """
        back = self.face_step(cell)
        slopes = self._slopes(cell, extent=1.0)
        x, y = (self._size_along(back, slopes, axis, pitch) for axis in (0, 1))
        return x, y

    def _size_along(
        self, back: NDArray[np.float64], slopes: NDArray[np.float64], axis: int, pitch: MeasuredValue
    ) -> MeasuredValue:
        size = float(np.linalg.norm(back[:, axis]))
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
        """Relative bend of the pixel size over one pitch to either side, and its noise.

        The bend (x, y) is the excess of the mean over one pitch above the size at the position itself; its standard
        deviation follows by propagation of the residuals' variance.
        """
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
        return terms(cells, self.cells, self.order)


def terms(cells: NDArray[np.float64], about: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """Products of powers of lattice coordinates up to an order, scaled by middle and half width of ``about``.

    Three rows cannot separate a cubic from a linear term: powers stay below the number of rows and of columns.
    """
    middle, half = (about.max(axis=0) + about.min(axis=0)) / 2, np.ptp(about, axis=0) / 2
    u, v = ((cells - middle) / half).T
    columns, rows = (len(np.unique(about[:, axis])) for axis in (0, 1))
    powers = [(a, b) for a, b in itertools.product(range(columns), range(rows)) if a + b <= order]
    return np.stack([u**a * v**b for a, b in powers], axis=1)


def fit_map(cells: NDArray[np.float64], positions_px: NDArray[np.float64]) -> BoardMap:
    """The map of the highest order that the dots support.

    The lens's cubic terms are always fitted: without them an interval is valid only for a lens without distortion.
    Wide-angle terms are added when chance hardly explains their improvement.
    """
    if not carries(cells, LENS_ORDER):
        raise CalibrationError(
            f"the dots must fill rows and columns, so that the lens's distortion can be separated from the scale; got "
            f"{len(cells)} dots that do not (press the whole board on the face)"
        )
    order = fit_order(cells, positions_px, LENS_ORDER)
    if carries(cells, WIDE_ORDER):
        wide = fit_order(cells, positions_px, WIDE_ORDER)
        if chance_of(order, wide) < WORTH_FITTING:
            return wide
    return order


def carries(cells: NDArray[np.float64], order: int) -> bool:
    """Whether number, rows and columns of the dots suffice for a polynomial of an order."""
    design = terms(cells, cells, order)
    count = design.shape[1]
    return count <= (1 - SPARE) * len(cells) and bool(np.linalg.matrix_rank(design) == count)


def chance_of(small: BoardMap, large: BoardMap) -> float:
    """Probability of such an improvement by the higher order where the lower order is true (Fisher's F)."""
    added, freedom = 2 * (len(large.factors) - len(small.factors)), 2 * large.degrees_of_freedom
    # Each image axis with its own variance, as in the fit.
    before = (small.residuals_px() ** 2).sum(axis=0) / large.sd_px**2
    gained = float(before.sum()) - freedom
    return float(scipy.stats.f.sf(max(gained, 0.0) / added, added, freedom))


def without_strays(cells: NDArray[np.float64], positions_px: NDArray[np.float64]) -> NDArray[np.bool]:
    """True for the dots whose position agrees with a map fitted without them."""
    good = np.ones(len(cells), dtype=bool)
    for _ in range(int(MOST_STRAYS * len(cells))):
        fitted = fit_map(cells[good], positions_px[good])
        design = terms(fitted.cells, fitted.cells, fitted.order)
        lever = 1 - np.einsum("ij,jk,ik->i", design, fitted.spread, design)
        freedom = fitted.degrees_of_freedom
        squares = fitted.residuals_px() ** 2 / np.maximum(lever, 1e-9)[:, None] / np.maximum(fitted.sd_px, 1e-9) ** 2
        outside = np.sqrt(squares * (freedom - 1) / np.maximum(freedom - squares, 1e-9)).max(axis=1)
        worst = int(np.argmax(outside))
        if outside[worst] < scipy.stats.t.isf(STRAY / (4 * len(cells)), freedom - 1):
            break
        good[np.flatnonzero(good)[worst]] = False
    return good


def fit_order(cells: NDArray[np.float64], positions_px: NDArray[np.float64], order: int) -> BoardMap:
    """Fit the map of a given order by least squares."""
    design = terms(cells, cells, order)
    factors = np.linalg.lstsq(design, positions_px, rcond=None)[0]
    squares = ((positions_px - design @ factors) ** 2).sum(axis=0)
    return BoardMap(
        cells=cells,
        positions_px=positions_px,
        order=order,
        factors=np.asarray(factors, dtype=float),
        spread=np.asarray(np.linalg.inv(design.T @ design), dtype=float),
        sd_px=np.sqrt(squares / (len(cells) - len(factors))),
    )

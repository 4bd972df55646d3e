"""Uneven tissue as one random field that all presses see.

The logarithm of the modulus is a Gaussian field of unknown standard deviation and correlation length. It is a sum of
plane waves; a wave seen from the place of a press is a Bessel function of the distance times a harmonic around the
axis, so that the covariance of two presses needs no grid. A press whose place is uncertain sees a wave with a random
phase: its covariance with other presses falls by ``exp(-(k sd)**2 / 2)`` for each of them, its variance stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from tsis.mapping.signals import Floats, Integers, Shapes
    from tsis.mechanics.tissue_field import TissueFieldResponse

LENGTHS_MM = np.geomspace(2.0, 18.0, 7)
LONGEST_WAVE, HEIGHTS = 3.8, 14  # wave numbers across up to this over the length; nodes along the depth
TAIL_FREEDOM = 4.0  # degrees of freedom of the rougher spectrum
BESSEL_PART, BESSEL_STEP = 50.0, 0.02  # of the table of Bessel functions


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WaveAnswers:
    """Answer of a press at the origin to plane waves of one length.

    Attributes
    ----------
    number
        Wave numbers across, shape (k,), and ``weight`` of each, which sum to 1.
    cosine, sine
        Answers to waves ``cos`` and ``sin`` along the depth for each shape, shape (k, heights, shapes), times the root
        of the weight of the wave number along the depth.
    along
        Wave numbers along the depth, shape (heights,), and ``along_weight``.
    """

    number: Floats
    weight: Floats
    cosine: Floats
    sine: Floats
    along: Floats
    along_weight: Floats


class FieldResponses:
    """Responses of the numbers of a press to the field, at the integration points of its mesh."""

    def __init__(
        self,
        slab: TissueFieldResponse,
        shapes: Shapes,
        rows: Floats,
        *,
        displacement_rows: Floats | None,
        force_n: float,
    ) -> None:
        self.shapes = shapes
        self._response, self._radius, self._depth = [], [], []
        for order, basis in enumerate(shapes.basis):
            response = slab.response(order)
            profile = rows @ (force_n * response.pressure_kpa[0] + response.pressure_kpa[1])
            if displacement_rows is not None and displacement_rows.any():
                moved = force_n * response.face_displacement_mm[0] + response.face_displacement_mm[1]
                profile = profile + displacement_rows @ moved
            self._response.append(basis.T @ profile)
            self._radius.append(response.radius_mm)
            self._depth.append(response.depth_mm)

    def uniform(self) -> Floats:
        """Response of the numbers to a uniform field of 1: the derivative by the logarithm of the tissue's modulus."""
        result = np.zeros(self.shapes.count)
        part = self._response[0].sum(axis=1)
        result[: len(part)] = part
        return result

    def waves(self, length_mm: float, extent_mm: float) -> WaveAnswers:
        """Answers to waves; ``extent_mm`` is the largest distance of two presses, which sets the wave numbers' step."""
        reach = extent_mm + 2 * float(min(self._radius[0].max(), 30.0))
        count = int(np.clip(np.ceil(LONGEST_WAVE / length_mm * reach / np.pi * 1.3), 12, 120))
        number = (np.arange(count) + 0.5) * (LONGEST_WAVE / length_mm / count)
        weight = number * np.exp(-0.5 * (number * length_mm) ** 2)
        along, along_weight = np.polynomial.hermite_e.hermegauss(2 * HEIGHTS)
        along, along_weight = along[HEIGHTS:], 2 * along_weight[HEIGHTS:] / along_weight.sum()
        root = np.sqrt(along_weight)[None, :, None]
        cosine: list[Floats] = []
        sine: list[Floats] = []
        for order, response in enumerate(self._response):
            radius, depth = self._radius[order], self._depth[order]
            values, inverse = np.unique(radius.round(9), return_inverse=True)
            phase = np.outer(depth, along / length_mm)
            radial = scipy.special.jv(order, np.outer(number, values))  # (k, radii)
            for target, wave in ((cosine, np.cos(phase)), (sine, np.sin(phase))):
                product = response[:, :, None] * wave[None]  # (shapes, points, heights)
                by_radius = np.zeros((len(values), *product.shape[::2]))
                np.add.at(by_radius, inverse, np.moveaxis(product, 1, 0))
                target.append(np.einsum("kr,rsh->khs", radial, by_radius, optimize=True) * root)
        return WaveAnswers(
            number=np.asarray(number, dtype=float),
            weight=weight / weight.sum(),
            cosine=np.concatenate(cosine, axis=2),
            sine=np.concatenate(sine, axis=2),
            along=along / length_mm,
            along_weight=along_weight,
        )

    def covariance(
        self, length_mm: float, places_mm: Floats, angle: Floats, force: Floats, place_sd_mm: Floats
    ) -> Floats:
        """Covariance of all numbers of all presses by a field of unit variance, (presses * numbers) squared."""
        blur = place_sd_mm[:, None] ** 2 + place_sd_mm[None] ** 2
        np.fill_diagonal(blur, 0.0)
        presses, count = len(places_mm), self.shapes.count
        waves = self.waves(length_mm, float(scipy.spatial.distance.pdist(places_mm).max(initial=0.0)))
        each, total = np.arange(presses), np.zeros((presses, count, presses, count))
        for rows, columns, geometry, block in self._pairs(waves, places_mm, places_mm, angle, blur):
            values = np.einsum("kpq,kst->psqt", geometry, block, optimize=True)
            total[np.ix_(each, rows, each, columns)] = values
        total *= force[:, None, None, None] * force[None, None, :, None]
        result = total.reshape(presses * count, presses * count)
        return (result + result.T) / 2

    def predicted(
        self,
        length_mm: float,
        moved_mm: Sequence[Floats],
        places_mm: Floats,
        angle: Floats,
        force: Floats,
        place_sd_mm: Floats,
        weights: Floats,
    ) -> list[Floats]:
        """The numbers of the presses at other places: their covariance with those at the places times ``weights``.

        ``moved_mm`` has the other places of all presses, each of shape (presses, 2), and ``weights`` the weights of all
        numbers, (presses, numbers). A press's place and its other place do not err in common: see
        `tsis.mapping.places`.
        """
        extent = max(float(scipy.spatial.distance.cdist(moved, places_mm).max()) for moved in moved_mm)
        waves = self.waves(length_mm, extent)
        weights, blur = weights * force[:, None], np.broadcast_to(place_sd_mm**2, (len(places_mm), len(places_mm)))
        results = []
        for moved in moved_mm:
            result = np.zeros_like(weights)
            for rows, columns, geometry, block in self._pairs(waves, moved, places_mm, angle, blur):
                weighted = np.einsum("kst,qt->kqs", block, weights[:, columns], optimize=True)
                result[:, rows] += np.einsum("kpq,kqs->ps", geometry, weighted, optimize=True)
            results.append(result * force[:, None])
        return results

    def _pairs(
        self, waves: WaveAnswers, first_mm: Floats, second_mm: Floats, angle: Floats, blur_mm2: Floats
    ) -> Iterator[tuple[Integers, Integers, Floats, Floats]]:
        """For each two harmonics and sides: their numbers, geometry (k, presses, presses) and shapes (k, s, t).

        ``blur_mm2`` is the variance of the distance of each pair of places.
        """
        shift = first_mm[:, None] - second_mm[None]
        far = np.hypot(shift[..., 0], shift[..., 1])
        bearing = np.arctan2(shift[..., 1], shift[..., 0])
        inner = np.einsum("khs,kht->kst", waves.cosine, waves.cosine, optimize=True)
        inner += np.einsum("khs,kht->kst", waves.sine, waves.sine, optimize=True)
        blur = np.exp(-0.5 * waves.number[:, None, None] ** 2 * blur_mm2) * waves.weight[:, None, None]
        # J_n(k d): the mean over directions of exp(i k d cos) cos(n .) is i^n J_n
        around = bessel(2 * int(self.shapes.order.max()), waves.number[:, None, None] * far) * blur
        outputs = self.shapes.outputs
        starts = np.concatenate([[0], np.cumsum([part.shape[1] for part in self.shapes.basis])])
        place = {(m, side): np.flatnonzero([(o[0], o[1]) == (m, side) for o in outputs]) for m, side, _ in outputs}
        for m, side in place:
            for n, other in place:
                block = inner[:, starts[m] : starts[m + 1], starts[n] : starts[n + 1]]
                geometry = _around(m, side, n, other, bearing, angle, around)
                yield place[m, side], place[n, other], geometry, block

    def with_points(self, length_mm: float, at_mm: Floats, places_mm: Floats, angle: Floats, force: Floats) -> Floats:
        """Covariance of the field of unit variance at points (n, 3) with all numbers, (n, presses * numbers).

        It is tabulated over distance and depth.
        """
        shift = at_mm[:, None, :2] - places_mm[None]
        far, bearing = np.hypot(shift[..., 0], shift[..., 1]), np.arctan2(shift[..., 1], shift[..., 0]) - angle
        waves = self.waves(length_mm, float(far.max()))
        grid = np.arange(0.0, far.max() + 1.0, 0.5)
        levels, level = np.unique(at_mm[:, 2].round(6), return_inverse=True)
        root = np.sqrt(waves.along_weight)
        phase = np.outer(levels, waves.along)
        outputs, order = self.shapes.outputs, self.shapes.order
        across = scipy.special.jv(order[:, None, None], np.outer(waves.number, grid)) * waves.weight[:, None]
        mixed = np.einsum("khs,zh->kzs", waves.cosine, np.cos(phase) * root, optimize=True)
        mixed += np.einsum("khs,zh->kzs", waves.sine, np.sin(phase) * root, optimize=True)
        table = np.einsum("skg,kzs->zgs", across, mixed, optimize=True)  # (levels, grid, shapes)
        cell = np.minimum((far / 0.5).astype(int), len(grid) - 2)
        part = far / 0.5 - cell
        result = np.empty((len(at_mm), len(places_mm), len(outputs)))
        starts = np.concatenate([[0], np.cumsum([one.shape[1] for one in self.shapes.basis])])
        for number, (m, side, shape) in enumerate(outputs):
            values = table[:, :, starts[m] + shape]
            radial = (1 - part) * values[level[:, None], cell] + part * values[level[:, None], cell + 1]
            turn = 1.0 if m == 0 else 2.0 * (np.sin(m * bearing) if side else np.cos(m * bearing))
            result[:, :, number] = radial * turn * force
        return result.reshape(len(at_mm), -1)


def bessel(most: int, x: Floats) -> Floats:
    """Bessel functions J_0 to J_most of positive numbers, (most + 1, ...), to 1e-9: from a table, 20 times as fast."""
    return np.asarray(_bessel_table(most, int(x.max(initial=0.0) // BESSEL_PART) + 1)(x))


@lru_cache(maxsize=8)
def _bessel_table(most: int, parts: int) -> scipy.interpolate.CubicHermiteSpline:
    """The functions up to so many parts of `BESSEL_PART`, with their derivatives (J_(n-1) - J_(n+1)) / 2."""
    x = np.arange(0.0, parts * BESSEL_PART + BESSEL_STEP, BESSEL_STEP)
    values = scipy.special.jv(np.arange(-1, most + 2)[:, None], x)
    return scipy.interpolate.CubicHermiteSpline(x, values[1:-1], (values[:-2] - values[2:]) / 2, axis=1)


def _around(m: int, side: int, n: int, other: int, bearing: Floats, angle: Floats, around: Floats) -> Floats:
    """Mean over the directions of waves of ``i^(m - n) exp(i k d) T_m T_n``, shape (k, presses, presses), with gains.

    ``T`` is the cosine or sine of the harmonic of each press in its own frame, ``around[n]`` the weighted J_n(k d).
    """
    gain = (1.0 if m == 0 else 2.0) * (1.0 if n == 0 else 2.0)
    total = np.zeros(around.shape[1:])
    # T_m T_n as sums of cosines and sines of (m - n) and (m + n): cos(a) = Re, sin(a) = Re(-i e^{ia})
    for sign in (1, -1):
        # product of cos(m b - pa) cos(n b - pb) = (cos(diff) + cos(sum)) / 2, phases pa, pb of each side
        phase = side * np.pi / 2 + m * angle[:, None] + sign * (other * np.pi / 2 + n * angle[None])
        harmonic = m + sign * n
        # mean over b: i^(m-n) e^{i k d cos(b - bearing)} cos(h b - phase) = i^(m-n+|h|) J_|h| cos(h bearing - phase)
        power = (m - n + abs(harmonic)) % 4  # even: the answer is real
        total += (1.0 if power == 0 else -1.0) * np.cos(harmonic * bearing - phase) * around[abs(harmonic)]
    return gain * total / 2


def tail_weights(length_mm: float) -> Floats:
    """Weights of `LENGTHS_MM` in a field of a rougher spectrum: lengths spread by a chi-square of few freedoms."""
    edges = np.concatenate([[0.0], np.sqrt(LENGTHS_MM[1:] * LENGTHS_MM[:-1]), [np.inf]])
    share = scipy.stats.chi2.cdf(TAIL_FREEDOM * (edges / length_mm) ** 2, TAIL_FREEDOM)
    return np.diff(share)

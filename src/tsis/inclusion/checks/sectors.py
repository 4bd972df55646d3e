"""Means of a frame over rings and sectors, and harmonics around the axis.

The checks of contact, visibility, tilt and roundness use them. A harmonic of order m is a complex number per ring:
``c + i s`` of ``c cos(m angle) + s sin(m angle)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import compiled
from tsis.inclusion.frames import DARKEST, OUTER_FRACTION

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.prior import Booleans, Complexes, Floats, Integers
    from tsis.model.calibration import Calibration, LightMap
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe


RINGS, SECTORS = 12, 16  # sixteen separate the second harmonic from the fourth and eighth of four lamps
WHOLE = 0.95  # fraction of a sector that must be in the picture
FINE_ANGLES, FINE_RADII = 720, 8  # per circle and per ring: sampling of the visible area

_Geometry = tuple[tuple[int, int], tuple[float, float], tuple[float, float], float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SectorGrid:
    """Rings and sectors in the pictures of one camera, and their light."""

    # Index of each pixel's sector, ring by ring, flat; one beyond the last for pixels outside all rings
    sector: NDArray[np.uint8]
    count: Floats  # pixels in each sector, shape (rings, sectors)
    whole: Booleans  # rings whose sectors are all lit and in the picture, shape (rings,)
    light: Floats  # sum of the light over the pixels of each sector, shape (rings, sectors)
    radius_mm: Floats  # mean distance from the axis of the light in each sector, shape (rings, sectors)
    growth_per_mm: Floats  # growth of the light with displacement, weighted by the light, shape (rings, sectors)
    flux: Floats  # flux of the light away from the axis, weighted by the light, shape (rings, sectors)
    light_sd: Floats  # relative standard error of the mean light in each ring, by the number of rays, shape (rings,)
    extent_mm: float  # outer radius of the last ring

    @property
    def ring_radius_mm(self) -> Floats:
        """Mean distance of each ring's light from the axis, mm."""
        total = self.light.sum(axis=1)
        return np.asarray((self.light * self.radius_mm).sum(axis=1) / np.where(total > 0, total, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sectors:
    """Means of one frame over rings and sectors."""

    grid: SectorGrid  # the rings and sectors
    raw: Floats  # mean raw grey level, shape (rings, sectors)
    clipped: Integers  # clipped pixels, shape (rings, sectors)
    grey: Floats  # mean grey level above background at uniform light, at the ring's mean radius, shape (rings, sectors)
    variance: Floats  # variance of ``grey`` by pixel noise, shape (rings, sectors)
    pixel_variance: Floats  # variance of one pixel in each sector, grey levels squared, shape (rings, sectors)

    @property
    def usable(self) -> Booleans:
        """Complete rings without clipped pixels, shape (rings,)."""
        return np.asarray(self.grid.whole & (self.clipped.sum(axis=1) == 0))


def sector_means(frame: TactileImage, *, probe: Probe, calibration: Calibration) -> Sectors:
    """Means over rings and sectors of the profile's disc."""
    extent = OUTER_FRACTION * probe.radius_mm
    grid = _grid(_geometry(frame, extent), calibration.light)
    sums, clipped = _gather(frame.grey.ravel(), grid.sector, frame.full_scale)
    total = sums.reshape(RINGS, SECTORS)
    count, light = np.maximum(grid.count, 1), np.where(grid.light > 0, grid.light, 1.0)
    above = total - calibration.background_grey * grid.count
    pixel = calibration.read_noise_grey**2 + 1 / 12 + calibration.shot_noise_grey * np.maximum(above / count, 0.0)
    # Pixels and lamps are not symmetric: a sector lit more on its outside has a larger mean radius.
    away = grid.radius_mm - grid.ring_radius_mm[:, None]
    return Sectors(
        grid=grid,
        raw=total / count,
        clipped=clipped.reshape(RINGS, SECTORS),
        grey=above / light - _slope(above.sum(axis=1), grid)[:, None] * away,
        variance=pixel * grid.count / light**2,
        pixel_variance=pixel,
    )


def _slope(above: Floats, grid: SectorGrid) -> Floats:
    """Radial slope of the grey at uniform light, from its sums over rings; rings without light repeat the last."""
    light, ring = grid.light.sum(axis=1), np.arange(RINGS)
    lit = light > 0
    if not lit.any():
        return np.zeros(RINGS)
    grey = np.interp(ring, ring[lit], above[lit] / light[lit])
    return np.asarray(np.gradient(grey, grid.extent_mm / RINGS))


@compiled
def _gather(grey: Floats, position: NDArray[np.uint8], full_scale: float) -> tuple[Floats, Integers]:
    """Sum of the grey levels and number of clipped pixels in each sector, in one pass."""
    total = np.zeros(RINGS * SECTORS + 1)
    clipped = np.zeros(RINGS * SECTORS + 1, dtype=np.int64)
    # Neighbours are mostly in one sector: their sum stays in a register until the sector changes.
    here, glow, clips = position[0], 0.0, 0
    for pixel in range(len(grey)):
        if position[pixel] != here:
            total[here] += glow
            clipped[here] += clips
            here, glow, clips = position[pixel], 0.0, 0
        glow += grey[pixel]
        clips += grey[pixel] >= full_scale
    total[here] += glow
    clipped[here] += clips
    return total[:-1], clipped[:-1]


def ring_visibility(frame: TactileImage, edges_mm: Floats) -> Floats:
    """Fraction in [0, 1] of each ring's area in the picture; ``edges_mm`` ascend, shape (rings + 1,)."""
    return np.asarray(_visible(_geometry(frame, float(edges_mm[-1])), edges_mm.tobytes()).mean(axis=1))


def _geometry(frame: TactileImage, extent: float) -> _Geometry:
    rows, columns = frame.grey.shape
    return (rows, columns), frame.scale(), frame.axis(), extent


def _sums(position: NDArray[np.uint8], values: Floats | None) -> Floats:
    """Sums of ``values``, or numbers of pixels, over rings and sectors."""
    sums = np.bincount(position, weights=values, minlength=RINGS * SECTORS + 1)[: RINGS * SECTORS]
    return np.asarray(sums.reshape(RINGS, SECTORS), dtype=float)


@lru_cache(maxsize=8)  # equal for all frames of a camera
def _grid(geometry: _Geometry, light: LightMap | None) -> SectorGrid:
    (rows, columns), scale, axis, extent = geometry
    x, y = (np.arange(columns) - axis[0]) * scale[0], (np.arange(rows) - axis[1]) * scale[1]
    radius = np.hypot(x, y[:, None])
    ring = np.floor(radius * (RINGS / extent)).astype(np.intp)
    angle = np.arctan2(y[:, None], x[None, :]) / (2 * np.pi) % 1.0
    sector = np.minimum((angle * SECTORS).astype(np.intp), SECTORS - 1)
    position = np.where(ring < RINGS, ring * SECTORS + sector, RINGS * SECTORS).ravel().astype(np.uint8)
    count = _sums(position, None)

    edges = np.linspace(0.0, extent, RINGS + 1)
    area = np.pi * np.diff(edges**2)
    if light is None:
        lit, growth, flux = np.ones_like(radius), np.zeros_like(radius), np.zeros_like(radius)
        light_sd = np.zeros(RINGS)
    else:
        lit, flux_x, flux_y, growth, _ = light.undented(x, y)
        flux = (flux_x * x + flux_y * y[:, None]) / np.maximum(radius, 1e-9)
        # Each node of the map counts its own rays, so that the error of a ring's mean falls with its nodes.
        node = float(np.diff(light.x_mm).mean() * np.diff(light.y_mm).mean())
        light_sd = light.error / np.sqrt(np.maximum(area / node, 1.0))
    total = _sums(position, lit.ravel())
    divisor = np.where(total > 0, total, 1.0)

    def mean(values: Floats) -> Floats:
        return _sums(position, (lit * values).ravel()) / divisor

    level = total / np.maximum(count, 1)
    visible = _visible(geometry, edges.tobytes()).reshape(RINGS, SECTORS, -1).mean(axis=2)
    whole = (visible >= WHOLE) & (count > 0) & (level > DARKEST * level.max())
    return SectorGrid(
        sector=position,
        count=count,
        whole=whole.all(axis=1),
        light=total,
        radius_mm=mean(radius),
        growth_per_mm=mean(growth),
        flux=mean(flux),
        light_sd=light_sd,
        extent_mm=extent,
    )


@lru_cache(maxsize=8)
def _visible(geometry: _Geometry, edges: bytes) -> Floats:
    """Fraction of each ring in the picture along many directions, shape (rings, directions)."""
    (rows, columns), scale, axis, _ = geometry
    angle = (np.arange(FINE_ANGLES) + 0.5) * (2 * np.pi / FINE_ANGLES)
    squares = np.frombuffer(edges) ** 2
    fraction = (np.arange(FINE_RADII) + 0.5) / FINE_RADII
    radius = np.sqrt(squares[:-1, None] + np.diff(squares)[:, None] * fraction)[:, :, None]
    column, row = axis[0] + radius * np.cos(angle) / scale[0], axis[1] + radius * np.sin(angle) / scale[1]
    inside = (column >= -0.5) & (column <= columns - 0.5) & (row >= -0.5) & (row <= rows - 0.5)
    return np.asarray(inside.mean(axis=1))


DENT_MM, SLOPE = 0.5, 0.15  # standard deviations of the unknown displacement of the face and of its slope


@dataclass(frozen=True, slots=True, kw_only=True)
class Unevenness:
    """Test of harmonics against noise."""

    chance: float  # probability of harmonics this large by noise alone
    size_grey: float  # the harmonic in the ring of the largest signal-to-noise ratio, grey levels at uniform light
    radius_mm: float  # radius of that ring
    over_noise: float  # its size there over the standard deviation of one of its two parts


def harmonic(sectors: Floats, order: int) -> Complexes:
    """Harmonic of each ring, shape (rings,), of means over sectors, shape (rings, SECTORS).

    The attenuation by averaging over a sector is corrected.
    """
    return np.asarray(sectors @ _wave(order))


def harmonic_noise(sectors: Floats, order: int) -> Floats:
    """Variances of the real and imaginary part of `harmonic`, shape (2, rings), from those of the sectors."""
    wave = _wave(order)
    return np.stack([sectors @ wave.real**2, sectors @ wave.imag**2])


@lru_cache
def _wave(order: int) -> Complexes:
    """Weights of the sectors in a harmonic."""
    angle = (np.arange(SECTORS) + 0.5) * (2 * np.pi / SECTORS)
    return np.asarray(np.exp(1j * order * angle) * (2 / SECTORS) / np.sinc(order / SECTORS))


def shading_harmonics(grey: Floats, growth: Complexes, flux: Complexes, radius_mm: Floats) -> list[Complexes]:
    """Harmonics that lamps of unequal power give a round dent, for displacements of one standard deviation.

    All arguments have one value a ring: mean grey level at uniform light, and harmonics of the light's growth per mm
    and of its flux away from the axis.
    """
    fraction = radius_mm / radius_mm[-1]
    raised = [DENT_MM * fraction**power * growth * grey for power in (0, 2, 4)]
    tilted = [SLOPE * fraction**power * flux * grey for power in (1, 3)]
    return raised + tilted


def unevenness(values: Complexes, variance: Floats, radius_mm: Floats, *, given: list[Complexes]) -> Unevenness:
    """Compare the harmonics of rings with their noise.

    ``variance`` are the variances of their real and imaginary parts, shape (2, rings), positive. ``given`` are
    harmonics of allowed causes, each with a standard normal factor.
    """
    covariance = np.diag(variance.ravel())
    if given:
        causes = np.array([np.concatenate([cause.real, cause.imag]) for cause in given])
        covariance += causes.T @ causes
    both = np.concatenate([values.real, values.imag])
    square = float(both @ scipy.linalg.cho_solve(scipy.linalg.cho_factor(covariance), both))
    diagonal = np.diag(covariance)
    noise = np.sqrt((diagonal[: len(values)] + diagonal[len(values) :]) / 2)
    ring = int(np.argmax(np.abs(values) / noise))
    return Unevenness(
        chance=float(scipy.special.chdtrc(len(both), square)),
        size_grey=float(np.abs(values[ring])),
        radius_mm=float(radius_mm[ring]),
        over_noise=float(np.abs(values[ring]) / noise[ring]),
    )

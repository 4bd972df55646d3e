"""Smooth light from counted rays: the lamps' symmetries, polynomials in the slope, splines over the face."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from tsis.model.probe import Probe
    from tsis.optics._inputs import Floats


RINGS = (0.1, 0.2, 0.3, 0.4)  # slopes of the recorded tilted faces
DIRECTIONS = 8  # of slopes over half a turn; the flux gives the other half
POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4))
INTERVALS = 16  # of the splines, across the face
SUBPOINTS = 4  # of a bin's mean, along each side
STIFFNESS = 1e-4  # weight of the splines' second differences, relative to the counts


def watched_slopes() -> Floats:
    """Slopes (x, y) of the recorded tilted faces, shape (k, 2)."""
    angles = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
    return np.concatenate([size * np.column_stack([np.cos(angles), np.sin(angles)]) for size in RINGS])


def powers(slope_x: Floats, slope_y: Floats) -> Floats:
    """The `POWERS` of slopes, along a new first axis."""
    return np.stack([slope_x**i * slope_y**j for i, j in POWERS])


def slope_terms(level: Floats, flux: Floats, tilted: Floats) -> Floats:
    """Coefficients of the `POWERS` of the slopes, from light (..., n, n), flux (..., 2, n, n) and tilted faces.

    Let p be a direction's horizontal part over its drop. A face tilted by s receives ``max(0, 1 + p s)`` of the falling
    light and ``max(0, p s - 1)`` of the light reflected upwards. Their sum is ``p s + max(1, |p s|)``: a linear term,
    which is exactly the flux, and an even term, which is fitted.
    """
    slopes = watched_slopes()
    even = tilted - level[..., None, :, :] - np.einsum("kp,...pij->...kij", slopes, flux)
    fit = np.linalg.pinv(powers(*slopes.T)[3:].T)
    return np.concatenate([level[..., None, :, :], flux, np.einsum("tk,...kij->...tij", fit, even)], axis=-3)


def symmetries(probe: Probe) -> list[Floats]:
    """Rotations by right angles and mirrors that map the lamps onto themselves, as 2 x 2 matrices."""
    rotation, mirror = np.array([[0.0, -1.0], [1.0, 0.0]]), np.diag([1.0, -1.0])
    candidates = [np.linalg.matrix_power(rotation, k) @ flip for k in range(4) for flip in (np.eye(2), mirror)]
    lit = [led for led in probe.leds if led.power > 0]
    azimuth = np.radians([led.azimuth_deg for led in lit])
    position = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    kind = [(probe.led_height_mm(led), led.aim_deg, led.half_angle_deg, led.diameter_mm, led.power) for led in lit]
    equal = np.array([[item == other for other in kind] for item in kind])

    def is_symmetry(matrix: Floats) -> bool:
        difference = np.abs((position @ matrix.T)[:, None, :] - position[None, :, :]).max(axis=2)
        return bool(((difference < 1e-9) & equal).any(axis=1).all())

    return [matrix for matrix in candidates if is_symmetry(matrix)]


def symmetrised(level: Floats, flux: Floats, tilted: Floats, matrices: list[Floats]) -> tuple[Floats, Floats, Floats]:
    """Means over symmetries of the maps, the flux and the slopes."""
    slopes, count = watched_slopes(), level.shape[-1]
    x, y = np.meshgrid(*2 * [np.arange(count) - (count - 1) / 2])
    images = []
    for matrix in matrices:
        # A map at a bin takes the value at the bin that the symmetry maps to it, with its slope.
        origin_x, origin_y = (
            np.rint(part + (count - 1) / 2).astype(int) for part in np.einsum("qp,qij->pij", matrix, [x, y])
        )
        origin = slopes @ matrix
        difference = np.abs(origin[:, None, None, :] - np.stack([slopes, -slopes])[None]).max(axis=3)
        opposite, index = np.divmod(difference.reshape(len(slopes), -1).argmin(axis=1), len(slopes))
        along = np.einsum("kp,...pij->...kij", slopes[index], flux)
        light = tilted[..., index, :, :] - 2 * opposite[:, None, None] * along
        images.append(
            (
                level[..., origin_y, origin_x],
                np.einsum("pq,...qij->...pij", matrix, flux)[..., origin_y, origin_x],
                light[..., origin_y, origin_x],
            )
        )
    first, second, third = (np.mean(part, axis=0) for part in zip(*images, strict=True))
    return first, second, third


def smooth(maps: Floats, radius_mm: float, nodes: Floats) -> Floats:
    """Values at ``nodes`` (along x and y) of cubic splines whose means over bins fit ``maps`` (..., n, n).

    The fit omits bins across the wall; nodes beyond the wall have the value at the wall.
    """
    bins = maps.shape[-1]
    size = 2 * radius_mm / bins
    inner = (np.arange(bins * SUBPOINTS) + 0.5) * size / SUBPOINTS - radius_mm
    along = _splines(inner, radius_mm).reshape(bins, SUBPOINTS, -1).mean(axis=1)
    corner = np.abs((np.arange(bins) + 0.5) * size - radius_mm) + size / 2
    whole = np.hypot(corner, corner[:, None]) <= radius_mm
    design = np.einsum("ia,jb->ijab", along, along)[whole].reshape(np.count_nonzero(whole), -1)
    count = along.shape[1]
    bent = np.diff(np.eye(count), n=2, axis=0)
    roughness = np.kron(bent.T @ bent, np.eye(count)) + np.kron(np.eye(count), bent.T @ bent)
    values = maps[..., whole].reshape(-1, design.shape[0]).T
    solved = np.linalg.solve(design.T @ design + STIFFNESS * roughness, design.T @ values)
    x, y = np.meshgrid(nodes, nodes)
    pull = radius_mm / np.maximum(np.hypot(x, y), radius_mm)
    at_x, at_y = (_splines((part * pull).ravel(), radius_mm) for part in (x, y))
    result = np.einsum("pa,pb,abm->mp", at_y, at_x, solved.reshape(count, count, -1), optimize=True)
    return np.asarray(result.reshape(*maps.shape[:-2], *x.shape))


def _splines(at: Floats, radius_mm: float) -> Floats:
    """Cubic B-splines over the face's width, shape (len(at), count)."""
    ends = np.linspace(-radius_mm, radius_mm, INTERVALS + 1)
    knots = np.concatenate([[-radius_mm] * 3, ends, [radius_mm] * 3])
    return np.asarray(scipy.interpolate.BSpline.design_matrix(np.clip(at, -radius_mm, radius_mm), knots, 3).toarray())

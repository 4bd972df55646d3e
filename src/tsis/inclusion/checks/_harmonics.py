"""Harmonics around the axis in rings, and their test against noise.

A harmonic of order m is a complex number per ring: ``c + i s`` of ``c cos(m angle) + s sin(m angle)``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.inclusion.checks._sectors import SECTORS

if TYPE_CHECKING:
    from tsis.inclusion._prior import Complexes, Floats


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

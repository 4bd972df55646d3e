"""Harmonics of a frame that uneven tissue causes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.imaging.rendering import rough_contact, rough_contact_slope
from tsis.inclusion.checks.roundness import shift_chance
from tsis.inclusion.checks.sectors import RINGS, harmonic, harmonic_noise, sector_means, shading_harmonics
from tsis.inclusion.frames import OUTER_FRACTION
from tsis.inclusion.posterior.rings import ring_means
from tsis.inclusion.posterior.uneven_tissue import HARMONICS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.inclusion.checks.sectors import Sectors
    from tsis.inclusion.posterior.uneven_tissue import Heterogeneity
    from tsis.inclusion.prior import Booleans, Floats
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage
    from tsis.model.probe import Probe


INFORMATIVE = (2, 3, 4)  # harmonics that show the heterogeneity; tilt and offset cause the first
PRESSURES = 512  # of the table that inverts the contact's light
BY_LAMPS = 0.1  # of the lamps' power: a harmonic of their arrangement above this shows on a dent
BRIGHTEST = 20.0  # largest pressure of that table over the mean of the brightest frame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldHarmonics:
    """Harmonics of frames by a field of modulus in tissue without inclusion.

    Attributes
    ----------
    hypotheses
        Standard deviations and lengths of the field.
    calibration, probe
        Response of grey level to pressure; the probe that pressed.
    """

    hypotheses: Heterogeneity
    calibration: Calibration
    probe: Probe

    def factors(self, order: int, sectors: Sectors, force_n: float) -> Floats:
        """Factors (lengths, rings, k) of the covariance of either part of a harmonic, for a field of unit variance."""
        edges = np.linspace(0.0, OUTER_FRACTION * self.probe.radius_mm, RINGS + 1)
        table = self.hypotheses.table
        unit, _, shape, _ = np.split(table.harmonics[HARMONICS.index(order)], 4, axis=1)
        change = ring_means(table.radius_mm, edges) @ (force_n * unit + shape)
        return np.asarray(self._slope(sectors.grey.mean(axis=1))[:, None] * change)

    def covariance(self, order: int, sectors: Sectors, force_n: float) -> Floats:
        """Covariance (rings, rings) of either part of a harmonic, the mean over the hypotheses."""
        factors = self.factors(order, sectors, force_n)
        weight = np.exp(self.hypotheses.log_weight) * self.hypotheses.sd**2
        of_length = np.bincount(self.hypotheses.length, weights=weight, minlength=len(factors))
        return np.asarray(np.einsum("l,lik,ljk->ij", of_length, factors, factors))

    def columns(self, order: int, sectors: Sectors, force_n: float) -> Floats:
        """Either part of a harmonic of the rings, each with a standard normal factor, shape (rings, k)."""
        values, directions = np.linalg.eigh(self.covariance(order, sectors, force_n))
        return np.asarray(directions * np.sqrt(np.maximum(values, 0.0)))

    def of_sites(self, order: int, frames: Sequence[TactileImage]) -> Floats:
        """`columns` of frames of different sites, for their sum or difference."""
        return np.hstack([self.columns(order, self._sectors(frame), frame.force_n or 0.0) for frame in frames])

    def shift_chance(self, target: TactileImage, reference: TactileImage) -> float:
        """Probability of the first harmonic of the change without an inclusion off the axis."""
        columns = self.of_sites(1, [target, reference])
        allowed = [part * column for column in columns.T for part in (1, 1j)]
        return shift_chance(self._sectors(target), self._sectors(reference), self.calibration, allowed=allowed)

    def _sectors(self, frame: TactileImage) -> Sectors:
        return sector_means(frame, probe=self.probe, calibration=self.calibration)

    def _slope(self, grey: Floats) -> Floats:
        """Change of the light with pressure in rings of mean grey level."""
        top = BRIGHTEST * max(float(grey.max()), 1.0) / float(rough_contact_slope(np.zeros(1), self.calibration)[0])
        pressure = np.linspace(0.0, top, PRESSURES)
        at_ring = np.interp(grey, rough_contact(pressure, self.calibration), pressure)
        return np.asarray(rough_contact_slope(at_ring, self.calibration))


def heterogeneity_evidence(frames: Sequence[TactileImage], harmonics: FieldHarmonics) -> Floats:
    """Log evidence of each hypothesis from the harmonics of frames of one site, shape (hypotheses,).

    The field is the same for all frames; lamps and patterns are allowed for as in the check of roundness. Harmonics of
    lamps whose light on a dent is known around the axis only are left out: four lamps make the fourth.
    """
    calibration, hypotheses = harmonics.calibration, harmonics.hypotheses
    means = [sector_means(frame, probe=harmonics.probe, calibration=calibration) for frame in frames]
    use = np.logical_and.reduce([sectors.usable for sectors in means])
    use[0] = False  # a few pixels wide
    if not use.any():
        return np.zeros(len(hypotheses.sd))
    evidence = np.zeros(len(hypotheses.sd))
    for order in informative_orders(harmonics.probe, calibration):
        values = np.concatenate([harmonic(sectors.grey, order)[use] for sectors in means])
        noise = _noise(means, calibration, order, use)
        factors = np.concatenate(
            [
                harmonics.factors(order, sectors, frame.force_n or 0.0)[:, use]
                for frame, sectors in zip(frames, means, strict=True)
            ],
            axis=1,
        )
        fields = np.kron(np.eye(2), factors @ np.swapaxes(factors, 1, 2))
        covariance = noise + hypotheses.sd[:, None, None] ** 2 * fields[hypotheses.length]
        roots = np.linalg.cholesky(covariance)
        both = np.concatenate([values.real, values.imag])
        white = np.linalg.solve(roots, np.broadcast_to(both[:, None], (*roots.shape[:2], 1)))[:, :, 0]
        evidence -= 0.5 * (white**2).sum(axis=1) + np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    return evidence


def informative_orders(probe: Probe, calibration: Calibration) -> tuple[int, ...]:
    """The harmonics that no lamp makes, or whose light is known: a light that was measured is so as its mean only."""
    if calibration.light is not None and not calibration.light.factor.size:
        return INFORMATIVE
    power = np.array([lamp.power for lamp in probe.leds])
    angle = np.deg2rad([lamp.azimuth_deg for lamp in probe.leds])
    return tuple(order for order in INFORMATIVE if np.abs(power @ np.exp(1j * order * angle)) <= BY_LAMPS * power.sum())


def _noise(means: Sequence[Sectors], calibration: Calibration, order: int, use: Booleans) -> Floats:
    """Covariance of the real, then the imaginary parts of a harmonic in the used rings of all frames."""
    grid, size = means[0].grid, len(means) * int(use.sum())
    pattern = 2 * (calibration.pattern_sd**2 + grid.light_sd[use] ** 2)
    grey = np.concatenate([sectors.grey.mean(axis=1)[use] for sectors in means])
    same_ring = np.tile(np.eye(int(use.sum())), (len(means), len(means)))
    fixed = np.tile(pattern, len(means)) * same_ring * np.outer(grey, grey)
    fixed[np.diag_indices(size)] += 2 * (calibration.repeatability_sd * grey) ** 2
    covariance = np.kron(np.eye(2), fixed)
    pixels = [harmonic_noise(sectors.variance, order)[:, use] for sectors in means]
    covariance[np.diag_indices(2 * size)] += np.concatenate(pixels, axis=1).ravel()
    growth, flux = harmonic(grid.growth_per_mm, order)[use], harmonic(grid.flux, order)[use]
    radius, first = grid.ring_radius_mm[use], 0
    for sectors in means:  # each dent has its own displacement
        for cause in shading_harmonics(sectors.grey.mean(axis=1)[use], growth, flux, radius):
            column = np.zeros(2 * size)
            column[first : first + len(radius)] = cause.real
            column[size + first : size + first + len(radius)] = cause.imag
            covariance += np.outer(column, column)
        first += len(radius)
    return np.asarray(covariance)

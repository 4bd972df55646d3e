"""Ring profiles of grey level as a function of inclusion and nuisances, and what is unknown about them.

Nuisances, all normal with mean 0: log gain (shared), log tissue modulus, log slab thickness, log modulus of the
reference site over the target's, and for each frame log force and a constant offset.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.imaging.render import rough_contact, rough_contact_slope

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.prior import InclusionPrior
    from tsis.mechanics import Surrogate
    from tsis.model import Calibration

GAIN, TISSUE, THICKNESS, SITE, SHARED = 0, 1, 2, 3, 4
STEP = 0.02  # of log modulus and log thickness, for derivatives


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForwardModel:
    """Grey profiles of a set of frames.

    Attributes
    ----------
    rings
        Surrogate of the mean pressure in kPa of each ring at 1 N.
    calibration, prior
        Answer of grey level to pressure; tissue around the inclusion.
    force_n
        Force of each frame, shape (frames,).
    is_reference
        Whether each frame shows plain tissue, shape (frames,).
    """

    rings: Surrogate
    calibration: Calibration
    prior: InclusionPrior
    force_n: NDArray[np.float64]
    is_reference: NDArray[np.bool]

    def nuisance_sd(self, mean_grey: NDArray[np.float64]) -> NDArray[np.float64]:
        """Prior standard deviations of the nuisances; ``mean_grey`` (frames,) scales the offsets."""
        known = self.calibration
        shared = [known.gain_sd, self.prior.tissue_young_sd, self.prior.thickness_sd, known.site_sd]
        forces = np.full(len(self.force_n), known.force_sd)
        return np.concatenate([shared, forces, known.offset_sd * mean_grey])

    def profiles(
        self, inclusions: NDArray[np.float64], nuisance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Grey profiles and their derivatives by the nuisances.

        Parameters
        ----------
        inclusions
            Diameter, depth and modulus, shape (n, 3).
        nuisance
            Where to linearise, shape (nuisances,).

        Returns
        -------
        Grey levels, shape (n, frames, rings), and derivatives, shape (n, frames, rings, nuisances).
        """
        frames, count = len(self.force_n), len(inclusions)
        force, offset = nuisance[SHARED : SHARED + frames], nuisance[SHARED + frames :]
        grey = np.empty((count, frames, self.rings.plain.shape[-1]))
        slopes = np.zeros((*grey.shape, len(nuisance)))
        shown = set(self.is_reference.tolist())
        pressures = {plain: self._unit_pressure(inclusions, nuisance, reference=plain) for plain in shown}
        for frame in range(frames):
            unit, by_tissue, by_thickness = pressures[bool(self.is_reference[frame])]
            push = self.force_n[frame] * np.exp(force[frame])
            light = np.exp(nuisance[GAIN]) * rough_contact(push * unit, self.calibration)
            slope = np.exp(nuisance[GAIN]) * push * rough_contact_slope(push * unit, self.calibration)
            grey[:, frame] = light + offset[frame]
            slopes[:, frame, :, GAIN] = light
            slopes[:, frame, :, TISSUE] = slope * by_tissue
            slopes[:, frame, :, THICKNESS] = slope * by_thickness
            slopes[:, frame, :, SITE] = slope * by_tissue if self.is_reference[frame] else 0.0
            slopes[:, frame, :, SHARED + frame] = slope * unit
            slopes[:, frame, :, SHARED + frames + frame] = 1.0
        return grey, slopes

    def _unit_pressure(
        self, inclusions: NDArray[np.float64], nuisance: NDArray[np.float64], *, reference: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Ring pressures at 1 N, (n or 1, rings), and their derivatives by log modulus and log thickness."""
        log_tissue = nuisance[TISSUE] + (nuisance[SITE] if reference else 0.0)

        def pressure(tissue: float, thickness: float) -> NDArray[np.float64]:
            at = self.rings.at_tissue(
                self.prior.tissue_young_kpa * float(np.exp(tissue)), self.prior.thickness_mm * float(np.exp(thickness))
            )
            return at.plain[None] if reference else at(*inclusions.T)

        log_thickness = float(nuisance[THICKNESS])
        here = pressure(log_tissue, log_thickness)
        by_tissue = (pressure(log_tissue + STEP, log_thickness) - here) / STEP
        by_thickness = (pressure(log_tissue, log_thickness + STEP) - here) / STEP
        return here, by_tissue, by_thickness

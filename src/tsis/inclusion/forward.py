"""Ring profiles of grey level as a function of inclusion and nuisances, and what is unknown about them.

Nuisances, all normal with mean 0: log gain (shared), log tissue modulus, log slab thickness, log modulus of the
reference site over the target's, emphasis of the shading, and for each frame log force and a constant offset.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.imaging.render import rough_contact, rough_contact_slope
from tsis.inclusion.shading import TERMS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.prior import InclusionPrior
    from tsis.inclusion.shading import RingShading
    from tsis.mechanics import Surrogate
    from tsis.model import Calibration

GAIN, TISSUE, THICKNESS, SITE = 0, 1, 2, 3
SHADE, SHARED = slice(4, 4 + TERMS), 4 + TERMS
ANSWERS = 3  # of a press, a ring: pressure, displacement, slope
STEP = 0.02  # of log modulus and log thickness, for derivatives


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForwardModel:
    """Grey profiles of a set of frames.

    Attributes
    ----------
    rings
        Surrogate of a press at 1 N: mean pressure in kPa of each ring, then mean displacement of the face in mm, then
        its mean slope along the radius.
    level
        Light that each ring sees of the untouched face, shape (rings,): stray light does not pass through the face, so
        in grey levels over light it is a constant over this.
    shading
        What displacement and slope do to the light that each ring sees.
    calibration, prior
        Answer of grey level to pressure; tissue around the inclusion.
    force_n
        Force of each frame, shape (frames,).
    is_reference
        Whether each frame shows plain tissue, shape (frames,).
    """

    rings: Surrogate
    level: NDArray[np.float64]
    shading: RingShading
    calibration: Calibration
    prior: InclusionPrior
    force_n: NDArray[np.float64]
    is_reference: NDArray[np.bool]

    def nuisance_sd(self, mean_grey: NDArray[np.float64]) -> NDArray[np.float64]:
        """Prior standard deviations of the nuisances; ``mean_grey`` (frames,), as seen, scales the offsets."""
        known = self.calibration
        shared = [
            known.gain_sd,
            self.prior.tissue_young_sd,
            self.prior.thickness_sd,
            known.site_sd,
            *TERMS * [known.shading_sd],
        ]
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
        grey = np.empty((count, frames, self.rings.plain.shape[-1] // ANSWERS))
        slopes = np.zeros((*grey.shape, len(nuisance)))
        shown = set(self.is_reference.tolist())
        presses = {plain: self._unit_press(inclusions, nuisance, reference=plain) for plain in shown}
        for frame in range(frames):
            unit, by_tissue, by_thickness = presses[bool(self.is_reference[frame])]
            push = self.force_n[frame] * np.exp(force[frame])
            light, by_answer, by_shade = self._light(push * unit, nuisance[SHADE])
            gain, by_answer = np.exp(nuisance[GAIN]), np.exp(nuisance[GAIN]) * push * by_answer
            grey[:, frame] = gain * light + offset[frame] / self.level
            slopes[:, frame, :, GAIN] = gain * light
            slopes[:, frame, :, TISSUE] = _along(by_answer, by_tissue)
            slopes[:, frame, :, THICKNESS] = _along(by_answer, by_thickness)
            slopes[:, frame, :, SITE] = slopes[:, frame, :, TISSUE] if self.is_reference[frame] else 0.0
            slopes[:, frame, :, SHADE] = gain * by_shade
            slopes[:, frame, :, SHARED + frame] = _along(by_answer, unit)
            slopes[:, frame, :, SHARED + frames + frame] = 1 / self.level
        return grey, slopes

    def _light(
        self, press: NDArray[np.float64], emphasis: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Grey levels of presses (n, 3 rings) at nominal gain, and derivatives by each answer and by the emphasis."""
        pressure, displacement, slope = np.split(press, ANSWERS, axis=-1)
        contact = rough_contact(pressure, self.calibration)
        shade = self.shading(displacement, slope, emphasis)
        by_pressure = rough_contact_slope(pressure, self.calibration) * shade.factor
        by_answer = np.concatenate([by_pressure, contact * shade.by_displacement, contact * shade.by_slope], axis=-1)
        return contact * shade.factor, by_answer, contact[..., None] * shade.by_emphasis

    def _unit_press(
        self, inclusions: NDArray[np.float64], nuisance: NDArray[np.float64], *, reference: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Answers of a press at 1 N, (n or 1, 3 rings), and their derivatives by log modulus and log thickness."""
        log_tissue = nuisance[TISSUE] + (nuisance[SITE] if reference else 0.0)

        def answer(tissue: float, thickness: float) -> NDArray[np.float64]:
            at = self.rings.at_tissue(
                self.prior.tissue_young_kpa * float(np.exp(tissue)), self.prior.thickness_mm * float(np.exp(thickness))
            )
            return at.plain[None] if reference else at(*inclusions.T)

        log_thickness = float(nuisance[THICKNESS])
        here = answer(log_tissue, log_thickness)
        by_tissue = (answer(log_tissue + STEP, log_thickness) - here) / STEP
        by_thickness = (answer(log_tissue, log_thickness + STEP) - here) / STEP
        return here, by_tissue, by_thickness


def _along(by_answer: NDArray[np.float64], direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of the rings' light along a change of the press: the sum over the three answers."""
    return np.asarray(sum(np.split(by_answer * direction, ANSWERS, axis=-1)))

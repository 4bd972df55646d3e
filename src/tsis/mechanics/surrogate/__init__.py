"""Presses as polynomials over a box of inclusions and tissues, with their measured error and a disk cache."""

from tsis.mechanics._mesh import mechanical_content
from tsis.mechanics.surrogate._build import build_surrogate
from tsis.mechanics.surrogate._correction_build import build_finite_correction
from tsis.mechanics.surrogate._finite_correction import CorrectionBox, FiniteCorrection, correction_box, wide_box
from tsis.mechanics.surrogate._full_contact import (
    FULL_CONTACT_DEGREES,
    FullContactParts,
    FullContactProfiles,
    FullContactSurrogate,
    build_full_contact_surrogate,
)
from tsis.mechanics.surrogate._polynomial import (
    Box,
    Degrees,
    PressSurrogate,
    Surrogate,
    TissueSurrogate,
    contrast_factor,
    signal_scale,
)

__all__ = [
    "FULL_CONTACT_DEGREES",
    "Box",
    "CorrectionBox",
    "Degrees",
    "FiniteCorrection",
    "FullContactParts",
    "FullContactProfiles",
    "FullContactSurrogate",
    "PressSurrogate",
    "Surrogate",
    "TissueSurrogate",
    "build_finite_correction",
    "build_full_contact_surrogate",
    "build_surrogate",
    "contrast_factor",
    "correction_box",
    "mechanical_content",
    "signal_scale",
    "wide_box",
]

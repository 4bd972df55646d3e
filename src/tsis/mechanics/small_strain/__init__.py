"""Presses at small strain: layers condensed onto the face, and unilateral contact."""

from tsis.mechanics.small_strain._bodies import Resolution
from tsis.mechanics.small_strain._contact import PartialContact
from tsis.mechanics.small_strain._indentation import Indentation, indent
from tsis.mechanics.small_strain._press import (
    STRAIN_LIMIT,
    FacePress,
    PressKernel,
    nominal_strain,
    small_strain_press,
    strain_problem,
)
from tsis.mechanics.small_strain._relaxation import RelaxingPress, relaxing_press, settling_time_s

__all__ = [
    "STRAIN_LIMIT",
    "FacePress",
    "Indentation",
    "PartialContact",
    "PressKernel",
    "RelaxingPress",
    "Resolution",
    "indent",
    "nominal_strain",
    "relaxing_press",
    "settling_time_s",
    "small_strain_press",
    "strain_problem",
]

"""Deformation of probe and tissue under a press: closed forms, finite elements, and a fast surrogate."""

from typing import TYPE_CHECKING

import lazy_loader

from tsis.mechanics._closed_form import HertzContact, effective_modulus_kpa, hertz_under_force
from tsis.mechanics._element import stiffness
from tsis.mechanics._face import hats
from tsis.mechanics._mesh import face_lines, graded, mesh_rectangle, outer_lines, two_sided_lines
from tsis.mechanics._modulus_test import MeasuredModulus, bonded_factor, compression_modulus, indentation_modulus
from tsis.mechanics._press import press

__all__ = [
    "HertzContact",
    "MeasuredModulus",
    "bonded_factor",
    "compression_modulus",
    "effective_modulus_kpa",
    "face_lines",
    "graded",
    "hats",
    "hertz_under_force",
    "indentation_modulus",
    "mesh_rectangle",
    "outer_lines",
    "press",
    "stiffness",
    "two_sided_lines",
]

if not TYPE_CHECKING:  # subpackages load when they are first used
    __getattr__ = lazy_loader.attach(__name__, ["finite_strain", "gel", "small_strain", "solid", "surrogate"])[0]

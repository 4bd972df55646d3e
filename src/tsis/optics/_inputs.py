"""Input checks of the optical calls: lengths in micrometres, real refractive indices."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tsis.errors import InputError
from tsis.model.require import require_array, require_number

Booleans = NDArray[np.bool]
Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SHORTEST_UM, LONGEST_UM = 0.1, 20.0
THINNEST_UM, THICKEST_UM = 1e-4, 1e6
LARGEST_INDEX = 5.0
OTHER_UNITS = {"metres": 1e6, "millimetres": 1e3, "nanometres": 1e-3}  # in micrometres


def require_wavelength(value: object) -> float:
    """Check a vacuum wavelength in micrometres; the message names another unit that would fit."""
    result = require_number("wavelength_um", value, -np.inf, np.inf)
    if SHORTEST_UM <= result <= LONGEST_UM:
        return result
    for unit, factor in OTHER_UNITS.items():
        converted = result * factor
        if SHORTEST_UM <= converted <= LONGEST_UM:
            cure = f" (that looks like {unit}; give {converted:g})"
            break
    else:
        cure = " (micrometres; green light is 0.55)"
    raise InputError(f"wavelength_um must lie in [{SHORTEST_UM:g}, {LONGEST_UM:g}]; got {result:g}{cure}")


def require_refractive_index(name: str, value: object) -> float:
    """Check a real refractive index."""
    if isinstance(value, complex | np.complexfloating):
        raise InputError(f"{name} must be real, so without absorption or gain; got {value}")
    return require_number(name, value, 1.0, LARGEST_INDEX, hint="1 is vacuum")


def require_stack(index: Any, thickness_um: Any) -> tuple[Floats, Floats]:
    """Check the refractive index and the thickness in micrometres of each layer."""
    if np.iscomplexobj(index):
        raise InputError("index must be real, so without absorption or gain; got complex values")
    indices = require_array("index", index, ndim=1)
    thicknesses = require_array("thickness_um", thickness_um, ndim=1)
    if len(indices) != len(thicknesses):
        raise InputError(f"index and thickness_um must be of one length; got {len(indices)} and {len(thicknesses)}")
    for layer, value in enumerate(indices):
        require_refractive_index(f"index[{layer}]", float(value))
    for layer, value in enumerate(thicknesses):
        require_number(f"thickness_um[{layer}]", float(value), THINNEST_UM, THICKEST_UM, hint="micrometres")
    return indices, thicknesses

"""Young's modulus of a pressed object, corrected for the probe's own compliance."""

from tsis.hardness._contact_readings import TouchReading, as_touch_readings
from tsis.hardness._estimate import RADIUS_SD_MM, estimate, require_radius
from tsis.hardness._exploration import HardnessPrior
from tsis.hardness._likelihood import DRIFT_SD
from tsis.hardness._object_geometry import ObjectGeometry
from tsis.hardness._printed import (
    STRESSES,
    PrintedHardness,
    axial_strain,
    lagrangian_strain,
    printed_axial_strain,
    printed_estimate,
)
from tsis.hardness._reading import BLUR_MM, ContactReading, read_contact
from tsis.hardness._shore import ShoreHardness, shore
from tsis.hardness._sphere import hertzian_radius_mm, press_fields, require_small_sphere
from tsis.hardness._table import ContactTable, build_contact_table
from tsis.hardness._touch_estimate import estimate_from_contacts
from tsis.hardness.flags import HARDNESS_FLAGS

__all__ = [
    "BLUR_MM",
    "DRIFT_SD",
    "HARDNESS_FLAGS",
    "RADIUS_SD_MM",
    "STRESSES",
    "ContactReading",
    "ContactTable",
    "HardnessPrior",
    "ObjectGeometry",
    "PrintedHardness",
    "ShoreHardness",
    "TouchReading",
    "as_touch_readings",
    "axial_strain",
    "build_contact_table",
    "estimate",
    "estimate_from_contacts",
    "hertzian_radius_mm",
    "lagrangian_strain",
    "press_fields",
    "printed_axial_strain",
    "printed_estimate",
    "read_contact",
    "require_radius",
    "require_small_sphere",
    "shore",
]

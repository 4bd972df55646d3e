"""How stiff a touched object is: contact mechanics without the probe's own compliance."""

from tsis.hardness.contact_table import ContactTable
from tsis.hardness.frames import require_radius
from tsis.hardness.posterior import estimate
from tsis.hardness.printed import PrintedHardness, printed_estimate
from tsis.hardness.prior import HardnessPrior
from tsis.hardness.reading import ContactReading, read_contact
from tsis.hardness.shore import ShoreHardness, shore
from tsis.hardness.strain import axial_strain, lagrangian_strain, printed_axial_strain
from tsis.hardness.table_build import build_contact_table

__all__ = [
    "ContactReading",
    "ContactTable",
    "HardnessPrior",
    "PrintedHardness",
    "ShoreHardness",
    "axial_strain",
    "build_contact_table",
    "estimate",
    "lagrangian_strain",
    "printed_axial_strain",
    "printed_estimate",
    "read_contact",
    "require_radius",
    "shore",
]

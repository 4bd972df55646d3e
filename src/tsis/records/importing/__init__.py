"""What other commands and cameras wrote, taken into a store: looked through first, then stored press by press."""

from tsis.records.importing.cited import stored_calibration
from tsis.records.importing.entering import Entered, Entering, enter, require_enterable
from tsis.records.importing.found import ImportBatch, ImportOptions, IncomingPress
from tsis.records.importing.places import find_import_batches

__all__ = [
    "Entered",
    "Entering",
    "ImportBatch",
    "ImportOptions",
    "IncomingPress",
    "enter",
    "find_import_batches",
    "require_enterable",
    "stored_calibration",
]

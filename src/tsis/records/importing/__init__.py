"""What other commands and cameras wrote, taken into a store: looked through first, then stored press by press."""

from tsis.records.importing._entering import Entered, Entering, enter, require_enterable, truth_note
from tsis.records.importing._found import ImportBatch, ImportOptions, IncomingPress, stored_calibration
from tsis.records.importing._places import find_import_batches
from tsis.records.importing._present import numbered
from tsis.records.importing._results import enter_estimate, new_target
from tsis.records.importing._snapshots import save_snapshot_to_store

__all__ = [
    "Entered",
    "Entering",
    "ImportBatch",
    "ImportOptions",
    "IncomingPress",
    "enter",
    "enter_estimate",
    "find_import_batches",
    "new_target",
    "numbered",
    "require_enterable",
    "save_snapshot_to_store",
    "stored_calibration",
    "truth_note",
]

"""Import of frames from other commands and cameras into a store: checked first, then stored press by press."""

from tsis.records.importing._acquired import save_snapshot_to_store
from tsis.records.importing._batch import ImportBatch, ImportOptions, IncomingPress, stored_calibration
from tsis.records.importing._discovery import find_import_batches
from tsis.records.importing._importing import (
    ImportedBatch,
    ImportProgress,
    import_batches,
    require_importable,
    truth_note,
)
from tsis.records.importing._matching import target_by_number
from tsis.records.importing._results import enter_estimate, new_target

__all__ = [
    "ImportBatch",
    "ImportOptions",
    "ImportProgress",
    "ImportedBatch",
    "IncomingPress",
    "enter_estimate",
    "find_import_batches",
    "import_batches",
    "new_target",
    "require_importable",
    "save_snapshot_to_store",
    "stored_calibration",
    "target_by_number",
    "truth_note",
]

"""FIXME."""

from tsis.records.store._audit import AuditChange, append_audit, locked_head
from tsis.records.store._database import DATABASE_FILE, Database
from tsis.records.store._editing import EDITABLE
from tsis.records.store._files import frame_bytes, samples_bytes, samples_of
from tsis.records.store._opening import default_folder, open_store
from tsis.records.store._reader import MOST_AT_ONCE, press_query
from tsis.records.store._rows import press_row, target_row
from tsis.records.store._secret import derived
from tsis.records.store._store import Store
from tsis.records.store._summary import TargetSummary
from tsis.records.store._tables import frames, presses, targets
from tsis.records.store._transfer import ImportedTarget
from tsis.records.store._verification import StoreVerification, verify_store

__all__ = [
    "DATABASE_FILE",
    "EDITABLE",
    "MOST_AT_ONCE",
    "AuditChange",
    "Database",
    "ImportedTarget",
    "Store",
    "StoreVerification",
    "TargetSummary",
    "append_audit",
    "default_folder",
    "derived",
    "frame_bytes",
    "frames",
    "locked_head",
    "open_store",
    "press_query",
    "press_row",
    "presses",
    "samples_bytes",
    "samples_of",
    "target_row",
    "targets",
    "verify_store",
]

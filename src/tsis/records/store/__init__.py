"""The store: files under their hash, rows in SQLite or PostgreSQL, and a chained audit of both."""

from tsis.records.schema import calibration_table, frame_table, press_table, target_table
from tsis.records.store._audit import AuditChange, append_audit, locked_head
from tsis.records.store._backup import back_up_store
from tsis.records.store._database import DATABASE_FILE, Database, derived
from tsis.records.store._editing import EDITABLE
from tsis.records.store._files import frame_bytes, samples_bytes, samples_of
from tsis.records.store._opening import default_folder, open_store
from tsis.records.store._reader import ARCHIVED, DELETED, MOST_AT_ONCE, TargetState, TargetSummary, press_query
from tsis.records.store._removal import UNDO_DAYS
from tsis.records.store._rows import press_of_row, press_row, target_of_row, target_row
from tsis.records.store._store import Store
from tsis.records.store._transfer import ImportedTarget
from tsis.records.store._verification import StoreVerification, verify_store

__all__ = [
    "ARCHIVED",
    "DATABASE_FILE",
    "DELETED",
    "EDITABLE",
    "MOST_AT_ONCE",
    "UNDO_DAYS",
    "AuditChange",
    "Database",
    "ImportedTarget",
    "Store",
    "StoreVerification",
    "TargetState",
    "TargetSummary",
    "append_audit",
    "back_up_store",
    "calibration_table",
    "default_folder",
    "derived",
    "frame_bytes",
    "frame_table",
    "locked_head",
    "open_store",
    "press_of_row",
    "press_query",
    "press_row",
    "press_table",
    "samples_bytes",
    "samples_of",
    "target_of_row",
    "target_row",
    "target_table",
    "verify_store",
]

"""What was measured, kept so that it is never lost, can be believed, computed again, and read by others."""

from tsis.records.dossier import TargetRecord
from tsis.records.environment import environment
from tsis.records.opening import default_folder, open_store
from tsis.records.store import Store
from tsis.records.summary import TargetSummary
from tsis.records.values import StoredEstimate, StoredPress, Target
from tsis.records.verification import StoreVerification, verify_store

__all__ = [
    "Store",
    "StoreVerification",
    "StoredEstimate",
    "StoredPress",
    "Target",
    "TargetRecord",
    "TargetSummary",
    "default_folder",
    "environment",
    "open_store",
    "verify_store",
]

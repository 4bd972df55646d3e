"""What was measured, kept so that it is never lost, can be believed, computed again, and read by others."""

from tsis.records.dossier import Dossier
from tsis.records.environment import environment
from tsis.records.opening import default_folder, open_store
from tsis.records.store import Store
from tsis.records.summary import TargetSummary
from tsis.records.values import Press, StoredEstimate, Target
from tsis.records.verification import Verification, verify

__all__ = [
    "Dossier",
    "Press",
    "Store",
    "StoredEstimate",
    "Target",
    "TargetSummary",
    "Verification",
    "default_folder",
    "environment",
    "open_store",
    "verify",
]

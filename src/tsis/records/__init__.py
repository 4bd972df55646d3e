"""What was measured, kept so that it is never lost, can be believed, computed again, and read by others."""

from tsis.records.dossier import Dossier
from tsis.records.values import Press, StoredEstimate, Target

__all__ = ["Dossier", "Press", "StoredEstimate", "Target"]

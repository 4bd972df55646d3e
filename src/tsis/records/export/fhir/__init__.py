"""What was measured as FHIR resources: a Bundle of Observations that is valid as R4B and as R5."""

from tsis.records.export.fhir.bundle import fhir_observations

__all__ = ["fhir_observations"]

"""What uneven tissue does to a press: its linear response to a field of the tissue's modulus, harmonic by harmonic."""

from tsis.mechanics.tissue_field._response import (
    FieldMesh,
    FieldResponse,
    TissueFieldResponse,
    field_factors,
    field_features,
)

__all__ = ["FieldMesh", "FieldResponse", "TissueFieldResponse", "field_factors", "field_features"]
